#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace scanner::simulation {

/// The device's end of a pseudo-terminal that looks like a serial port to whoever opens path():
/// raw, at 115200 baud until a host sets another rate. Destroying it is pulling the cable: readers
/// get a hang-up, the link is gone. Never blocks.
class PseudoTerminal {
 public:
  /// `link`: symbolic link to be kept on the terminal; empty: none. A link left behind is replaced,
  /// anything else in its place is refused. Throws ConfigurationError.
  explicit PseudoTerminal(const std::string& link);
  ~PseudoTerminal();
  PseudoTerminal(const PseudoTerminal&) = delete;
  PseudoTerminal& operator=(const PseudoTerminal&) = delete;

  /// For poll(): readable when the host has sent something, hung up while nobody has it open.
  int descriptor() const { return master_; }
  const std::string& path() const { return link_.empty() ? name_ : link_; }
  bool isOpen() const;
  /// Discards what the last host has left unread, so that the next one does not get it.
  void discardUnread();
  /// What the host has sent; may be empty.
  std::vector<std::uint8_t> read();
  /// How many bytes found room; the rest is lost, as at a receiver that is not read.
  std::size_t write(const std::vector<std::uint8_t>& bytes);
  /// Bits per second that the host has set; 0 for a rate that has no name.
  int baudRate() const;

 private:
  void open();
  void setRaw();
  void makeLink();

  int master_ = -1;
  std::string name_;  ///< of the host's end
  std::string link_;
};

}  // namespace scanner::simulation
