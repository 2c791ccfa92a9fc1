#pragma once

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <functional>

namespace scanner::tools {

/// Exit codes of every command.
enum ExitCode { kOk = 0, kFailed = 1, kUsage = 2 };

/// Parses the command line and runs `body`: usage errors give 2, exceptions one line on stderr
/// and 1.
inline int run(CLI::App& app, int argc, char** argv, const std::function<int()>& body) {
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kOk : kUsage;
  }
  try {
    return body();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", app.get_name().c_str(), error.what());
    return kFailed;
  }
}

}  // namespace scanner::tools
