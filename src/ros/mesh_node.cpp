#include "scanner/ros/mesh_node.h"

#include <nav_msgs/Path.h>
#include <ros/console.h>
#include <visualization_msgs/Marker.h>

#include <chrono>
#include <condition_variable>
#include <map>
#include <mutex>
#include <optional>
#include <thread>

#include "ros/diagnostics.h"
#include "ros/mesh_preview.h"
#include "scanner/MeshStatus.h"
#include "scanner/RegisteredView.h"
#include "scanner/pipeline/config.h"
#include "scanner/pipeline/report_builder.h"
#include "scanner/pipeline/scan_folder.h"
#include "scanner/ros/conversions.h"
#include "scanner/ros/parameters.h"
#include "scanner/ros/service_thread.h"
#include "scanner/surface/surface.h"

namespace scanner::bridge {
namespace {

struct MeshNodeOptions {
  int threads = 0;
  int preview_faces = 200000;
  double wait_s = 5.0;
};

void describe(OptionVisitor& v, MeshNodeOptions& o) {
  v.option("threads", o.threads, {0, 256}, "", "threads to use; 0: all processors");
  v.option("preview_faces", o.preview_faces, {100, 1e8}, "", "triangles of the preview, about");
  v.option("wait_s", o.wait_s, {0.0, 600.0}, "s", "for views that are still on the way");
}

using Outcome = std::pair<bool, std::string>;

}  // namespace

class MeshNode::Impl {
 public:
  Impl(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);
  ~Impl();

 private:
  void onView(const RegisteredViewConstPtr& message);
  void onPath(const nav_msgs::PathConstPtr& message);
  bool complete() const;
  void waitForViews();
  Outcome build();
  Outcome save(const std::string& folder);
  Outcome done(std::uint8_t state, const std::string& message);
  void report(DiagnosticStatus& status);

  ros::NodeHandle nh_;
  MeshNodeOptions options_;
  surface::SurfaceOptions surface_options_;
  pipeline::ScanOptions scan_options_;
  int threads_ = 1;

  mutable std::mutex mutex_;
  std::condition_variable news_;
  std::map<Time, std::shared_ptr<const PointCloud>> clouds_;
  Trajectory path_;
  std::size_t received_ = 0;
  std::string trouble_;

  // Of the service thread only.
  std::optional<Mesh> mesh_;
  PointCloud fused_;
  surface::SurfaceStatistics statistics_;

  MeshStatus status_;
  ros::Publisher preview_, status_publisher_;
  ros::Subscriber views_sub_, path_sub_;
  std::unique_ptr<ServiceThread> services_;
  std::unique_ptr<Diagnostics> diagnostics_;
};

MeshNode::Impl::Impl(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh) : nh_(nh) {
  loadPrivate(private_nh, {"surface", "scan"}, options_);
  loadBlock(nh_, private_nh, "surface", surface_options_);
  loadBlock(nh_, private_nh, "scan", scan_options_);
  threads_ = options_.threads > 0
                 ? options_.threads
                 : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  preview_ = nh_.advertise<visualization_msgs::Marker>("mesh/preview", 1, true);
  status_publisher_ = nh_.advertise<MeshStatus>("mesh/status", 10, true);
  services_ = std::make_unique<ServiceThread>(private_nh);
  services_->add("build", [this] { return build(); });
  services_->addSave("save", [this](const std::string& folder) { return save(folder); });
  diagnostics_ = std::make_unique<Diagnostics>(
      nh_, private_nh, "mesh", [this](DiagnosticStatus& status) { report(status); });
  views_sub_ = nh_.subscribe("registration/views", 0, &Impl::onView, this);
  path_sub_ = nh_.subscribe("registration/path", 0, &Impl::onPath, this);
  services_->start();
  done(MeshStatus::IDLE, "collecting views");
}

MeshNode::Impl::~Impl() {
  views_sub_.shutdown();
  path_sub_.shutdown();
  diagnostics_.reset();
  services_->stop();
}

void MeshNode::Impl::onView(const RegisteredViewConstPtr& message) {
  Result<PointCloud> cloud = pointsFromRos(message->cloud);
  const std::lock_guard<std::mutex> lock(mutex_);
  ++received_;
  if (!cloud) {
    trouble_ = cloud.status().message();
    return;
  }
  // Discarded ones too: the global stage may still place them.
  if (cloud->empty()) return;
  clouds_[fromRos(message->header.stamp)] =
      std::make_shared<const PointCloud>(decimated(*cloud, scan_options_.model_factor));
  news_.notify_all();
}

void MeshNode::Impl::onPath(const nav_msgs::PathConstPtr& message) {
  Result<Trajectory> path = fromRos(*message);
  const std::lock_guard<std::mutex> lock(mutex_);
  if (path) {
    path_ = std::move(*path);
  } else {
    trouble_ = path.status().message();
  }
  news_.notify_all();
}

bool MeshNode::Impl::complete() const {
  for (const StampedPose& pose : path_) {
    if (clouds_.count(pose.stamp) == 0) return false;
  }
  return !path_.empty();
}

void MeshNode::Impl::waitForViews() {
  // Topics and services come by different ways: what was published before ~build was called may
  // still be on its way. Wait until nothing new has come for a moment and every pose has a view.
  constexpr auto kQuiet = std::chrono::milliseconds(300);
  std::unique_lock<std::mutex> lock(mutex_);
  const auto start = std::chrono::steady_clock::now();
  while (true) {
    const bool news = news_.wait_for(lock, kQuiet) == std::cv_status::no_timeout;
    const std::chrono::duration<double> waited = std::chrono::steady_clock::now() - start;
    if ((!news && complete()) || waited.count() > options_.wait_s) return;
  }
}

Outcome MeshNode::Impl::build() {
  waitForViews();
  std::vector<std::shared_ptr<const PointCloud>> clouds;
  std::vector<surface::PosedCloud> posed;
  std::size_t missing = 0;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const StampedPose& pose : path_) {
      const auto cloud = clouds_.find(pose.stamp);
      if (cloud == clouds_.end()) {
        ++missing;
        continue;
      }
      clouds.push_back(cloud->second);
      posed.push_back({cloud->second.get(), pose.T_map_base});
    }
    status_.views = static_cast<std::uint32_t>(posed.size());
  }
  if (posed.empty()) return done(MeshStatus::FAILED, "there are no registered views");
  done(MeshStatus::BUILDING, "making the surface of " + std::to_string(posed.size()) + " views");
  Result<Mesh> mesh = Status(StatusCode::kNotEnoughData, "");
  try {
    mesh = surface::buildSurface(posed, surface_options_, threads_, &statistics_, &fused_);
  } catch (const std::exception& e) {
    return done(MeshStatus::FAILED, e.what());
  }
  if (!mesh) return done(MeshStatus::FAILED, mesh.status().message());
  mesh_ = std::move(*mesh);
  status_.vertices = static_cast<std::uint32_t>(mesh_->vertices.size());
  status_.faces = static_cast<std::uint32_t>(mesh_->faces.size());
  preview_.publish(toRos(previewMesh(*mesh_, static_cast<std::size_t>(options_.preview_faces)),
                         makeHeader(Time(), "map"), "mesh", 0));
  std::string message =
      std::to_string(status_.faces) + " faces from " + std::to_string(posed.size()) + " views";
  if (missing > 0) message += "; " + std::to_string(missing) + " views never came";
  return done(MeshStatus::DONE, message);
}

Outcome MeshNode::Impl::save(const std::string& path) {
  pipeline::ScanFolder folder(path);
  if (!mesh_) {
    const Outcome built = build();
    if (!built.first) return built;
  }
  Status status = folder.writeModel(*mesh_);
  if (status) status = folder.writeCloud(fused_);
  if (status) status = pipeline::addModelToReport(folder, statistics_.model, statistics_.total_s);
  if (!status) return {false, status.message()};
  return {true, "model.ply and cloud.ply written to " + path};
}

Outcome MeshNode::Impl::done(std::uint8_t state, const std::string& message) {
  status_.header.frame_id = "map";
  status_.state = state;
  status_.message = message;
  status_publisher_.publish(status_);
  if (state == MeshStatus::FAILED) ROS_ERROR_STREAM("mesh: " << message);
  return {state == MeshStatus::DONE, message};
}

void MeshNode::Impl::report(DiagnosticStatus& status) {
  const std::lock_guard<std::mutex> lock(mutex_);
  status.summary(kDiagnosticOk, "working");
  if (!trouble_.empty()) status.summary(kDiagnosticError, trouble_);
  if (received_ == 0) status.summary(kDiagnosticWarn, "no views on " + views_sub_.getTopic());
  status.add("views received", received_);
  status.add("views kept", clouds_.size());
  status.add("views registered", path_.size());
}

MeshNode::MeshNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : impl_(std::make_unique<Impl>(nh, private_nh)) {}
MeshNode::~MeshNode() = default;

}  // namespace scanner::bridge
