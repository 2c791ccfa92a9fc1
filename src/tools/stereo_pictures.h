#pragma once

#include <filesystem>
#include <vector>

#include "tools/stereo_methods.h"

namespace scanner::tools {

/// Writes what there is to look at of one scene into `folder` (made where absent), as PNG:
/// truth.png, METHOD_disparity.png, METHOD_filled.png (colours over the range of the scene, black
/// where there is none), METHOD_error.png (0 px black over blue to yellow at 4 px and more; white:
/// no disparity; grey: not known), and sheet.png with all of them. Throws std::runtime_error naming
/// the file that cannot be written.
void writeStereoPictures(const std::filesystem::path& folder, const evaluation::StereoScene& scene,
                         const std::vector<StereoMethod>& methods,
                         const std::vector<StereoRun>& runs);

}  // namespace scanner::tools
