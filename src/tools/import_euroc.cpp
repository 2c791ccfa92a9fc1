#include <atomic>
#include <csignal>

#include "scanner/ros/euroc_import.h"
#include "tools/run.h"

namespace {
std::atomic<bool> interrupted{false};
}

int main(int argc, char** argv) {
  std::string directory, bag;
  scanner::bridge::EurocOptions options;
  bool whole = false;
  CLI::App app("Writes an ASL/EuRoC folder (mav0) as a recording (rosbag).", "import_euroc");
  app.add_option("DIR", directory, "mav0, or the folder that holds it")->required();
  app.add_option("--out", bag, "recording to write")->required();
  app.add_option("--margin", options.margin_s,
                 "seconds of samples and truth kept beyond the images")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_flag("--whole", whole, "keep all samples and all truth");
  return scanner::tools::run(app, argc, argv, [&] {
    std::signal(SIGINT, [](int) { interrupted = true; });
    options.limit_to_images = !whole;
    const auto summary = scanner::bridge::importEuroc(
        directory, bag, options, [](std::size_t, std::size_t) { return !interrupted; });
    if (!summary) throw scanner::ConfigurationError(summary.status().message());
    std::printf("%s: %zu pairs (%zu images unpaired), %zu inertial samples, %zu true poses\n",
                bag.c_str(), summary->pairs, summary->unpaired, summary->imu_samples,
                summary->truth_poses);
    std::printf("rectified: f %.2f px, baseline %.2f mm\n", summary->focal_length_px,
                summary->baseline_m * 1e3);
    return scanner::tools::kOk;
  });
}
