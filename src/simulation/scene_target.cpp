#include <cmath>
#include <utility>

#include "scanner/simulation/random.h"
#include "scanner/simulation/scene.h"
#include "simulation/materials.h"
#include "simulation/surroundings.h"
#include "simulation/symbols.h"
#include "simulation/target_model.h"

namespace scanner::simulation {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kTableHeight = 0.40;
constexpr double kCardThickness = 0.005;  ///< of the foam card under the base plate
/// The board's two sides are this far from its plane, so that each has its own normals and symbols:
/// enough for single precision, and nothing to a measurement.
constexpr double kSheet = 2e-5;

/// Appendix B as printed, but for vertices 11 to 14: with the printed 0.0988 and 0.0875 the four
/// sides of the truncated pyramid miss being planar by 0.1 mm. They are planar when its top is the
/// diamond of the base times one number; 0.6594 is the one nearest to the print (0.11 and 0.13 mm
/// off).
constexpr double kShrink = 0.6594;
constexpr double kTopX = 0.15 * kShrink;
constexpr double kTopZ = 0.1325 * kShrink;

/// From the frame of the model (y up) to the map (z up), on the table.
Vector3d toMap(const Vector3d& p) { return {p.x(), -p.z(), p.y() + kTableHeight + kCardThickness}; }

/// Adds a planar convex polygon with vertices of its own. Its uv are metres in its plane, moved by
/// `sheet` so that no two faces show the same symbols.
void addPolygon(Part* part, const std::vector<Vector3d>& corners, const Vector2f& sheet) {
  const Vector3d along = (corners[1] - corners[0]).normalized();
  const Vector3d normal = along.cross(corners[2] - corners[0]).normalized();
  const Vector3d across = normal.cross(along);
  const auto first = static_cast<std::uint32_t>(part->vertices.size());
  for (const Vector3d& corner : corners) {
    const Vector3d from_first = corner - corners[0];
    part->vertices.push_back(corner.cast<float>());
    part->normals.push_back(normal.cast<float>());
    part->uvs.emplace_back(sheet + Vector2f(static_cast<float>(along.dot(from_first)),
                                            static_cast<float>(across.dot(from_first))));
  }
  for (std::uint32_t k = 2; k < corners.size(); ++k) {
    part->faces.push_back({first, first + k - 1, first + k});
  }
}

void addBox(Part* part, const Vector3d& low, const Vector3d& high) {
  for (int axis = 0; axis < 3; ++axis) {
    const int b = (axis + 1) % 3, c = (axis + 2) % 3;
    for (const bool far : {false, true}) {
      std::vector<Vector3d> corners(4, far ? high : low);
      // Around the face, counter-clockwise seen against the axis for the far one.
      corners[0][b] = corners[3][b] = far ? low[b] : high[b];
      corners[1][b] = corners[2][b] = far ? high[b] : low[b];
      corners[0][c] = corners[1][c] = low[c];
      corners[2][c] = corners[3][c] = high[c];
      addPolygon(part, corners, Vector2f::Zero());
    }
  }
}

/// Sheet coordinates of the n-th face: far from those of the others, within what single precision
/// resolves to some micrometres.
Vector2f sheetOf(int n) {
  const int column = n % 4, row = n / 4;
  return {0.7F * static_cast<float>(column), 0.7F * static_cast<float>(row)};
}

Part makeFaces() {
  Part part;
  part.name = "target";
  const TargetModel& model = targetModel();
  int sheets = 0;
  for (std::size_t f = 0; f < model.faces.size(); ++f) {
    std::vector<Vector3d> corners;
    for (const int i : model.faces[f]) {
      corners.push_back(toMap(model.vertices[static_cast<std::size_t>(i)]));
    }
    if (f != kTargetBoard) {
      addPolygon(&part, corners, sheetOf(sheets++));
      continue;
    }
    const Vector3d out(0.0, -kSheet, 0.0);  // the model's +z
    std::vector<Vector3d> back(corners.rbegin(), corners.rend());
    for (Vector3d& corner : corners) corner += out;
    for (Vector3d& corner : back) corner -= out;
    addPolygon(&part, corners, sheetOf(sheets++));
    addPolygon(&part, back, sheetOf(sheets++));
  }
  return part;
}

/// What the target stands on: a pedestal and the card below the printed base.
std::vector<Part> makeStand(std::uint32_t seed) {
  Part pedestal;
  pedestal.name = "pedestal";
  addBox(&pedestal, {-0.24, -0.22, 0.0}, {0.24, 0.22, kTableHeight});
  pedestal.shader = concrete(false, seed);
  Part card;
  card.name = "card";
  // A hair below the printed plane, which stays the only surface there.
  addBox(&card, {-0.15, -0.1325, kTableHeight},
         {0.15, 0.1325, kTableHeight + kCardThickness - 2e-4});
  card.shader = [](const SurfacePoint& s) {
    Appearance look;
    look.albedo = Vector3f(0.62F, 0.60F, 0.55F);
    look.normal = s.normal;
    return look;
  };
  return {std::move(pedestal), std::move(card)};
}

}  // namespace

const TargetModel& targetModel() {
  static const TargetModel model{{{-0.15, 0.0, 0.1325},
                                  {0.15, 0.0, 0.1325},
                                  {0.15, 0.0, -0.1325},
                                  {-0.15, 0.0, -0.1325},
                                  {-0.15, 0.0, 0.0},
                                  {0.15, 0.0, 0.0},
                                  {0.15, 0.265, 0.0},
                                  {-0.15, 0.265, 0.0},
                                  {0.0, 0.0, 0.1325},
                                  {0.0, 0.0, -0.1325},
                                  {0.0, 0.1447, kTopZ},
                                  {-kTopX, 0.1447, 0.0},
                                  {0.0, 0.1447, -kTopZ},
                                  {kTopX, 0.1447, 0.0},
                                  {0.0, 0.265, 0.0}},
                                 {{0, 1, 2, 3},
                                  {5, 6, 7, 4},
                                  {4, 8, 10, 11},
                                  {4, 11, 12, 9},
                                  {9, 12, 13, 5},
                                  {5, 13, 10, 8},
                                  {10, 13, 14},
                                  {12, 14, 13},
                                  {11, 14, 12},
                                  {11, 10, 14}}};
  return model;
}

Scene makeTarget(const SceneOptions& options, int seed) {
  const std::uint64_t mixed = mixSeed(static_cast<std::uint64_t>(seed), 0x746172676574ULL);
  Scene scene;
  scene.name = "target";
  Part faces = makeFaces();
  faces.shader = printedSymbols(static_cast<std::uint32_t>(mixed));
  for (const Vector3f& v : faces.vertices) scene.bounds.extend(v);
  scene.object.push_back(std::move(faces));
  scene.surroundings = makeSurroundings(scene.bounds, options.background, seed);
  for (Part& part : makeStand(static_cast<std::uint32_t>(mixed >> 32U))) {
    scene.surroundings.push_back(std::move(part));
  }
  return scene;
}

}  // namespace scanner::simulation
