#include <algorithm>
#include <thread>

#include "scanner/ros/bag_inspection.h"
#include "tools/run.h"

int main(int argc, char** argv) {
  std::string bag, config = "field";
  int threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  bool json = false;
  CLI::App app("Says whether a recording (rosbag) can be scanned: 0 yes, 1 no.", "inspect_bag");
  app.add_option("BAG", bag, "recording (rosbag)")->required();
  app.add_option("--config", config, "field, thesis, room or a YAML file")->capture_default_str();
  app.add_option("--threads", threads, "threads to use")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  app.add_flag("--json", json, "machine-readable output");
  return scanner::tools::run(app, argc, argv, [&] {
    const auto inspection = scanner::bridge::inspectBag(bag, config, threads);
    std::fputs((json ? toJson(inspection) : toText(inspection)).c_str(), stdout);
    if (inspection.scannable()) return scanner::tools::kOk;
    std::fprintf(stderr, "inspect_bag: %s\n", inspection.problems.front().c_str());
    return scanner::tools::kFailed;
  });
}
