#include "bumblebee/file_transport.h"

#include <chrono>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <thread>
#include <utility>

#include "bumblebee/transports.h"
#include "scanner/bumblebee/decode.h"

namespace scanner::bumblebee {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<std::uint8_t>;

/// Both eyes, 8 bit and one channel each, and how they are to be read.
struct Picture {
  cv::Mat left, right;
  PixelFormat pixels = PixelFormat::kMono8;
};

PixelFormat formatByName(const fs::path& path) {
  const std::string name = path.parent_path().string() + "/" + path.filename().string();
  for (const PixelFormat format : {PixelFormat::kBayerRggb8, PixelFormat::kBayerBggr8,
                                   PixelFormat::kBayerGbrg8, PixelFormat::kBayerGrbg8}) {
    if (name.find(toString(format)) != std::string::npos) return format;
  }
  return PixelFormat::kMono8;
}

/// One colour per pixel, red at the top left.
cv::Mat sampleBayer(const cv::Mat& bgr) {
  cv::Mat tile(bgr.size(), CV_8UC1);
  for (int y = 0; y < bgr.rows; ++y) {
    const auto* in = bgr.ptr<cv::Vec3b>(y);
    auto* out = tile.ptr<std::uint8_t>(y);
    for (int x = 0; x < bgr.cols; ++x) out[x] = in[x][2 - (y % 2 + x % 2)];
  }
  return tile;
}

/// JPEG decoders make a picture of a file that was cut off and fill it up with grey. The end
/// marker, behind the last scan, is missing then; neither marker occurs in coded data.
bool isCutOffJpeg(const Bytes& file) {
  if (file.size() < 2 || file[0] != 0xFF || file[1] != 0xD8) return false;
  for (std::size_t i = file.size() - 1; i > 0; --i) {
    if (file[i - 1] != 0xFF) continue;
    if (file[i] == 0xD9) return false;
    if (file[i] == 0xDA) return true;
  }
  return true;
}

/// Nothing in a file may do more than make this fail.
cv::Mat readPicture(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  const Bytes file{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  if (file.empty() || isCutOffJpeg(file)) return {};
  try {
    return cv::imdecode(file, cv::IMREAD_UNCHANGED | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const std::exception&) {  // OpenCV throws for sizes that it does not believe
    return {};
  }
}

Status problem(const fs::path& path, const std::string& what) {
  return {StatusCode::kInvalidInput, path.filename().string() + ": " + what};
}

Result<Picture> readInterleaved(const fs::path& path) {
  const cv::Mat both = readPicture(path);
  if (both.empty()) return problem(path, "no picture that can be read");
  if (both.type() != CV_16UC1) {
    return problem(path, "neither one of a pair (no left or right in its name) nor 16 bit");
  }
  Picture picture{cv::Mat(both.size(), CV_8UC1), cv::Mat(both.size(), CV_8UC1), formatByName(path)};
  for (int y = 0; y < both.rows; ++y) {
    for (int x = 0; x < both.cols; ++x) {
      const unsigned value = both.at<std::uint16_t>(y, x);
      picture.left.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(value & 0xFFU);
      picture.right.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(value >> 8U);
    }
  }
  return picture;
}

Result<Picture> readPair(const FramePaths& paths) {
  if (!paths.interleaved.empty()) return readInterleaved(paths.interleaved);
  if (paths.right.empty()) return problem(paths.left, "its right picture is missing");
  if (paths.left.empty()) return problem(paths.right, "its left picture is missing");
  Picture picture{readPicture(paths.left), readPicture(paths.right), formatByName(paths.left)};
  if (picture.left.empty()) return problem(paths.left, "no picture that can be read");
  if (picture.right.empty()) return problem(paths.right, "no picture that can be read");
  if (picture.left.size() != picture.right.size() || picture.left.type() != picture.right.type()) {
    return problem(paths.left, "its right picture is of another size or kind");
  }
  if (picture.left.type() == CV_8UC3) {
    picture.left = sampleBayer(picture.left);
    picture.right = sampleBayer(picture.right);
    picture.pixels = PixelFormat::kBayerRggb8;
  } else if (picture.left.type() != CV_8UC1) {
    return problem(paths.left, "neither 8-bit grey nor 8-bit colour");
  }
  return picture;
}

FrameFormat formatOf(const Picture& picture) {
  FrameFormat format;
  format.width_px = picture.left.cols;
  format.height_px = picture.left.rows;
  format.pixels = picture.pixels;
  return format;
}

std::shared_ptr<const Bytes> interleave(const Picture& picture) {
  auto bytes = std::make_shared<Bytes>(2 * picture.left.total());
  std::size_t i = 0;
  for (int y = 0; y < picture.left.rows; ++y) {
    const auto* left = picture.left.ptr<std::uint8_t>(y);
    const auto* right = picture.right.ptr<std::uint8_t>(y);
    for (int x = 0; x < picture.left.cols; ++x) {
      (*bytes)[i++] = left[x];
      (*bytes)[i++] = right[x];
    }
  }
  return bytes;
}

Status noControls() { return {StatusCode::kUnsupported, "recorded pictures have no controls"}; }
Status noRegisters() { return {StatusCode::kUnsupported, "recorded pictures have no registers"}; }

class PicturePlayer : public StereoCamera {
 public:
  PicturePlayer(fs::path folder, std::vector<FramePaths> frames, const FrameFormat& format,
                const TransportOptions& options)
      : folder_(std::move(folder)),
        frames_(std::move(frames)),
        format_(format),
        repeat_(options.file_repeat),
        period_(fromSeconds(1.0 / options.file_rate_hz)) {}

  CameraIdentity identity() const override {
    CameraIdentity identity;
    identity.transport = Transport::kFile;
    identity.address = folder_.string();
    identity.model = "recorded pictures";
    return identity;
  }
  Capabilities capabilities() const override {
    Capabilities c;
    c.width_px = format_.width_px;
    c.height_px = format_.height_px;
    c.frame_counter = true;
    c.device_clock = true;
    return c;
  }
  Result<FrameFormat> configure(int width_px, int height_px, const Controls& controls) override {
    if ((width_px != 0 && width_px != format_.width_px) ||
        (height_px != 0 && height_px != format_.height_px)) {
      return Status(StatusCode::kUnsupported, "the recorded pictures are " +
                                                  std::to_string(format_.width_px) + "x" +
                                                  std::to_string(format_.height_px));
    }
    if (Status status = setControls(controls); !status) return status;
    return format_;
  }
  Status start() override {
    next_ = 0;
    statistics_ = {};
    started_ = std::chrono::steady_clock::now();
    playing_ = true;
    return Status::ok();
  }
  Result<RawFrame> grab(Duration timeout) override;
  void stop() override { playing_ = false; }

  Status setControls(const Controls& c) override {
    const bool any =
        c.exposure_s || c.gain_db || c.rate_hz || c.white_balance_blue || c.white_balance_red;
    return any ? noControls() : Status::ok();
  }
  Result<Controls> controls() const override {
    Controls c;
    c.rate_hz = 1.0 / toSeconds(period_);
    return c;
  }
  Result<std::uint32_t> readRegister(std::uint64_t) const override { return noRegisters(); }
  Status writeRegister(std::uint64_t, std::uint32_t) override { return noRegisters(); }
  TransportStatistics statistics() const override { return statistics_; }

 private:
  Status fill(const FramePaths& paths, RawFrame& frame) const;

  const fs::path folder_;
  const std::vector<FramePaths> frames_;
  const FrameFormat format_;
  const bool repeat_;
  const Duration period_;
  bool playing_ = false;
  std::uint64_t next_ = 0;  ///< frame, counted over repetitions
  std::chrono::steady_clock::time_point started_;
  TransportStatistics statistics_;
};

Status PicturePlayer::fill(const FramePaths& paths, RawFrame& frame) const {
  const Result<Picture> picture = readPair(paths);
  if (!picture) return picture.status();
  const FrameFormat format = formatOf(*picture);
  const fs::path& path = paths.interleaved.empty() ? paths.left : paths.interleaved;
  if (format.width_px != format_.width_px || format.height_px != format_.height_px) {
    return problem(path, std::to_string(format.width_px) + "x" + std::to_string(format.height_px) +
                             " pixels instead of " + std::to_string(format_.width_px) + "x" +
                             std::to_string(format_.height_px));
  }
  if (format.pixels != format_.pixels) {
    return problem(
        path, std::string(toString(format.pixels)) + " instead of " + toString(format_.pixels));
  }
  frame.bytes = interleave(*picture);
  return Status::ok();
}

Result<RawFrame> PicturePlayer::grab(Duration timeout) {
  if (!playing_) return Status(StatusCode::kOutOfRange, "the player is stopped");
  if (next_ >= frames_.size() && !repeat_) {
    return Status(StatusCode::kIoError, std::string(kEndOfRecording) + ": " +
                                            std::to_string(frames_.size()) + " frames of " +
                                            folder_.string());
  }
  using Steady = std::chrono::steady_clock;
  const Duration device_time = static_cast<Duration::rep>(next_) * period_;
  const Steady::time_point due = started_ + device_time;
  const Steady::time_point latest = Steady::now() + timeout;
  std::this_thread::sleep_until(std::min(due, latest));  // the frame rate itself
  if (due > latest) return Status(StatusCode::kOutOfRange, "no frame yet");
  RawFrame frame;
  frame.status = fill(frames_[next_ % frames_.size()], frame);
  frame.counter = ++next_;
  frame.counter_max = UINT64_MAX;
  frame.counter_first = 1;
  frame.device_time = device_time;
  frame.arrival = Time(
      std::chrono::duration_cast<Duration>(std::chrono::system_clock::now().time_since_epoch()));
  if (frame.status) {
    ++statistics_.frames;
    statistics_.bytes += frame.bytes->size();
  } else {
    ++statistics_.incomplete;
  }
  return frame;
}

}  // namespace

Result<std::unique_ptr<StereoCamera>> openFile(const std::string& address,
                                               const TransportOptions& options) {
  if (!(options.file_rate_hz > 0.001 && options.file_rate_hz <= 1e4)) {
    return Status(StatusCode::kInvalidInput, "file_rate_hz lies within 0.001 .. 10000");
  }
  std::error_code error;
  if (!std::filesystem::is_directory(address, error)) {
    return Status(StatusCode::kIoError, "no folder of pictures: '" + address + "'");
  }
  std::vector<FramePaths> frames = findFrames(address);
  Status first_problem(StatusCode::kIoError, "no pictures in " + address);
  for (const FramePaths& paths : frames) {
    const Result<Picture> picture = readPair(paths);
    Status status = picture ? checkFormat(formatOf(*picture)) : picture.status();
    if (status) {
      return std::unique_ptr<StereoCamera>(
          std::make_unique<PicturePlayer>(address, std::move(frames), formatOf(*picture), options));
    }
    if (&paths == &frames.front()) first_problem = status;
  }
  return first_problem;
}

}  // namespace scanner::bumblebee
