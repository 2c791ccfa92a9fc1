#include "scanner/simulation/emulated_bumblebee.h"

#include <arv.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <mutex>
#include <stdexcept>

#include "support/camera_port_lock.h"

namespace scanner::simulation {
namespace {

constexpr guint64 kPatienceUs = 5000000;  ///< what a busy machine may take

struct Unref {
  void operator()(gpointer object) const { g_object_unref(object); }
};
template <typename T>
using Object = std::unique_ptr<T, Unref>;

/// A driver's view of the camera. Errors of Aravis become failures of the test.
class Client {
 public:
  Client() {
    camera_.reset(arv_camera_new("127.0.0.1", &error_));
    expectNoError();
  }
  ~Client() { g_clear_error(&error_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  bool connected() const { return camera_ != nullptr; }
  ArvCamera* camera() { return camera_.get(); }
  GError** error() { return &error_; }
  void expectNoError() { EXPECT_EQ(error_, nullptr) << (error_ != nullptr ? error_->message : ""); }

  void stream() {
    stream_.reset(arv_camera_create_stream(camera(), nullptr, nullptr, error()));
    expectNoError();
    ASSERT_NE(stream_, nullptr);
    // What is lost stays lost: the camera sends nothing twice.
    g_object_set(stream_.get(), "packet-resend", ARV_GV_STREAM_PACKET_RESEND_NEVER,
                 "frame-retention", 200000U, nullptr);
    const size_t payload = arv_camera_get_payload(camera(), error());
    for (int i = 0; i < 6; ++i)
      arv_stream_push_buffer(stream_.get(), arv_buffer_new(payload, nullptr));
    arv_camera_start_acquisition(camera(), error());
    expectNoError();
  }
  Object<ArvBuffer> next(guint64 patience_us = kPatienceUs) {
    return Object<ArvBuffer>(arv_stream_timeout_pop_buffer(stream_.get(), patience_us));
  }
  /// The next buffer that is whole.
  Object<ArvBuffer> nextWhole() {
    for (int i = 0; i < 50; ++i) {
      Object<ArvBuffer> buffer = next();
      if (!buffer) return nullptr;
      if (arv_buffer_get_status(buffer.get()) == ARV_BUFFER_STATUS_SUCCESS) return buffer;
      giveBack(std::move(buffer));
    }
    return nullptr;
  }
  void giveBack(Object<ArvBuffer> buffer) {
    arv_stream_push_buffer(stream_.get(), buffer.release());
  }
  void stop() {
    arv_camera_stop_acquisition(camera(), error());
    stream_.reset();
  }

 private:
  GError* error_ = nullptr;
  Object<ArvCamera> camera_;
  Object<ArvStream> stream_;
};

cv::Mat imageOf(ArvBuffer* buffer) {
  size_t size = 0;
  const void* data = arv_buffer_get_image_data(buffer, &size);
  const cv::Size image(arv_buffer_get_image_width(buffer), arv_buffer_get_image_height(buffer));
  EXPECT_EQ(size, static_cast<size_t>(image.area()) * 2);
  return cv::Mat(image, CV_16UC1, const_cast<void*>(data)).clone();
}

/// A picture without any symmetry, other for each eye and frame.
cv::Mat pattern(cv::Size size, int eye, std::uint64_t number) {
  cv::Mat image(size, CV_8UC1);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const int value = 7 * x + 13 * y + 101 * eye + 29 * static_cast<int>(number);
      image.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(value);
    }
  }
  return image;
}

StereoFrame frameOf(cv::Size size, std::uint64_t number) {
  return {{},
          {pattern(size, 0, number), PixelFormat::kMono8},
          {pattern(size, 1, number), PixelFormat::kMono8}};
}

bool equal(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0.0;
}

class EmulatedBumblebeeTest : public testing::Test {
 protected:
  EmulatedBumblebee::FrameSource source() {
    return [this](std::uint64_t number, const Exposure& exposure) {
      const std::lock_guard<std::mutex> guard(mutex_);
      exposure_ = exposure;
      return frameOf({width_, height_}, number);
    };
  }
  Exposure exposure() {
    const std::lock_guard<std::mutex> guard(mutex_);
    return exposure_;
  }
  EmulatedBumblebee::Options small(double rate_hz) const {
    EmulatedBumblebee::Options options;
    options.width_px = width_;
    options.height_px = height_;
    options.rate_hz = rate_hz;
    return options;
  }
  /// A bare socket on the port: whether the camera has left it.
  static bool portIsFree() {
    GError* error = nullptr;
    const Object<GSocket> socket(
        g_socket_new(G_SOCKET_FAMILY_IPV4, G_SOCKET_TYPE_DATAGRAM, G_SOCKET_PROTOCOL_UDP, nullptr));
    const Object<GSocketAddress> address(g_inet_socket_address_new_from_string("127.0.0.1", 3956));
    const bool bound = g_socket_bind(socket.get(), address.get(), FALSE, &error) != FALSE;
    g_clear_error(&error);
    return bound;
  }

  int width_ = 128;
  int height_ = 96;
  std::mutex mutex_;
  Exposure exposure_;
  test::CameraPortLock lock_;
};

TEST(Interleave, LeftIsTheLowByte) {
  const cv::Mat left(1, 2, CV_8UC1, cv::Scalar(0x12));
  const cv::Mat right(1, 2, CV_8UC1, cv::Scalar(0x34));
  const cv::Mat both = interleave(left, right);
  EXPECT_EQ(both.at<std::uint16_t>(0, 1), 0x3412);
  const auto [l, r] = deinterleave(both);
  EXPECT_TRUE(equal(l, left));
  EXPECT_TRUE(equal(r, right));
  EXPECT_THROW(interleave(left, cv::Mat(2, 2, CV_8UC1)), ConfigurationError);
  EXPECT_THROW(interleave(left, cv::Mat(1, 2, CV_8UC3)), ConfigurationError);
  EXPECT_THROW(deinterleave(left), ConfigurationError);
}

TEST_F(EmulatedBumblebeeTest, StreamsFullFramesOfBothEyes) {
  width_ = 1024;
  height_ = 768;
  EmulatedBumblebee camera(small(15.0), source());
  Client client;
  ASSERT_TRUE(client.connected());
  gint width = 0;
  gint height = 0;
  arv_camera_get_region(client.camera(), nullptr, nullptr, &width, &height, client.error());
  EXPECT_EQ(width, 1024);
  EXPECT_EQ(height, 768);
  EXPECT_EQ(arv_camera_get_pixel_format(client.camera(), client.error()), ARV_PIXEL_FORMAT_MONO_16);
  EXPECT_STREQ(arv_camera_get_model_name(client.camera(), client.error()), "Bumblebee2");
  EXPECT_STREQ(arv_camera_get_device_serial_number(client.camera(), client.error()), "SIM0001");
  client.expectNoError();
  client.stream();
  guint64 last_id = 0;
  for (int i = 0; i < 3; ++i) {
    Object<ArvBuffer> buffer = client.nextWhole();
    ASSERT_NE(buffer, nullptr);
    EXPECT_EQ(arv_buffer_get_image_pixel_format(buffer.get()), ARV_PIXEL_FORMAT_MONO_16);
    const guint64 id = arv_buffer_get_frame_id(buffer.get());
    const std::uint64_t number = id - 65401;  // the fake camera counts from there
    EXPECT_GT(id, last_id);
    last_id = id;
    const StereoFrame expected = frameOf({1024, 768}, number);
    const auto [left, right] = deinterleave(imageOf(buffer.get()));
    EXPECT_TRUE(equal(left, expected.left.data)) << "frame " << number;
    EXPECT_TRUE(equal(right, expected.right.data)) << "frame " << number;
    size_t size = 0;
    const auto* bytes = static_cast<const std::uint8_t*>(arv_buffer_get_data(buffer.get(), &size));
    EXPECT_EQ(bytes[2], expected.left.data.at<std::uint8_t>(0, 1)) << "left first on the wire";
    EXPECT_EQ(bytes[3], expected.right.data.at<std::uint8_t>(0, 1));
    client.giveBack(std::move(buffer));
  }
  client.stop();
  EXPECT_GE(camera.framesTaken(), 3U);
  EXPECT_EQ(camera.framesRefused(), 0U);
}

TEST_F(EmulatedBumblebeeTest, ExposureGainAndRateReachTheSource) {
  EmulatedBumblebee::Options options = small(5.0);
  options.exposure = {0.006, 2.0};
  EmulatedBumblebee camera(options, source());
  Client client;
  ASSERT_TRUE(client.connected());
  client.stream();
  ASSERT_NE(client.nextWhole(), nullptr);
  EXPECT_NEAR(exposure().exposure_s, 0.006, 1e-9);
  EXPECT_EQ(exposure().gain_db, 2.0);
  client.stop();
  arv_camera_set_exposure_time(client.camera(), 1234.0, client.error());
  arv_camera_set_gain(client.camera(), 7.0, client.error());
  arv_camera_set_frame_rate(client.camera(), 25.0, client.error());
  client.expectNoError();
  client.stream();
  guint64 last_ns = 0;
  double shortest_s = 1.0;
  for (int i = 0; i < 6; ++i) {
    Object<ArvBuffer> buffer = client.nextWhole();
    ASSERT_NE(buffer, nullptr);
    const guint64 stamp_ns = arv_buffer_get_timestamp(buffer.get());
    if (i > 0) shortest_s = std::min(shortest_s, 1e-9 * static_cast<double>(stamp_ns - last_ns));
    last_ns = stamp_ns;
    client.giveBack(std::move(buffer));
  }
  EXPECT_NEAR(exposure().exposure_s, 0.001234, 1e-9);
  EXPECT_EQ(exposure().gain_db, 7.0);
  EXPECT_LT(shortest_s, 0.1) << "it was 0.2 before";
  const double now_s = 1e-6 * static_cast<double>(g_get_real_time());
  EXPECT_NEAR(1e-9 * static_cast<double>(last_ns), now_s, 2.0) << "wall clock";
  client.stop();
}

TEST_F(EmulatedBumblebeeTest, TheThesisRateIsKept) {
  EmulatedBumblebee camera(small(15.0), source());
  Client client;
  ASSERT_TRUE(client.connected());
  arv_camera_set_frame_rate(client.camera(), 1.82, client.error());
  client.expectNoError();
  EXPECT_NEAR(arv_camera_get_frame_rate(client.camera(), client.error()), 1.82, 1e-4);
  client.stream();
  Object<ArvBuffer> first = client.nextWhole();  // the first comes at once, the others in step
  Object<ArvBuffer> a = client.nextWhole();
  Object<ArvBuffer> b = client.nextWhole();
  ASSERT_TRUE(first && a && b);
  const auto seconds = [](const Object<ArvBuffer>& buffer) {
    return 1e-9 * static_cast<double>(arv_buffer_get_timestamp(buffer.get()));
  };
  EXPECT_NEAR(seconds(b) - seconds(a), 1.0 / 1.82, 0.15);
  client.stop();
}

TEST_F(EmulatedBumblebeeTest, LostPacketsLeaveIncompleteFrames) {
  width_ = 512;
  height_ = 384;
  EmulatedBumblebee camera(small(30.0), source());
  EXPECT_THROW(camera.setLostPackets(1.5), ConfigurationError);
  Client client;
  ASSERT_TRUE(client.connected());
  client.stream();
  ASSERT_NE(client.nextWhole(), nullptr);
  camera.setLostPackets(0.05);  // of 50 packets a frame
  int incomplete = 0;
  for (int i = 0; i < 20; ++i) {
    Object<ArvBuffer> buffer = client.next();
    ASSERT_NE(buffer, nullptr);
    if (arv_buffer_get_status(buffer.get()) != ARV_BUFFER_STATUS_SUCCESS) ++incomplete;
    client.giveBack(std::move(buffer));
  }
  EXPECT_GT(incomplete, 5) << "92 % of the frames lose at least one packet";
  camera.setLostPackets(0.0);
  EXPECT_NE(client.nextWhole(), nullptr);
  client.stop();
}

TEST_F(EmulatedBumblebeeTest, CutsOutARegionAndRefusesOtherFormats) {
  EmulatedBumblebee camera(small(30.0), source());
  Client client;
  ASSERT_TRUE(client.connected());
  arv_camera_set_region(client.camera(), 16, 8, 64, 48, client.error());
  client.expectNoError();
  client.stream();
  Object<ArvBuffer> buffer = client.nextWhole();
  ASSERT_NE(buffer, nullptr);
  const StereoFrame expected =
      frameOf({width_, height_}, arv_buffer_get_frame_id(buffer.get()) - 65401);
  const auto [left, right] = deinterleave(imageOf(buffer.get()));
  EXPECT_TRUE(equal(left, expected.left.data(cv::Rect(16, 8, 64, 48))));
  EXPECT_TRUE(equal(right, expected.right.data(cv::Rect(16, 8, 64, 48))));
  client.stop();
  arv_camera_set_pixel_format(client.camera(), ARV_PIXEL_FORMAT_MONO_8, client.error());
  client.expectNoError();
  client.stream();
  EXPECT_EQ(client.next(500000), nullptr) << "Mono8 is not what this camera has";
  EXPECT_GT(camera.framesRefused(), 0U);
  client.stop();
}

TEST_F(EmulatedBumblebeeTest, AFailingSourceSendsNothing) {
  EmulatedBumblebee camera(small(30.0), [](std::uint64_t, const Exposure&) -> StereoFrame {
    throw std::runtime_error("no picture");
  });
  Client client;
  ASSERT_TRUE(client.connected());
  client.stream();
  EXPECT_EQ(client.next(300000), nullptr);
  EXPECT_GT(camera.framesRefused(), 0U);
  EXPECT_EQ(camera.framesTaken(), 0U);
  client.stop();
}

TEST_F(EmulatedBumblebeeTest, CanBeUnpluggedAndPluggedInAgain) {
  EmulatedBumblebee camera(small(30.0), source());
  {
    Client client;
    ASSERT_TRUE(client.connected());
    client.stream();
    ASSERT_NE(client.nextWhole(), nullptr);
    camera.unplug();
    EXPECT_TRUE(portIsFree());
    Object<ArvBuffer> buffer;
    while ((buffer = client.next(300000))) client.giveBack(std::move(buffer));  // comes to an end
    camera.unplug();  // again: nothing happens
    camera.plug();
    camera.plug();
    EXPECT_FALSE(portIsFree());
  }
  Client client;
  ASSERT_TRUE(client.connected());
  client.stream();
  Object<ArvBuffer> buffer = client.nextWhole();
  ASSERT_NE(buffer, nullptr);
  const std::uint64_t number = arv_buffer_get_frame_id(buffer.get()) - 65401;
  EXPECT_LT(number, 10U) << "powered on anew";
  const auto [left, right] = deinterleave(imageOf(buffer.get()));
  EXPECT_TRUE(equal(left, pattern({width_, height_}, 0, number)));
  client.stop();
}

TEST_F(EmulatedBumblebeeTest, SaysWhenItCannotServe) {
  EmulatedBumblebee camera(small(30.0), source());
  EXPECT_THROW(EmulatedBumblebee(small(30.0), source()), ConfigurationError) << "port in use";
  EmulatedBumblebee::Options options = small(30.0);
  options.interface = "127.4.5.6";
  EXPECT_THROW(EmulatedBumblebee(options, source()), ConfigurationError);
  options.interface = "nowhere0";
  EXPECT_THROW(EmulatedBumblebee(options, source()), ConfigurationError);
  camera.unplug();
  options.interface = "lo";
  EXPECT_NO_THROW(EmulatedBumblebee(options, source()));
  options.serial = "a serial number that is too long";
  EXPECT_THROW(EmulatedBumblebee(options, source()), ConfigurationError);
  options = small(30.0);
  options.width_px = 4096;
  EXPECT_THROW(EmulatedBumblebee(options, source()), ConfigurationError);
  EXPECT_THROW(EmulatedBumblebee(small(30.0), nullptr), ConfigurationError);
}

}  // namespace
}  // namespace scanner::simulation
