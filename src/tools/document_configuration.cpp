#include <cstdio>
#include <string>

#include "scanner/calibration/stereo_calibration.h"
#include "scanner/pipeline/config.h"
#include "scanner/simulation/simulation.h"

int main() {
  const std::string text =
      scanner::pipeline::documentConfiguration() +
      "\nThe simulated rig has a block of its own, for `simulate --config FILE` and `field.launch "
      "sim:=true simulation:=FILE`:\n\n" +
      scanner::documentOptions<scanner::simulation::SimulationOptions>("simulation") +
      "\nSo has the calibration, for `calibrate_stereo --config FILE` (docs/calibration.md):\n\n" +
      scanner::documentOptions<scanner::calibration::StereoCalibrationOptions>("calibration");
  std::fputs(text.c_str(), stdout);
  return 0;
}
