#include "scanner/simulation/scene.h"

namespace scanner::simulation {

void describe(OptionVisitor& v, SceneOptions& o) {
  v.option("detail_m", o.detail_m, {0.0005, 0.02}, "m",
           "edge length of the triangles of procedural objects");
  v.option("mesh_height_m", o.mesh_height_m, {0.0, 100.0}, "m",
           "height a mesh file is scaled to; 0: as it is, in metres");
  v.option("mesh_up", o.mesh_up,
           "the file's axis that points up: x, y, z or auto (y for glTF, else z)");
  v.option(
      "mesh_weathered", o.mesh_weathered,
      "a mesh without picture or vertex colours looks like old stone of its colour; else plain, "
      "and then there is nothing for stereo to match");
  v.option("background", o.background, "trees, walls and lawn; else only ground and sky");
}

}  // namespace scanner::simulation
