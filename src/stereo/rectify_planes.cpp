#include "stereo/rectify_planes.h"

#include <algorithm>
#include <cstring>

#include "scanner/core/parallel.h"
#include "stereo/rectify_simd.h"

namespace scanner::stereo {
namespace {

constexpr std::size_t kRowsPerChunk = 32;
constexpr int kBorder = 3;      ///< rows that demosaicing reads above and below
constexpr int kRowMargin = 16;  ///< elements before a row of the scratch; at least 4 are read

/// Reflection about the edge pixel, which keeps the colour pattern going.
int reflected(int i, int size) {
  if (size == 1) return 0;
  while (i < 0 || i >= size) i = i < 0 ? -i : 2 * (size - 1) - i;
  return i;
}

bool redInFirstRow(PixelFormat f) {
  return f == PixelFormat::kBayerRggb8 || f == PixelFormat::kBayerGrbg8;
}
bool greenFirst(PixelFormat f) {
  return f == PixelFormat::kBayerGrbg8 || f == PixelFormat::kBayerGbrg8;
}

/// Rows of a chunk with a margin on either side.
template <typename T>
class Rows {
 public:
  Rows(int first, int last, int width)
      : first_(first),
        stride_(static_cast<std::size_t>(width + 2 * kRowMargin) + simd::kRectifyOverrun),
        data_(static_cast<std::size_t>(last - first) * stride_) {}
  T* at(int v) {
    return data_.data() + static_cast<std::size_t>(v - first_) * stride_ + kRowMargin;
  }

 private:
  int first_;
  std::size_t stride_;
  std::vector<T> data_;
};

/// Rows [begin, end) of a mosaic.
void demosaic(const Image& image, int begin, int end, bool color, RawPlanes& planes) {
  const int width = image.data.cols, height = image.data.rows;
  const auto count = static_cast<std::size_t>(width);
  Rows<std::uint8_t> raw(begin - kBorder, end + kBorder, width);
  for (int v = begin - kBorder; v < end + kBorder; ++v) {
    const std::uint8_t* from = image.data.ptr<std::uint8_t>(reflected(v, height));
    std::uint8_t* to = raw.at(v);
    std::memcpy(to, from, count);
    for (int i = 1; i <= RawPlanes::kPadding; ++i) {
      to[-i] = from[reflected(-i, width)];
      to[width - 1 + i] = from[reflected(width - 1 + i, width)];
    }
  }
  for (int v = begin; v < end; ++v) {
    simd::binomialRow(raw.at(v - 1), raw.at(v), raw.at(v + 1), count,
                      &planes.gray[planes.index(0, v)]);
  }
  if (!color) return;
  Rows<std::int16_t> green(begin - 1, end + 1, width), chroma(begin - 1, end + 1, width);
  for (int v = begin - 1; v < end + 1; ++v) {
    const std::uint8_t* rows[5];
    for (int j = 0; j < 5; ++j) rows[j] = raw.at(v - 2 + j) - 1;
    const bool row_starts_green = greenFirst(image.format) == (v % 2 == 0);
    // From the column before the first one, whose colour is the other.
    simd::greenRow(rows, count + 2, !row_starts_green, green.at(v) - 1);
    simd::chromaRow(raw.at(v), green.at(v), count, chroma.at(v));
  }
  for (int v = begin; v < end; ++v) {
    const bool red_row = redInFirstRow(image.format) == (v % 2 == 0);
    simd::mixRow(green.at(v), chroma.at(v - 1), chroma.at(v), chroma.at(v + 1), count, red_row,
                 &planes.bgrx[4 * planes.index(0, v)]);
  }
}

/// Repeats the first and last `kPadding` elements of row v of a plane of `kBytes` each, and the row
/// itself above the first and below the last one.
template <int kBytes, typename T>
void repeatEdges(std::vector<T>& plane, const RawPlanes& planes, int width, int height, int v) {
  constexpr std::size_t kBytesPerPixel = kBytes;
  auto* bytes = reinterpret_cast<std::uint8_t*>(plane.data());
  const auto pixel = [&](int u, int row) { return bytes + kBytesPerPixel * planes.index(u, row); };
  for (int i = 1; i <= RawPlanes::kPadding; ++i) {
    std::memcpy(pixel(-i, v), pixel(0, v), kBytesPerPixel);
    std::memcpy(pixel(width - 1 + i, v), pixel(width - 1, v), kBytesPerPixel);
  }
  const auto copy_to = [&](int row) {
    std::memcpy(pixel(-RawPlanes::kPadding, row), pixel(-RawPlanes::kPadding, v),
                kBytesPerPixel * static_cast<std::size_t>(width + 2 * RawPlanes::kPadding));
  };
  for (int i = 1; i <= RawPlanes::kPadding; ++i) {
    if (v == 0) copy_to(-i);
    if (v == height - 1) copy_to(height - 1 + i);
  }
}

}  // namespace

std::size_t RawPlanes::strideFor(int width) {
  // The overrun of a row's kernel stays in its row: rows are written by several threads.
  return static_cast<std::size_t>(width + 2 * kPadding) + simd::kRectifyOverrun;
}

RawPlanes makePlanes(const Image& image, bool color, int threads) {
  const int width = image.data.cols, height = image.data.rows;
  const auto count = static_cast<std::size_t>(width);
  color = color && image.format != PixelFormat::kMono8;
  RawPlanes planes;
  planes.stride = RawPlanes::strideFor(width);
  const std::size_t pixels =
      static_cast<std::size_t>(height + 2 * RawPlanes::kPadding) * planes.stride;
  planes.gray.resize(pixels);
  if (color) planes.bgrx.resize(4 * pixels);
  parallelFor(static_cast<std::size_t>(height), kRowsPerChunk, threads,
              [&](std::size_t chunk_begin, std::size_t chunk_end) {
                const int begin = static_cast<int>(chunk_begin), end = static_cast<int>(chunk_end);
                if (isBayer(image.format)) demosaic(image, begin, end, color, planes);
                for (int v = begin; v < end; ++v) {
                  const std::uint8_t* raw = image.data.ptr<std::uint8_t>(v);
                  std::uint16_t* gray = &planes.gray[planes.index(0, v)];
                  std::uint8_t* bgrx = color ? &planes.bgrx[4 * planes.index(0, v)] : nullptr;
                  if (image.format == PixelFormat::kMono8) simd::scaleMonoRow(raw, count, gray);
                  if (image.format == PixelFormat::kBgr8) simd::splitBgrRow(raw, count, gray, bgrx);
                  repeatEdges<2>(planes.gray, planes, width, height, v);
                  if (color) repeatEdges<4>(planes.bgrx, planes, width, height, v);
                }
              });
  return planes;
}

}  // namespace scanner::stereo
