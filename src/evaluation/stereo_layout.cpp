#include "evaluation/stereo_layout.h"

#include <array>
#include <charconv>
#include <fstream>
#include <map>
#include <utility>
#include <vector>

namespace scanner::evaluation {
namespace fs = std::filesystem;
namespace {

constexpr const char* kDescription = "scene.txt";

struct Named {
  const char *left, *right, *truth, *truth_right;
  StereoLayout::Kind kind;
};

using Kind = StereoLayout::Kind;
/// By name of the truth, the first that exists; then the pictures that exist with it.
constexpr std::array<Named, 12> kNamed{{
    {"im0.png", "im1.png", "disp0GT.pfm", "disp1GT.pfm", Kind::kFloat},
    {"im0.png", "im1.png", "disp0.pfm", "disp1.pfm", Kind::kFloat},
    {"view1.png", "view5.png", "disp1.png", "disp5.png", Kind::k2005},
    {"imL.png", "imR.png", "truedisp.pgm", "", Kind::kScale16},
    {"scene1.row3.col3.ppm", "scene1.row3.col4.ppm", "truedisp.row3.col3.pgm", "", Kind::kScale16},
    {"imL.png", "imR.png", "disp2.png", "disp6.png", Kind::k2003},
    {"im2.png", "im6.png", "disp2.png", "disp6.png", Kind::k2003},
    {"im2.ppm", "im6.ppm", "disp2.png", "disp6.png", Kind::k2003},
    {"im2.ppm", "im6.ppm", "disp2.pgm", "disp6.pgm", Kind::kScale8},
    {"imL.png", "imR.png", "disp2.pgm", "disp6.pgm", Kind::kScale8},
    {"im2.png", "im6.png", "disp2.pgm", "disp6.pgm", Kind::kScale8},
    {"im0.png", "im1.png", "disp0.png", "disp1.png", Kind::kGiven},
}};

bool exists(const fs::path& folder, const std::string& name) {
  std::error_code ignored;
  return !name.empty() && fs::is_regular_file(folder / name, ignored);
}

std::string trimmed(const std::string& text) {
  const auto first = text.find_first_not_of(" \t\r\n");
  if (first == std::string::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r\n") - first + 1);
}

/// Lines `key = value`, `#` starts a comment. False at a line that is neither.
bool readPairs(const fs::path& file, std::vector<std::pair<std::string, std::string>>& pairs) {
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    line = trimmed(line.substr(0, line.find('#')));
    if (line.empty()) continue;
    const auto equals = line.find('=');
    if (equals == std::string::npos) return false;
    pairs.emplace_back(trimmed(line.substr(0, equals)), trimmed(line.substr(equals + 1)));
  }
  return true;
}

template <typename Number>
bool parse(const std::string& text, Number& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size();
}

/// One line of scene.txt. False when it makes no sense.
bool apply(const std::string& key, const std::string& value, StereoLayout& layout) {
  const std::map<std::string, std::string*> names{
      {"left", &layout.left},     {"right", &layout.right},
      {"truth", &layout.truth},   {"truth_right", &layout.truth_right},
      {"nonocc", &layout.nonocc}, {"all", &layout.all},
      {"disc", &layout.disc}};
  const std::map<std::string, int*> counts{{"min_disparity", &layout.min_disparity},
                                           {"max_disparity", &layout.max_disparity},
                                           {"border", &layout.border}};
  if (const auto name = names.find(key); name != names.end()) {
    *name->second = value;
    return true;
  }
  if (const auto count = counts.find(key); count != counts.end()) {
    return parse(value, *count->second) && *count->second >= 0;
  }
  return key == "scale" && parse(value, layout.scale) && layout.scale > 0.0;
}

int filesPresent(const fs::path& folder, const Named& named) {
  return (exists(folder, named.left) ? 1 : 0) + (exists(folder, named.right) ? 1 : 0);
}

/// The known layout that the folder fits best; null without the truth of any.
const Named* bestNamed(const fs::path& folder) {
  const Named* best = nullptr;
  for (const Named& named : kNamed) {
    if (!exists(folder, named.truth)) continue;
    if (best == nullptr || filesPresent(folder, named) > filesPresent(folder, *best)) best = &named;
  }
  return best;
}

void findMasks(const fs::path& folder, StereoLayout& layout) {
  for (const char* name : {"mask0nocc.png", "nonocc.png"}) {
    if (exists(folder, name)) layout.nonocc = name;
  }
  if (exists(folder, "all.png")) layout.all = "all.png";
  if (exists(folder, "disc.png")) layout.disc = "disc.png";
}

}  // namespace

bool looksLikeScene(const fs::path& folder) {
  return exists(folder, kDescription) || bestNamed(folder) != nullptr;
}

Result<StereoLayout> findLayout(const fs::path& folder) {
  StereoLayout layout;
  if (const Named* named = bestNamed(folder); named != nullptr) {
    layout.left = named->left;
    layout.right = named->right;
    layout.truth = named->truth;
    if (exists(folder, named->truth_right)) layout.truth_right = named->truth_right;
    layout.kind = named->kind;
  }
  findMasks(folder, layout);
  const fs::path description = folder / kDescription;
  std::vector<std::pair<std::string, std::string>> pairs;
  if (exists(folder, kDescription) && !readPairs(description, pairs)) {
    return Status(StatusCode::kInvalidInput, description.string() + ": not lines of key = value");
  }
  for (const auto& [key, value] : pairs) {
    if (apply(key, value, layout)) continue;
    std::string message = description.string() + ": \"";
    message.append(key).append(" = ").append(value).append("\" makes no sense");
    return Status(StatusCode::kInvalidInput, message);
  }
  if (layout.truth.empty() || layout.left.empty() || layout.right.empty()) {
    return Status(StatusCode::kIoError,
                  folder.string() +
                      ": no stereo scene (no ground truth of a known name, and no "
                      "scene.txt that gives left, right and truth)");
  }
  return layout;
}

int readCount(const fs::path& file, const std::string& key, int fallback) {
  std::vector<std::pair<std::string, std::string>> pairs;
  readPairs(file, pairs);
  int value = fallback;
  for (const auto& [name, text] : pairs) {
    if (name == key && !parse(text, value)) return fallback;
  }
  return value;
}

}  // namespace scanner::evaluation
