#include "evaluation/pfm.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <vector>

namespace scanner::evaluation {
namespace {

constexpr int kMaxSide = 1 << 15;

float decode(const unsigned char* bytes, bool little_endian) {
  std::uint32_t bits = 0;
  for (int i = 0; i < 4; ++i) {
    bits = (bits << 8) | bytes[little_endian ? 3 - i : i];
  }
  float value = 0.0F;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

}  // namespace

Result<cv::Mat> readPfm(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return Status(StatusCode::kIoError, path + ": cannot be read");
  std::string magic;
  int width = 0, height = 0;
  double scale = 0.0;
  file >> magic >> width >> height >> scale;
  if (!file || magic != "Pf" || scale == 0.0 || width < 1 || height < 1 || width > kMaxSide ||
      height > kMaxSide) {
    return Status(StatusCode::kInvalidInput, path + ": not a float map of one channel");
  }
  file.get();  // exactly one white space ends the header
  cv::Mat map(height, width, CV_32FC1);
  std::vector<unsigned char> row(static_cast<std::size_t>(width) * 4);
  for (int y = height - 1; y >= 0; --y) {
    file.read(reinterpret_cast<char*>(row.data()), static_cast<std::streamsize>(row.size()));
    if (!file) return Status(StatusCode::kInvalidInput, path + ": cut short");
    float* to = map.ptr<float>(y);
    for (int x = 0; x < width; ++x)
      to[x] = decode(&row[static_cast<std::size_t>(x) * 4], scale < 0);
  }
  return map;
}

}  // namespace scanner::evaluation
