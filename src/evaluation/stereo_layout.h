#pragma once

#include <filesystem>
#include <string>

#include "scanner/core/status.h"

namespace scanner::evaluation {

/// Which files make up a scene, and how to read them. Empty names: the scene has no such file.
struct StereoLayout {
  std::string left, right, truth, truth_right;
  std::string nonocc, all, disc;
  double scale = 0.0;      ///< grey levels per pixel of disparity; 0: by the rule of `kind`
  int min_disparity = -1;  ///< below 0: by rule
  int max_disparity = -1;
  int border = 0;
  enum class Kind {
    kFloat,    ///< a float map, pixels
    k2005,     ///< 1110 rows at scale 1
    k2003,     ///< 1500 rows at scale 1
    kScale8,   ///< 2001
    kScale16,  ///< Tsukuba
    kGiven,    ///< scene.txt says it
  } kind = Kind::kGiven;
};

/// Is there a scene in this folder, complete or not?
bool looksLikeScene(const std::filesystem::path& folder);

/// Finds the files of a scene by their names and by scene.txt. Fails where nothing is recognised,
/// or for a line of scene.txt that is not understood.
Result<StereoLayout> findLayout(const std::filesystem::path& folder);

/// Value of `key` in a text of `key = value` lines such as calib.txt; fallback without such a line.
int readCount(const std::filesystem::path& file, const std::string& key, int fallback);

}  // namespace scanner::evaluation
