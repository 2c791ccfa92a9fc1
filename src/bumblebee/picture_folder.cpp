#include <algorithm>
#include <cctype>
#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "bumblebee/file_transport.h"

namespace scanner::bumblebee {
namespace {

namespace fs = std::filesystem;

bool isDigit(char c) { return c >= '0' && c <= '9'; }

std::string lowerCase(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

bool isPicture(const fs::path& path) {
  static constexpr std::string_view kExtensions[] = {".png", ".jpg", ".jpeg", ".bmp",
                                                     ".pgm", ".tif", ".tiff"};
  const std::string extension = lowerCase(path.extension().string());
  return std::find(std::begin(kExtensions), std::end(kExtensions), extension) !=
         std::end(kExtensions);
}

/// Order of names in which runs of digits count by their value.
struct NaturalLess {
  bool operator()(const std::string& a, const std::string& b) const {
    std::size_t i = 0;
    std::size_t j = 0;
    while (i < a.size() && j < b.size()) {
      if (!isDigit(a[i]) || !isDigit(b[j])) {
        if (a[i] != b[j]) return a[i] < b[j];
        ++i;
        ++j;
        continue;
      }
      const std::string_view x = digits(a, i);
      const std::string_view y = digits(b, j);
      if (x.size() != y.size()) return x.size() < y.size();
      if (x != y) return x < y;
    }
    const bool a_ended = i == a.size();
    const bool b_ended = j == b.size();
    if (a_ended != b_ended) return a_ended;
    return a < b;  // differ in leading zeros only
  }

 private:
  /// The run of digits at `i` without leading zeros; moves `i` behind it.
  static std::string_view digits(const std::string& text, std::size_t& i) {
    while (i < text.size() && text[i] == '0') ++i;
    const std::size_t begin = i;
    while (i < text.size() && isDigit(text[i])) ++i;
    return std::string_view(text).substr(begin, i - begin);
  }
};

std::vector<fs::path> pictures(const fs::path& folder) {
  std::vector<fs::path> result;
  std::error_code error;
  fs::directory_iterator entry(folder, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    std::error_code ignored;
    if (entry->is_regular_file(ignored) && isPicture(entry->path())) {
      result.push_back(entry->path());
    }
  }
  return result;
}

using Frames = std::map<std::string, FramePaths, NaturalLess>;

std::vector<FramePaths> inOrder(const Frames& frames) {
  std::vector<FramePaths> result;
  for (const auto& [name, paths] : frames) result.push_back(paths);
  return result;
}

}  // namespace

std::vector<FramePaths> findFrames(const fs::path& folder) {
  Frames frames;
  // Names of a pair may differ in their extension.
  for (const fs::path& path : pictures(folder / "left")) frames[path.stem().string()].left = path;
  for (const fs::path& path : pictures(folder / "right")) frames[path.stem().string()].right = path;
  if (!frames.empty()) return inOrder(frames);

  const std::vector<fs::path> all = pictures(folder);
  for (const fs::path& path : all) {
    std::string name = lowerCase(path.stem().string());
    for (const bool is_left : {true, false}) {
      const std::string side = is_left ? "left" : "right";
      const std::size_t at = name.rfind(side);
      if (at == std::string::npos) continue;
      FramePaths& frame = frames[name.replace(at, side.size(), "*")];
      (is_left ? frame.left : frame.right) = path;
      break;
    }
  }
  if (!frames.empty()) return inOrder(frames);
  for (const fs::path& path : all) frames[path.filename().string()].interleaved = path;
  return inOrder(frames);
}

}  // namespace scanner::bumblebee
