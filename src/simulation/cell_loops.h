#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <utility>

/// How a surface passes through one cube of a grid: the sheets ("loops" of crossed edges) that the
/// signs of its corners imply.
///
/// Corner i is at (i & 1, i >> 1 & 1, i >> 2). Edge 4 * axis + b + 2 * c runs along `axis`, at b on
/// the next axis and c on the one after. Face 2 * axis + side.
namespace scanner::simulation {

constexpr int kCellEdges = 12;

struct CellLoops {
  static constexpr std::uint8_t kNoLoop = 255;
  std::array<std::uint8_t, kCellEdges> of_edge{};  ///< number of the loop, kNoLoop: not crossed
  std::uint8_t count = 0;
  unsigned flipped_faces = 0;  ///< bit per face
};

inline Eigen::Vector3i cornerOffset(int i) { return {i & 1, (i >> 1) & 1, i >> 2}; }
std::pair<int, int> edgeCorners(int edge);

/// `inside`: bit per corner. On a face whose corners alternate, the inside corners are cut off
/// singly; on a flipped one they are joined.
CellLoops findLoops(std::uint8_t inside, unsigned flipped_faces);
/// The four corners of the face alternate.
bool isAmbiguous(std::uint8_t inside, int face);
/// All crossed edges of the face are in the same loop.
bool isOneLoop(const CellLoops& loops, int face);

}  // namespace scanner::simulation
