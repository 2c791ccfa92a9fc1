// register_scans FILE... --prior POSES --out DIR: see scanner/registration/scan_set.h.
#include <CLI/CLI.hpp>
#include <iostream>

#include "scanner/registration/scan_set.h"

int main(int argc, char** argv) {
  scanner::registration::RegisterScansArguments arguments;
  CLI::App app("Registers scans that come with an initial pose each.");
  app.add_option("FILE", arguments.files, "Scans (PLY, metres)")->required();
  app.add_option("--prior", arguments.prior,
                 "Initial poses: Stanford .conf (by file name) or TUM (in the order of the files)")
      ->required();
  app.add_option("--out", arguments.out, "Folder to write to")->required();
  app.add_option("--config", arguments.config, "YAML with a block `registration`");
  app.add_option("--threads", arguments.threads, "Threads; the result does not depend on it")
      ->check(CLI::PositiveNumber);
  app.add_option("--seed", arguments.seed, "Seed of sampling and disturbance");
  app.add_option("--disturb-deg", arguments.disturb_deg,
                 "For tests: turn every pose but the first by this about a random axis");
  app.add_option("--disturb-mm", arguments.disturb_mm,
                 "For tests: move every pose but the first by this in a random direction");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    const auto summary = scanner::registration::runRegisterScans(arguments);
    (summary ? std::cout : std::cerr)
        << (summary ? *summary : "register_scans: " + summary.status().message()) << "\n";
    return summary ? 0 : 1;
  } catch (const std::exception& error) {
    std::cerr << "register_scans: " << error.what() << "\n";
    return 1;
  }
}
