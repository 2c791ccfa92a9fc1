#pragma once

#include <string>

/// What the kernel knows about a serial port. In a file of its own: the kernel's header with
/// arbitrary baud rates and the C library's <termios.h> do not go together.
namespace scanner::mti {

/// Raw 8N1 or 8N2 at any rate; waits until what was written is sent. False with errno set; also
/// when the port took another rate (EINVAL).
bool setRaw(int descriptor, int baud_rate, bool two_stop_bits);
bool discardReceived(int descriptor);
bool isPseudoTerminal(int descriptor);
/// Nobody else may open it, until allowOthers().
bool refuseOthers(int descriptor);
void allowOthers(int descriptor);
/// Where the driver knows it: bytes are handed on at once. True when it promised.
bool requestLowLatency(int descriptor, const std::string& path);

}  // namespace scanner::mti
