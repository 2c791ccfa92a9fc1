#pragma once

#include "calibration/selection.h"

namespace scanner::calibration {

/// Intrinsics of both eyes, baseline and the rotation between them, with their uncertainty.
std::vector<Parameter> parametersOf(const Candidate& candidate);

}  // namespace scanner::calibration
