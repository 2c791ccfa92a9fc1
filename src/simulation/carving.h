#pragma once

#include <cstdint>

/// The carved pattern of the totem as functions of the unrolled trunk: what its relief and its
/// paint have in common, so that colours end where the carver's lines are.
namespace scanner::simulation {

constexpr float kTrunkRadius = 0.27F;  ///< of the uncarved trunk, m
constexpr int kSectors = 3;            ///< equal figures around the trunk, the first one towards -y
constexpr int kTiers = 6;              ///< equal figures one above the other
constexpr float kTierHeight = 0.30F;
constexpr float kFootHeight = 0.06F;  ///< plain, below the lowest tier
constexpr float kPoleHeight = 1.90F;  ///< above the ground
constexpr float kFaceHeight = 0.23F;  ///< of a tier; a plain band is above it

/// A place on the unrolled trunk relative to its figure.
struct TilePoint {
  int tier = 0;           ///< 0 .. kTiers - 1; the foot and the top belong to the nearest
  int sector = 0;         ///< 0 .. kSectors - 1
  float u = 0.0F;         ///< around, m, from the middle of the face: -0.283 .. 0.283
  float v = 0.0F;         ///< up, m, from the chin; outside 0 .. kTierHeight on foot and top
  bool mirrored = false;  ///< u was negative
};
TilePoint locateTile(float x, float y, float z);

/// Signed distances (m, about; negative inside) to the lines of the carving.
struct FaceLines {
  float brow, socket, eye, pupil, nose, nostril, lips, mouth, tooth, cheek;
};
FaceLines faceLines(float u, float v);

/// The wing between two faces: two rows of overlapping feathers.
struct FeatherLines {
  float outline;  ///< of the feather on top here
  float quill;    ///< distance to its middle line
  float along;    ///< from its tip, m
  float across;   ///< from its middle line, m
  int row, column;
};
FeatherLines featherLines(float u, float v);

/// Distance to the plain band, and to the rib between face and wing; negative inside.
float bandLine(float v);
float ribLine(float u);
/// True on the wing's side of the rib.
bool onWing(float u);

/// Height of the carving over the trunk, m: 0 .. 0.025. Repeats exactly in tier and sector.
float carvedHeight(const TilePoint& tile);

}  // namespace scanner::simulation
