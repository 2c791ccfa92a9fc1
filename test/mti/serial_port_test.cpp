#include "scanner/mti/serial_port.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>

#include "mti/discovery.h"
#include "simulation/pseudo_terminal.h"
#include "support/temporary_folder.h"

namespace scanner::mti {
namespace {

namespace fs = std::filesystem;
using simulation::PseudoTerminal;
using test::TemporaryFolder;

TEST(SerialPort, CarriesBytesBothWays) {
  PseudoTerminal device("");
  Result<SerialPort> port = SerialPort::open(device.path(), {});
  ASSERT_TRUE(port.isOk()) << port.status().message();
  const std::vector<std::uint8_t> all = [] {
    std::vector<std::uint8_t> bytes;
    for (int i = 0; i < 256; ++i) bytes.push_back(static_cast<std::uint8_t>(i));
    return bytes;
  }();
  ASSERT_TRUE(port->write(all, 1.0).isOk());
  EXPECT_EQ(device.read(), all) << "nothing is translated";
  const Time before = Time(std::chrono::system_clock::now().time_since_epoch());
  EXPECT_EQ(device.write(all), all.size());
  std::vector<std::uint8_t> received;
  while (received.size() < all.size()) {
    const Result<SerialPort::Chunk> chunk = port->read(5.0);
    ASSERT_TRUE(chunk.isOk());
    ASSERT_FALSE(chunk->bytes.empty());
    EXPECT_LE(before, chunk->before);
    EXPECT_LE(chunk->before, chunk->after);
    received.insert(received.end(), chunk->bytes.begin(), chunk->bytes.end());
  }
  EXPECT_EQ(received, all);
}

TEST(SerialPort, SetsEveryRate) {
  PseudoTerminal device("");
  Result<SerialPort> port = SerialPort::open(device.path(), {});
  ASSERT_TRUE(port.isOk());
  EXPECT_EQ(device.baudRate(), 115200);
  for (const int rate : {921600, 460800, 230400, 57600, 38400, 19200, 9600}) {
    EXPECT_TRUE(port->setBaudRate(rate).isOk());
    EXPECT_EQ(device.baudRate(), rate);
    EXPECT_EQ(port->baudRate(), rate);
    EXPECT_DOUBLE_EQ(port->secondsPerByte(), 10.0 / rate);
  }
  EXPECT_TRUE(port->setBaudRate(76800).isOk()) << "one without a name";
}

TEST(SerialPort, TwoStopBitsTakeLonger) {
  PseudoTerminal device("");
  SerialPort::Options options;
  options.two_stop_bits = true;
  const Result<SerialPort> port = SerialPort::open(device.path(), options);
  ASSERT_TRUE(port.isOk());
  EXPECT_DOUBLE_EQ(port->secondsPerByte(), 11.0 / 115200);
}

TEST(SerialPort, IsOpenedOnce) {
  PseudoTerminal device("");
  {
    const Result<SerialPort> first = SerialPort::open(device.path(), {});
    ASSERT_TRUE(first.isOk());
    const Result<SerialPort> second = SerialPort::open(device.path(), {});
    ASSERT_FALSE(second.isOk());
    EXPECT_EQ(second.status().code(), StatusCode::kIoError);
    EXPECT_NE(second.status().message().find("in use"), std::string::npos);
  }
  EXPECT_TRUE(SerialPort::open(device.path(), {}).isOk()) << "free again";
}

TEST(SerialPort, SaysWhatIsWrong) {
  const Result<SerialPort> missing = SerialPort::open("/nowhere/at/all", {});
  ASSERT_FALSE(missing.isOk());
  EXPECT_NE(missing.status().message().find("no such port"), std::string::npos);
  const TemporaryFolder folder;
  const std::string file = folder / "file";
  std::ofstream(file) << "text";
  const Result<SerialPort> no_port = SerialPort::open(file, {});
  ASSERT_FALSE(no_port.isOk());
  EXPECT_NE(no_port.status().message().find("no serial port"), std::string::npos);
  if (::geteuid() == 0) GTEST_SKIP() << "root may open everything";
  ::chmod(file.c_str(), 0);
  const Result<SerialPort> closed = SerialPort::open(file, {});
  ASSERT_FALSE(closed.isOk());
  EXPECT_NE(closed.status().message().find("dialout"), std::string::npos);
}

TEST(SerialPort, NoticesThatTheCableIsPulled) {
  auto device = std::make_unique<PseudoTerminal>("");
  Result<SerialPort> port = SerialPort::open(device->path(), {});
  ASSERT_TRUE(port.isOk());
  std::thread puller([&device] { device.reset(); });
  const Result<SerialPort::Chunk> chunk = port->read(10.0);
  puller.join();
  EXPECT_FALSE(chunk.isOk());
  EXPECT_EQ(chunk.status().code(), StatusCode::kIoError);
  EXPECT_FALSE(port->write({1, 2, 3}, 1.0).isOk());
  EXPECT_FALSE(port->read(1.0).isOk());
}

TEST(SerialPort, WaitingEndsInTimeAndOnCall) {
  PseudoTerminal device("");
  const WakeUpCall call;
  Result<SerialPort> port = SerialPort::open(device.path(), {}, &call);
  ASSERT_TRUE(port.isOk());
  const Result<SerialPort::Chunk> nothing = port->read(0.01);
  ASSERT_TRUE(nothing.isOk());
  EXPECT_TRUE(nothing->bytes.empty());
  std::thread ringer([&call] { call.ring(); });
  const Result<SerialPort::Chunk> rung = port->read(1e9);
  ringer.join();
  ASSERT_TRUE(rung.isOk());
  EXPECT_TRUE(rung->bytes.empty());
  EXPECT_TRUE(call.wait(0.0)) << "stays rung";
  call.answer();
  EXPECT_FALSE(call.wait(0.0));
}

TEST(SerialPort, WritingEndsWhenNobodyReads) {
  PseudoTerminal device("");
  Result<SerialPort> port = SerialPort::open(device.path(), {});
  ASSERT_TRUE(port.isOk());
  const Status status = port->write(std::vector<std::uint8_t>(1U << 20U), 0.05);
  EXPECT_EQ(status.code(), StatusCode::kIoError);
}

/// A tree as the kernel shows it.
class FakeSystem {
 public:
  void addUsb(const std::string& name, const std::string& vendor, const std::string& product) {
    const fs::path usb = root() / "sys/devices/usb1" / ("1-" + std::to_string(++count_));
    const fs::path port = usb / "interface" / name;
    fs::create_directories(port / "tty" / name);
    write(usb / "idVendor", vendor);
    write(usb / "idProduct", product);
    write(usb / "manufacturer", "Maker");
    write(usb / "product", "Adapter");
    fs::create_directories(root() / "sys/class/tty");
    fs::create_directory_symlink(port, port / "tty" / name / "device");
    fs::create_directory_symlink(port / "tty" / name, root() / "sys/class/tty" / name);
  }
  void addBuiltIn(const std::string& name, const std::string& type) {
    fs::create_directories(root() / "sys/class/tty" / name);
    write(root() / "sys/class/tty" / name / "type", type);
  }
  void addStableName(const std::string& id, const std::string& name) {
    fs::create_directories(root() / "dev/serial/by-id");
    fs::create_symlink("../../" + name, root() / "dev/serial/by-id" / id);
  }
  fs::path root() const { return folder_.path(); }

 private:
  void write(const fs::path& file, const std::string& text) { std::ofstream(file) << text << '\n'; }

  TemporaryFolder folder_;
  int count_ = 0;
};

TEST(Discovery, PutsTheLikeliestFirst) {
  FakeSystem system;
  system.addBuiltIn("ttyS0", "4");
  system.addBuiltIn("ttyS1", "0");
  system.addBuiltIn("tty1", "");
  system.addUsb("ttyACM0", "1546", "01a8");
  system.addUsb("ttyUSB0", "0403", "6001");
  system.addUsb("ttyUSB1", "0403", "d388");
  system.addUsb("ttyUSB2", "2639", "0001");
  system.addStableName("usb-Xsens-if00", "ttyUSB2");
  const std::vector<Port> ports = findPorts(system.root());
  ASSERT_EQ(ports.size(), 5U);
  const auto dev = [&](const char* name) { return (system.root() / "dev" / name).string(); };
  EXPECT_EQ(ports[0].path, dev("serial/by-id/usb-Xsens-if00"));
  EXPECT_EQ(ports[1].path, dev("ttyUSB1"));
  EXPECT_EQ(ports[1].kind, Port::Kind::kXsens);
  EXPECT_EQ(ports[2].path, dev("ttyUSB0"));
  EXPECT_EQ(ports[2].description, "Maker Adapter");
  EXPECT_EQ(ports[3].path, dev("ttyACM0"));
  EXPECT_EQ(ports[4].path, dev("ttyS0"));
  EXPECT_TRUE(findPorts(system.root() / "nowhere").empty());
}

}  // namespace
}  // namespace scanner::mti
