#include "scanner/ros/offline_scan.h"

#include "scanner/pipeline/scan_folder.h"
#include "scanner/pipeline/scanner.h"
#include "scanner/ros/bag_reader.h"
#include "scanner/ros/package_files.h"

namespace scanner::bridge {
namespace {

[[noreturn]] void fail(const Status& status) { throw ConfigurationError(status.message()); }

Rig chooseRig(const OfflineScanRequest& request, const BagReader& bag) {
  if (!request.rig.empty()) return loadRig(request.rig);
  if (!bag.rig()) {
    throw ConfigurationError(bag.rig().status().message() +
                             " (give the calibration of the rig with --rig)");
  }
  return *bag.rig();
}

}  // namespace

evaluation::ScanReport scanBag(const OfflineScanRequest& request,
                               const OfflineScanProgress& progress, const std::atomic<bool>& stop) {
  const pipeline::ScannerConfig config = pipeline::loadConfig(configPath(request.config));
  Result<BagReader> bag = BagReader::open(request.bag);
  if (!bag) fail(bag.status());
  if (const Status scannable = bag->checkScannable(); !scannable) fail(scannable);
  const Rig rig = chooseRig(request, *bag);
  // A rig file that carries the cameras overrides what the recording says about them.
  const StereoCalibration calibration = rig.cameras ? *rig.cameras : *bag->calibration();

  pipeline::ScanFolder folder(request.out);
  pipeline::Scanner scanner(config, rig, calibration, request.threads, &folder);
  Status written = Status::ok();
  std::size_t registered = 0;
  std::size_t reported = 0;
  BagHandlers handlers;
  handlers.imu = [&](const ImuSample& sample) {
    scanner.addImu(sample);  // a skipped sample is counted in the report
    return !stop;
  };
  handlers.frame = [&](const StereoFrame& frame) {
    written = scanner.addFrame(frame);
    for (; reported < scanner.frames().size(); ++reported) {
      if (scanner.frames()[reported].registered) ++registered;
    }
    progress(reported, bag->expectedFrames(), registered);
    return written.isOk() && !stop;
  };
  const BagStatistics input = bag->play(handlers);
  if (!written) fail(written);

  std::optional<Trajectory> truth;
  if (!bag->groundTruth().empty()) truth = bag->groundTruth();
  scanner.addWarnings(input.notes);
  const Result<evaluation::ScanReport> report = scanner.finish(truth);
  if (!report) fail(report.status());
  return *report;
}

}  // namespace scanner::bridge
