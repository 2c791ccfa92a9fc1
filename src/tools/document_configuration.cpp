#include <cstdio>
#include <string>

#include "scanner/pipeline/config.h"
#include "scanner/simulation/simulation.h"

int main() {
  const std::string text =
      scanner::pipeline::documentConfiguration() +
      "\nThe simulated rig has a block of its own, for `simulate --config FILE` and `field.launch "
      "sim:=true simulation:=FILE`:\n\n" +
      scanner::documentOptions<scanner::simulation::SimulationOptions>("simulation");
  std::fputs(text.c_str(), stdout);
  return 0;
}
