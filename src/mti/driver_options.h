#pragma once

#include "scanner/mti/driver.h"

namespace scanner::mti {

/// Throws ConfigurationError naming option, value and limit.
void validate(DriverOptions options);

}  // namespace scanner::mti
