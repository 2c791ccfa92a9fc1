#include "scanner/bumblebee/factory_calibration.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>
#include <utility>
#include <vector>

namespace scanner::bumblebee {
namespace {

constexpr std::size_t kLongestSerial = 32;
constexpr int kLargestSide = 65536;

bool isLetter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }
bool isDigit(char c) { return c >= '0' && c <= '9'; }

/// Text in any 8-bit encoding: no control characters but white space.
bool isTextByte(char c) {
  const auto value = static_cast<unsigned char>(c);
  return value >= 0x20 ? value != 0x7F : (c == '\t' || c == '\n' || c == '\r' || c == '\f');
}

/// A line as its key, lower case and letters only ("Focal Length" and "focal_length" are one), and
/// the words behind it.
struct Line {
  std::string key;
  std::vector<std::string_view> values;
};

/// Words are runs of what numbers and names are made of.
std::vector<std::string_view> words(std::string_view line) {
  const auto isWord = [](char c) {
    return isLetter(c) || isDigit(c) || c == '.' || c == '-' || c == '+' || c == '_';
  };
  std::vector<std::string_view> result;
  for (std::size_t begin = 0; begin < line.size();) {
    if (!isWord(line[begin])) {
      ++begin;
      continue;
    }
    std::size_t end = begin;
    while (end < line.size() && isWord(line[end])) ++end;
    result.push_back(line.substr(begin, end - begin));
    begin = end;
  }
  return result;
}

/// Words that begin with a letter make up the key, until the first number.
Line parseLine(std::string_view text) {
  Line line;
  for (const std::string_view word : words(text)) {
    if (line.values.empty() && isLetter(word.front())) {
      for (const char c : word) {
        if (isLetter(c)) line.key += static_cast<char>(c | 0x20);
      }
    } else {
      line.values.push_back(word);
    }
  }
  return line;
}

template <typename T>
std::optional<T> number(std::string_view word) {
  T value{};
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size()) return std::nullopt;
  return value;
}

std::optional<double> positive(std::string_view word) {
  const std::optional<double> value = number<double>(word);
  return value && std::isfinite(*value) && *value > 0.0 && *value < 1e6 ? value : std::nullopt;
}

std::optional<int> side(std::string_view word) {
  const std::optional<int> value = number<int>(word);
  return value && *value > 0 && *value <= kLargestSide ? value : std::nullopt;
}

bool endsWith(const std::string& text, std::string_view end) {
  return text.size() >= end.size() &&
         std::string_view(text).substr(text.size() - end.size()) == end;
}

/// "640x480" and "640 480".
void takeResolution(const Line& line, FactoryCalibration& out) {
  std::optional<int> w;
  std::optional<int> h;
  const std::size_t cross = line.values[0].find('x');
  if (cross != std::string_view::npos) {
    w = side(line.values[0].substr(0, cross));
    h = side(line.values[0].substr(cross + 1));
  } else if (line.values.size() >= 2) {
    w = side(line.values[0]);
    h = side(line.values[1]);
  }
  if (!w || !h || out.width_px || out.height_px) return;
  out.width_px = w;
  out.height_px = h;
}

void take(const Line& line, FactoryCalibration& out) {
  if (line.values.empty()) return;
  const std::string_view value = line.values[0];
  if (endsWith(line.key, "serialnumber") || endsWith(line.key, "serial")) {
    const bool digits = std::all_of(value.begin(), value.end(), isDigit);
    if (!out.serial && digits && value.size() <= kLongestSerial) out.serial = std::string(value);
  } else if (endsWith(line.key, "resolution") || endsWith(line.key, "imagesize")) {
    takeResolution(line, out);
  } else if (endsWith(line.key, "focallength")) {
    if (!out.focal_length) out.focal_length = positive(value);
  } else if (endsWith(line.key, "baseline")) {
    if (!out.baseline) out.baseline = positive(value);
  }
}

}  // namespace

FactoryCalibration parseFactoryCalibration(std::string text) {
  FactoryCalibration result;
  result.text = std::move(text);
  const std::string_view all = result.text;
  for (std::size_t begin = 0; begin < all.size();) {
    const std::size_t end = std::min(all.find_first_of("\r\n", begin), all.size());
    take(parseLine(all.substr(begin, end - begin)), result);
    begin = end + 1;
  }
  return result;
}

Result<FactoryCalibration> readFactoryCalibration(const RegisterReader& read) {
  const Result<std::uint32_t> length = read(kCalibrationLengthRegister);
  if (!length) return length.status();
  if (*length == 0 || *length == 0xFFFFFFFFU) {
    return Status(StatusCode::kNotEnoughData, "the camera keeps no factory calibration");
  }
  if (*length > kLargestCalibration_bytes) {
    return Status(StatusCode::kInvalidInput, "factory calibration of " + std::to_string(*length) +
                                                 " bytes: more than " +
                                                 std::to_string(kLargestCalibration_bytes));
  }
  std::string text;
  for (std::uint32_t offset = 0; offset < *length; offset += 4) {
    const Result<std::uint32_t> quadlet = read(kCalibrationDataRegister + offset);
    if (!quadlet) return quadlet.status();
    for (unsigned shift = 32; shift > 0; shift -= 8) {
      text += static_cast<char>((*quadlet >> (shift - 8)) & 0xFFU);
    }
  }
  text.resize(*length);
  while (!text.empty() && (text.back() == '\0' || text.back() == '\xFF')) text.pop_back();
  if (text.empty() || !std::all_of(text.begin(), text.end(), isTextByte)) {
    return Status(StatusCode::kInvalidInput, "the camera's factory calibration is no text");
  }
  return parseFactoryCalibration(std::move(text));
}

}  // namespace scanner::bumblebee
