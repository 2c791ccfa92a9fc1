#pragma once

#include <istream>
#include <stdexcept>

#include "scanner/core/mesh.h"

namespace scanner::ply {

/// What is wrong with the file; the caller adds its name.
class ParseError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Parses header and body. Throws ParseError; never trusts a count before the data is there.
Mesh parse(std::istream& in);

}  // namespace scanner::ply
