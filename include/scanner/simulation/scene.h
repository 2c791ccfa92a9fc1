#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "scanner/core/mesh.h"
#include "scanner/core/options.h"

/// What can be pictured by the simulated camera. Everything is in the map frame: metres, z up, the
/// ground at z = 0, the object over the origin. Colours are linear RGB (no gamma).
namespace scanner::simulation {

/// Where a ray met a part.
struct SurfacePoint {
  Eigen::Vector3f position;  ///< map, m
  Eigen::Vector3f normal;    ///< interpolated, unit, outwards
  Eigen::Vector2f uv;        ///< interpolated texture coordinates; zero when the part has none
  float footprint_m = 0.0F;  ///< diameter of the pixel on the surface; finer detail must be faded
  /// Interpolated vertex colour, linear RGB; white when the part has none.
  Eigen::Vector3f color = Eigen::Vector3f::Ones();
};

/// What the surface looks like there.
struct Appearance {
  Eigen::Vector3f albedo = Eigen::Vector3f::Constant(0.5F);  ///< diffuse reflectance, 0..1
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();         ///< unit, for the shading only
  float specular = 0.0F;                                     ///< reflectance at normal incidence
  float roughness = 0.6F;                                    ///< 0 mirror .. 1 dull
};

/// Pure and thread-safe; band-limited to the footprint.
using Shader = std::function<Appearance(const SurfacePoint&)>;

/// One closed or open triangle surface with one shader. Faces are counter-clockwise from outside.
struct Part {
  std::string name;
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Eigen::Vector3f> normals;  ///< per vertex, unit
  std::vector<Eigen::Vector2f> uvs;      ///< per vertex, or empty
  std::vector<Eigen::Vector3f> colors;   ///< per vertex, linear RGB, or empty
  std::vector<std::array<std::uint32_t, 3>> faces;
  Shader shader;
};

/// Sun and clear sky.
struct Daylight {
  Eigen::Vector3f to_sun = Eigen::Vector3f(0.45F, -0.5F, 0.74F).normalized();
  Eigen::Vector3f sun = Eigen::Vector3f(1.0F, 0.94F, 0.85F) * 2.0F;  ///< irradiance, normal to it
  Eigen::Vector3f sky = Eigen::Vector3f(0.75F, 0.88F, 1.0F) * 1.2F;  ///< irradiance from all of it
  Eigen::Vector3f zenith = Eigen::Vector3f(0.22F, 0.40F, 0.72F);     ///< radiance seen upwards
  Eigen::Vector3f horizon = Eigen::Vector3f(0.75F, 0.80F, 0.85F);    ///< radiance seen level
};

struct Scene {
  std::string name;
  /// What is scanned. The parts of a procedural object together are watertight: where two meet,
  /// both have the same vertices.
  std::vector<Part> object;
  std::vector<Part> surroundings;  ///< ground and background
  Daylight light;
  Eigen::AlignedBox3f bounds;  ///< of the object
};

/// Block `simulation.scene`.
struct SceneOptions {
  double detail_m = 0.002;      ///< edge length of the triangles of procedural objects
  double mesh_height_m = 0.75;  ///< height a mesh file is scaled to; 0: as it is, in metres
  std::string mesh_up =
      "auto";  ///< x, y, z: the file's axis that points up; auto: y for glTF, else z
  bool mesh_weathered = true;  ///< a mesh without picture or vertex colours looks like old stone
  bool background = true;      ///< trees, walls ... around; else only ground and sky
};
void describe(OptionVisitor& v, SceneOptions& o);

/// A statue of 0.5-0.9 m with the four surface kinds of thesis 5.1: bumpy convex, smooth tiled,
/// flat with deep impressions, complex solid geometry; on concrete.
Scene makeArtwork(const SceneOptions& options, int seed);
/// The lower half of a carved pole (thesis 5.4, 5.5): smooth, shallow relief, features that repeat
/// vertically.
Scene makeTotem(const SceneOptions& options, int seed);
/// The calibration object of appendix B, covered with random symbols, standing on its base.
Scene makeTarget(const SceneOptions& options, int seed);
/// A textured mesh (GLB, OBJ with MTL, PLY, STL) on concrete. Throws ConfigurationError naming the
/// file and what is wrong with it.
Scene loadMeshScene(const std::string& path, const SceneOptions& options, int seed);
/// By name (artwork, totem, target), else as the path of a mesh.
Scene makeScene(const std::string& name_or_path, const SceneOptions& options, int seed);

/// The object alone as one mesh with normals and sRGB vertex colours: the truth to compare with.
Mesh referenceMesh(const Scene& scene);

}  // namespace scanner::simulation
