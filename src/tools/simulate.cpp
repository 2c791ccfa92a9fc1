#include <atomic>
#include <csignal>
#include <thread>

#include "scanner/core/ply.h"
#include "scanner/core/trajectory_io.h"
#include "scanner/ros/simulation_bag.h"
#include "scanner/simulation/motion_statistics.h"
#include "tools/progress_bar.h"
#include "tools/run.h"

namespace {

using scanner::simulation::Simulation;
using scanner::simulation::SimulationOptions;

std::atomic<bool> interrupted{false};

struct Request {
  std::string scene, out, config, noise = "mti";
  int views = 0, seed = 1;
  double rate_hz = 0.0, start_s = 1731500000.0;
  int threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  scanner::bridge::SimulationBagOptions bag;
};

void addOptions(CLI::App& app, Request& r) {
  app.add_option("--scene", r.scene, "artwork, totem, target, or the path of a textured mesh")
      ->required();
  app.add_option("--out", r.out,
                 "recording to write; OUT.reference.ply and OUT.truth.tum beside it")
      ->required();
  app.add_option("--frames", r.views, "views of the whole motion (default: the configuration's)")
      ->check(CLI::PositiveNumber);
  app.add_option("--first", r.bag.first_view, "first view to write")->check(CLI::NonNegativeNumber);
  app.add_option("--last", r.bag.last_view, "last view to write (default: the last one)");
  app.add_option("--rate", r.rate_hz, "views per second")->check(CLI::PositiveNumber);
  app.add_option("--seed", r.seed, "of scene, motion and noise")->capture_default_str();
  app.add_option("--noise", r.noise, "none: both sensors are perfect")
      ->check(CLI::IsMember({"none", "mti"}))
      ->capture_default_str();
  app.add_option("--config", r.config, "YAML file with a block `simulation`");
  app.add_option("--start", r.start_s, "time stamp of the beginning, s")->capture_default_str();
  app.add_flag("--compressed", r.bag.compressed, "compress the recording (bz2)");
  app.add_option("--threads", r.threads, "the result does not depend on it")
      ->check(CLI::PositiveNumber);
}

SimulationOptions optionsOf(const Request& request) {
  SimulationOptions options;
  if (!request.config.empty()) options = scanner::simulation::loadSimulation(request.config);
  if (request.views > 0) options.motion.views = request.views;
  if (request.rate_hz > 0.0) options.motion.view_rate_hz = request.rate_hz;
  return request.noise == "none" ? scanner::simulation::noiseFree(options) : options;
}

void require(const scanner::Status& status) {
  if (!status) throw scanner::ConfigurationError(status.message());
}

int simulate(const Request& request) {
  const Simulation simulation(request.scene, optionsOf(request), request.seed,
                              scanner::Time(scanner::fromSeconds(request.start_s)),
                              request.threads);
  scanner::tools::ProgressBar bar("rendering");
  require(scanner::bridge::writeSimulation(simulation, request.out, request.bag,
                                           [&](std::size_t done, std::size_t total) {
                                             bar.show(done, total, "");
                                             return !interrupted;
                                           }));
  require(scanner::writeTum(request.out + ".truth.tum", simulation.truth()));
  require(scanner::writePly(request.out + ".reference.ply", referenceMesh(simulation.scene())));
  std::printf(
      "%s: %d views at %g Hz\n%s", request.out.c_str(), simulation.views(),
      simulation.options().motion.view_rate_hz,
      motionTable(request.scene, motionStatistics(simulation.motion(), simulation.options().motion))
          .c_str());
  return scanner::tools::kOk;
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CLI::App app("Simulates a scan: a recording (rosbag) of raw sensor topics with the truth.",
               "simulate");
  addOptions(app, request);
  return scanner::tools::run(app, argc, argv, [&] {
    std::signal(SIGINT, [](int) { interrupted = true; });
    return simulate(request);
  });
}
