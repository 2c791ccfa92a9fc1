#pragma once

#include <cstddef>
#include <string>

#include "scanner/evaluation/report.h"

namespace scanner::evaluation {

std::size_t registeredViews(const ScanReport& report);

/// What a person wants to know at the end of a scan, in a few lines: views, trials, loop, truth,
/// model, times, warnings, and every discarded view with its reason.
std::string summary(const ScanReport& report);

}  // namespace scanner::evaluation
