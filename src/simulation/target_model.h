#pragma once

#include <Eigen/Core>
#include <vector>

namespace scanner::simulation {

/// The calibration object of the thesis, appendix B, in its own frame (fig. 3.7): metres, origin at
/// the middle of the base, y up. A base plate, an upright board across it, both without thickness,
/// and a faceted solid that the board cuts in two: a truncated pyramid on a diamond with a pyramid
/// on top. config/target/appendix_b.obj holds the same numbers.
struct TargetModel {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<std::vector<int>> faces;  ///< planar polygons, indices from 0, counter-clockwise from
                                        ///< outside; the plate faces up, the board +z and -z
};
const TargetModel& targetModel();
constexpr int kTargetPlate = 0;  ///< the face that is the base plate
constexpr int kTargetBoard = 1;  ///< the one that has a back as well

}  // namespace scanner::simulation
