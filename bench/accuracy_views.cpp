#include "accuracy_views.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "scanner/core/ply.h"
#include "scanner/core/trajectory_io.h"
#include "scanner/ros/bag_reader.h"
#include "scanner/simulation/renderer.h"
#include "scanner/simulation/simulation.h"

namespace scanner::bench {
namespace {

/// A true step of this many pixels between neighbours is a depth edge; its surroundings are judged
/// on their own.
constexpr double kStepPx = 3.0;
constexpr int kNearStepPx = 10;
constexpr double kMaxPoseGap_s = 0.1;

template <typename T>
T need(Result<T> result) {
  if (!result) throw std::runtime_error(result.status().message());
  return *std::move(result);
}

AccuracyView makeView(const StereoFrame& frame, const StereoCalibration& cameras,
                      const simulation::Renderer& renderer, const Eigen::Isometry3d& T_map_camera,
                      int threads) {
  AccuracyView view;
  view.pair = need(stereo::Rectifier(cameras).rectify(frame, threads));
  const double fb = cameras.focalLength() * cameras.baseline();
  const double offset = cameras.disparityOffset();
  view.truth = fb / renderer.rectifiedDepth(cameras.left, T_map_camera, true) + offset;
  cv::Mat all = fb / renderer.rectifiedDepth(cameras.left, T_map_camera, false) + offset;
  all.setTo(0.0f, ~(all == all));
  cv::Mat high, low;
  cv::dilate(all, high, cv::Mat());
  cv::erode(all, low, cv::Mat());
  const int side = 2 * kNearStepPx + 1;
  cv::dilate((high - low) > kStepPx, view.near_step, cv::Mat::ones(side, side, CV_8UC1));
  return view;
}

simulation::Scene sceneOf(const Mesh& mesh) {
  simulation::Part part;
  part.name = "reference";
  part.vertices = mesh.vertices.points;
  part.normals = mesh.vertices.normals;
  if (part.normals.size() != part.vertices.size()) {
    part.normals.assign(part.vertices.size(), Eigen::Vector3f::UnitZ());  // only depth is asked for
  }
  part.faces = mesh.faces;
  part.shader = [](const simulation::SurfacePoint&) { return simulation::Appearance(); };
  simulation::Scene scene;
  for (const Eigen::Vector3f& p : part.vertices) scene.bounds.extend(p);
  scene.object.push_back(std::move(part));
  return scene;
}

}  // namespace

std::vector<AccuracyView> simulatedViews(const std::string& scene, Sensor sensor,
                                         const std::vector<int>& views, int threads) {
  simulation::SimulationOptions options;
  if (sensor != Sensor::kReal) {
    options = simulation::noiseFree(options);
    options.render.samples = 16;  // few samples are noise too
    if (sensor == Sensor::kIdeal) options.sensor.format = PixelFormat::kMono8;
  }
  const simulation::Simulation simulation(scene, options, 1, Time(), threads);
  simulation::RenderOptions unlit;
  unlit.sky_occlusion = false;
  const simulation::Renderer renderer(simulation.scene(), unlit, threads);
  std::vector<AccuracyView> out;
  for (const int view : views) {
    const Eigen::Isometry3d T_map_camera =
        simulation.motion().at(simulation.viewTime(view)).T_map_base *
        simulation.rig().T_base_camera;
    out.push_back(makeView(simulation.frame(view), simulation.rig().calibration, renderer,
                           T_map_camera, threads));
  }
  return out;
}

std::vector<AccuracyView> recordedViews(const Recording& recording, const std::vector<int>& views,
                                        int threads) {
  bridge::BagReader bag = need(bridge::BagReader::open(recording.bag));
  const StereoCalibration cameras = need(bag.calibration());
  const Rig rig = need(bag.rig());
  const Trajectory truth = need(readTum(recording.truth));
  simulation::RenderOptions unlit;
  unlit.sky_occlusion = false;
  const simulation::Renderer renderer(sceneOf(need(readPly(recording.reference))), unlit, threads);
  std::vector<AccuracyView> out;
  int number = 0;
  bridge::BagHandlers handlers;
  handlers.frame = [&](const StereoFrame& frame) {
    if (std::find(views.begin(), views.end(), number++) == views.end()) return true;
    const Eigen::Isometry3d T_map_base =
        need(poseAt(truth, frame.stamp, fromSeconds(kMaxPoseGap_s)));
    out.push_back(makeView(frame, cameras, renderer, T_map_base * rig.T_base_camera, threads));
    return true;
  };
  bag.play(handlers);
  if (out.empty()) throw std::runtime_error(recording.bag + " has none of the views asked for");
  return out;
}

}  // namespace scanner::bench
