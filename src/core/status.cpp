#include "scanner/core/status.h"

namespace scanner {

const char* toString(StatusCode code) {
  switch (code) {
    case StatusCode::kOk:
      return "ok";
    case StatusCode::kInvalidInput:
      return "invalid_input";
    case StatusCode::kNotEnoughData:
      return "not_enough_data";
    case StatusCode::kNoConvergence:
      return "no_convergence";
    case StatusCode::kNoOverlap:
      return "no_overlap";
    case StatusCode::kOutOfRange:
      return "out_of_range";
    case StatusCode::kIoError:
      return "io_error";
    case StatusCode::kUnsupported:
      return "unsupported";
  }
  return "unknown";
}

}  // namespace scanner
