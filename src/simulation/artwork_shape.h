#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>

namespace scanner::simulation {

/// Which kind of surface a place of the statue has (thesis 5.1).
enum class ArtworkKind { kPlinth, kBumpy, kTiled, kImpressed, kCarpentry };

/// Place on the tiled torso.
struct TilePlace {
  float across_m = 0.0F;    ///< from the middle of the tile, along its course
  float up_m = 0.0F;        ///< likewise, upwards
  float joint_m = 0.0F;     ///< to the middle of the nearest joint
  std::int32_t column = 0;  ///< identity of the tile
  std::int32_t row = 0;
};

/// The statue of the scene `artwork` as an implicit solid (map frame, metres): a rough plinth, a
/// bumpy egg, a leaning torso clad with tiles, a slab with deep impressions at its side, and a
/// crown cut and pierced by other solids. The seed changes the roughness, the bumps and, slightly,
/// how the pieces stand. Immutable, thread-safe.
class ArtworkShape {
 public:
  explicit ArtworkShape(std::uint32_t seed);

  float distance(const Eigen::Vector3f& p) const;
  /// The piece that the surface at `p` belongs to.
  ArtworkKind kindAt(const Eigen::Vector3f& p) const;
  TilePlace tileAt(const Eigen::Vector3f& p) const;
  /// How deep below the face of the slab, 0 on the face, 1 at the bottom of the deepest impression.
  float impressionDepth(const Eigen::Vector3f& p) const;
  Eigen::AlignedBox3f bounds() const;

 private:
  float plinth(const Eigen::Vector3f& p) const;
  float egg(const Eigen::Vector3f& p) const;
  float torso(const Eigen::Vector3f& p) const;
  float slab(const Eigen::Vector3f& p) const;
  float crown(const Eigen::Vector3f& p) const;
  float impressions(const Eigen::Vector3f& local) const;

  std::uint32_t seed_;
  Eigen::Isometry3f T_plinth_map_;
  Eigen::Isometry3f T_slab_map_;
  Eigen::Isometry3f T_crown_map_;
};

}  // namespace scanner::simulation
