#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>
#include <optional>
#include <set>

#include "scanner/calibration/calibration_files.h"

namespace scanner::calibration {
namespace {

namespace fs = std::filesystem;

constexpr int kDeepest = 3;

char lower(char c) { return static_cast<char>(std::tolower(static_cast<unsigned char>(c))); }
bool isSmall(char c) { return std::islower(static_cast<unsigned char>(c)) != 0; }
bool isLetter(char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; }
bool isDigit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

bool isPicture(const fs::path& path) {
  static const std::set<std::string> kKnown = {".jpg", ".jpeg", ".png",  ".bmp",
                                               ".pgm", ".ppm",  ".tiff", ".tif"};
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), lower);
  return kKnown.count(extension) != 0;
}

/// A word stands alone when no letter touches it, but for the humps of camelCase.
bool standsAlone(const std::string& text, std::size_t begin, std::size_t length) {
  const std::size_t end = begin + length;
  if (isDigit(text[end - 1]) && end < text.size() && isDigit(text[end])) return false;  // cam01
  const bool hump = length > 1 && !isSmall(text[begin]) && isSmall(text[begin + 1]);
  const bool open = begin == 0 || !isLetter(text[begin - 1]) || (hump && isSmall(text[begin - 1]));
  const bool closed = end == text.size() || !isLetter(text[end]) ||
                      (length > 1 && isSmall(text[end - 1]) && !isSmall(text[end]));
  return open && closed;
}

struct Sided {
  int side;         ///< 0 left, 1 right
  std::string key;  ///< the path without its side
};

/// Nothing for a name of no side or of both.
std::optional<Sided> sideOf(const std::string& text) {
  static const std::pair<const char*, int> kWords[] = {{"left", 0}, {"right", 1}, {"cam0", 0},
                                                       {"cam1", 1}, {"l", 0},     {"r", 1}};
  std::string small = text;
  std::transform(small.begin(), small.end(), small.begin(), lower);
  std::optional<Sided> found;
  std::string key;
  for (std::size_t i = 0; i < text.size();) {
    std::size_t length = 0;
    for (const auto& [word, side] : kWords) {
      const std::size_t n = std::string(word).size();
      if (small.compare(i, n, word) != 0 || !standsAlone(text, i, n)) continue;
      if (found && found->side != side) return std::nullopt;
      found = Sided{side, ""};
      length = n;
      break;
    }
    key += length > 0 ? '*' : text[i];
    i += std::max<std::size_t>(1, length);
  }
  if (found) found->key = key;
  return found;
}

/// "9" before "10".
bool inOrder(const std::string& a, const std::string& b) {
  std::size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (isDigit(a[i]) && isDigit(b[j])) {
      const auto numberAt = [](const std::string& text, std::size_t& at) {
        std::string digits;
        while (at < text.size() && isDigit(text[at])) digits += text[at++];
        return digits.erase(0, std::min(digits.find_first_not_of('0'), digits.size() - 1));
      };
      const std::string x = numberAt(a, i), y = numberAt(b, j);
      if (x.size() != y.size()) return x.size() < y.size();
      if (x != y) return x < y;
    } else {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i;
      ++j;
    }
  }
  const std::size_t rest_a = a.size() - i, rest_b = b.size() - j;
  return rest_a != rest_b ? rest_a < rest_b : a < b;
}

}  // namespace

PictureFolder findPicturePairs(const std::string& folder) {
  std::error_code error;
  fs::recursive_directory_iterator it(folder, error);
  if (error) throw ConfigurationError("cannot read folder " + folder + ": " + error.message());
  std::map<std::string, PicturePair> by_key;
  PictureFolder result;
  for (; it != fs::recursive_directory_iterator(); it.increment(error)) {
    if (error) throw ConfigurationError("cannot read folder " + folder + ": " + error.message());
    if (it->is_directory() && it.depth() >= kDeepest) it.disable_recursion_pending();
    if (!it->is_regular_file() || !isPicture(it->path())) continue;
    const std::string path = it->path().string();
    const std::string inside = it->path().lexically_relative(folder).generic_string();
    // The extension has no side: ".r" would be none of a picture.
    const std::string extension = it->path().extension().string();
    const auto sided = sideOf(inside.substr(0, inside.size() - extension.size()));
    if (!sided) {
      result.unpaired.push_back(inside);
      continue;
    }
    PicturePair& pair = by_key[sided->key + extension];
    pair.name = sided->key + extension;
    std::string& place = sided->side == 0 ? pair.left : pair.right;
    if (!place.empty()) {
      std::string message = folder;
      message.append(": ").append(place).append(" and ").append(path);
      throw ConfigurationError(message.append(" are both the picture of one side and moment"));
    }
    place = path;
  }
  for (const auto& [key, pair] : by_key) {
    if (pair.left.empty() || pair.right.empty()) {
      const std::string& alone = pair.left.empty() ? pair.right : pair.left;
      result.unpaired.push_back(fs::path(alone).lexically_relative(folder).generic_string());
    } else {
      result.pairs.push_back(pair);
    }
  }
  std::sort(result.pairs.begin(), result.pairs.end(),
            [](const auto& a, const auto& b) { return inOrder(a.name, b.name); });
  std::sort(result.unpaired.begin(), result.unpaired.end(), inOrder);
  return result;
}

}  // namespace scanner::calibration
