#include <atomic>
#include <csignal>
#include <thread>

#include "scanner/evaluation/summary.h"
#include "scanner/ros/offline_scan.h"
#include "tools/progress_bar.h"
#include "tools/run.h"

namespace {
std::atomic<bool> interrupted{false};
}

int main(int argc, char** argv) {
  scanner::bridge::OfflineScanRequest request;
  request.threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  CLI::App app("From a recording to a coloured mesh: fills a scan folder.", "scan_bag");
  app.add_option("BAG", request.bag, "recording (rosbag)")->required();
  app.add_option("--config", request.config, "field, thesis, room or a YAML file")
      ->capture_default_str();
  app.add_option("--rig", request.rig, "calibration of the rig; default: the bag's /tf_static");
  app.add_option("--out", request.out, "scan folder to fill")->required();
  app.add_option("--threads", request.threads, "threads to use; the result is the same")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  return scanner::tools::run(app, argc, argv, [&] {
    std::signal(SIGINT, [](int) { interrupted = true; });  // finish with what has been read
    scanner::tools::ProgressBar bar("scan_bag");
    const auto report = scanner::bridge::scanBag(
        request,
        [&](std::size_t done, std::size_t total, std::size_t registered) {
          bar.show(done, total, std::to_string(registered) + " registered");
        },
        interrupted);
    std::fputs(scanner::evaluation::summary(report).c_str(), stdout);
    return scanner::evaluation::registeredViews(report) > 0 ? scanner::tools::kOk
                                                            : scanner::tools::kFailed;
  });
}
