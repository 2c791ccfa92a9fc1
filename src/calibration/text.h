#pragma once

#include <cstdio>
#include <string>

namespace scanner::calibration {

/// printf into a string; longer than 511 characters is cut.
template <typename... Values>
std::string format(const char* text, Values... values) {
  char line[512];
  std::snprintf(line, sizeof line, text, values...);
  return line;
}

}  // namespace scanner::calibration
