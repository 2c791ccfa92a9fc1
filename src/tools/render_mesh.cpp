#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <opencv2/imgcodecs.hpp>

#include "scanner/core/ply.h"
#include "scanner/surface/render.h"

int main(int argc, char** argv) {
  CLI::App app{"Pictures a PLY model (z up) without a display."};
  std::string model, out, size = "800x800";
  double azimuth_deg = 0.0, elevation_deg = 15.0;
  app.add_option("MODEL", model, "PLY file")->required();
  app.add_option("--out", out, "picture to write (.png, .jpg)")->required();
  app.add_option("--azimuth-deg", azimuth_deg, "camera about z, from x to y")
      ->capture_default_str();
  app.add_option("--elevation-deg", elevation_deg, "camera above horizon")->capture_default_str();
  app.add_option("--size", size, "WIDTHxHEIGHT in pixels")->capture_default_str();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  }
  try {
    int w = 0, h = 0;
    if (std::sscanf(size.c_str(), "%dx%d", &w, &h) != 2) throw std::runtime_error("--size " + size);
    const scanner::Result<scanner::Mesh> mesh = scanner::readPly(model);
    if (!mesh) throw std::runtime_error(mesh.status().message());
    const double a = azimuth_deg * CV_PI / 180.0, e = elevation_deg * CV_PI / 180.0;
    const Eigen::Vector3d stand(std::cos(e) * std::cos(a), std::cos(e) * std::sin(a), std::sin(e));
    const auto view = scanner::surface::autoView(*mesh, -stand, w, h);
    const cv::Mat image = scanner::surface::renderMesh(*mesh, view.T_map_camera, view.K, w, h);
    if (!cv::imwrite(out, image)) throw std::runtime_error("cannot write " + out);
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "render_mesh: " << error.what() << '\n';
    return 1;
  }
}
