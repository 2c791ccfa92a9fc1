#include <gtest/gtest.h>
#include <poll.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <mutex>
#include <thread>

#include "scanner/mti/driver.h"
#include "scanner/mti/mt_data.h"
#include "scanner/mti/mt_data2.h"
#include "scanner/mti/settings.h"
#include "simulation/pseudo_terminal.h"

/// Devices that the emulated MTi is not: later generations, other manners of changing the baud
/// rate.
namespace scanner::mti {
namespace {

using Clock = std::chrono::steady_clock;
using simulation::PseudoTerminal;

struct Manners {
  bool mt_data2 = false;
  enum class BaudRate {
    kAtOnce,
    kAfterReset,
    kRefused,
    kPromisedOnly
  } baud_rate = BaudRate::kAtOnce;
};

/// A device on a thread that answers what a driver asks, as little as is needed. At another baud
/// rate it neither hears nor is heard.
class SimpleDevice {
 public:
  explicit SimpleDevice(const Manners& manners) : manners_(manners), terminal_("") {
    thread_ = std::thread([this] { run(); });
  }
  ~SimpleDevice() {
    stop_ = true;
    thread_.join();
  }
  std::string path() const { return terminal_.path(); }
  int baudRate() const { return active_baud_rate_; }

 private:
  void run() {
    Clock::time_point due = Clock::now();
    while (!stop_) {
      pollfd watched{terminal_.descriptor(), POLLIN, 0};
      ::poll(&watched, 1, 2);
      const std::vector<std::uint8_t> bytes = terminal_.read();
      if (terminal_.baudRate() == active_baud_rate_) parser_.push(bytes.data(), bytes.size());
      while (const std::optional<Message> message = parser_.next()) answer(*message);
      if (Clock::now() < due) continue;
      due += std::chrono::milliseconds(10);
      if (measuring_) send(data());
      ++counter_;
    }
  }

  void send(const Message& message) {
    if (terminal_.isOpen() && terminal_.baudRate() == active_baud_rate_) {
      terminal_.write(encode(message));
    }
  }
  void acknowledge(const Message& message, std::vector<std::uint8_t> content = {}) {
    send({static_cast<std::uint8_t>(message.id + 1), std::move(content)});
  }
  void refuse() { send({static_cast<std::uint8_t>(MessageId::kError), {0x04}}); }

  void answer(const Message& message) {
    switch (static_cast<MessageId>(message.id)) {
      case MessageId::kWakeUpAck:
        return;
      case MessageId::kGoToConfig:
        measuring_ = false;
        return acknowledge(message);
      case MessageId::kGoToMeasurement:
        measuring_ = true;
        return acknowledge(message);
      case MessageId::kReqDid:
        return acknowledge(message, {0x07, 0x70, 0x0A, 0xBC});
      case MessageId::kReqFirmwareRevision:
        return acknowledge(message, {1, 11, 0});
      case MessageId::kReset:
        acknowledge(message);
        active_baud_rate_ = stored_baud_rate_;
        return;
      case MessageId::kSetBaudRate:
        return setBaudRate(message);
      case MessageId::kSetOutputConfiguration:
        if (!manners_.mt_data2) return refuse();
        if (!message.data.empty()) outputs_ = message.data;
        return acknowledge(message, outputs_);
      case MessageId::kReqConfiguration:
        return acknowledge(message, legacyConfiguration());
      case MessageId::kFilterSettings:
        return refuse();
      default:
        return message.data.empty() ? refuse() : acknowledge(message);
    }
  }

  void setBaudRate(const Message& message) {
    if (manners_.baud_rate == Manners::BaudRate::kRefused) {
      return send({static_cast<std::uint8_t>(MessageId::kError), {0x20}});
    }
    acknowledge(message);
    const int wanted = baudRateOf(message.data.at(0)).value_or(0);
    if (manners_.baud_rate == Manners::BaudRate::kAfterReset) stored_baud_rate_ = wanted;
    if (manners_.baud_rate == Manners::BaudRate::kAtOnce) {
      ::poll(nullptr, 0, 20);  // the host reads the answer at the old rate
      stored_baud_rate_ = active_baud_rate_ = wanted;
    }
  }

  std::vector<std::uint8_t> legacyConfiguration() const {
    DeviceConfiguration configuration;
    configuration.period = 1152;
    DeviceConfiguration::Device device;
    device.output_mode = output_mode::kCalibrated | output_mode::kOrientation;
    device.output_settings = output_settings::kSampleCounter;
    device.data_length =
        static_cast<std::uint16_t>(mtDataSize(device.output_mode, device.output_settings));
    configuration.devices.push_back(device);
    return encodeConfiguration(configuration).data;
  }

  Message data() const {
    MtData2 later;
    later.packet_counter = static_cast<std::uint16_t>(counter_);
    later.acceleration = Eigen::Vector3d(0.0, 0.0, 9.81);
    later.angular_velocity = Eigen::Vector3d(0.1, 0.2, 0.3);
    later.magnetic_field = Eigen::Vector3d::UnitX();
    later.temperature_c = 25.0;
    later.rotation_matrix = InFrame<Eigen::Matrix3d>{Eigen::Matrix3d::Identity()};
    if (manners_.mt_data2) {
      std::vector<std::uint16_t> identifiers;
      for (std::size_t i = 0; i + 3 < outputs_.size(); i += 4) {
        identifiers.push_back(static_cast<std::uint16_t>((outputs_[i] << 8U) | outputs_[i + 1]));
      }
      return encodeMtData2(later, identifiers);
    }
    MtData data = toMtData(later);
    return encodeMtData(data, output_mode::kCalibrated | output_mode::kOrientation,
                        output_settings::kSampleCounter);
  }

  const Manners manners_;
  PseudoTerminal terminal_;
  MessageParser parser_{254};
  bool measuring_ = true;
  std::vector<std::uint8_t> outputs_ = {0x10, 0x20, 0xFF, 0xFF, 0x40, 0x20, 0x00, 0x64};
  unsigned counter_ = 65500;
  std::atomic<int> active_baud_rate_{115200};
  int stored_baud_rate_ = 115200;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// Drives the device until some samples came.
struct Driven {
  std::vector<Sample> samples;
  DriverStatistics statistics;
};

Driven drive(const SimpleDevice& device, const std::function<void(DriverOptions&)>& change = {}) {
  DriverOptions options;
  options.port = device.path();
  options.answer_timeout_s = 0.2;
  options.retry_min_s = 0.05;
  if (change) change(options);
  std::mutex mutex;
  Driven driven;
  Driver driver(options, [&](const Sample& sample) {
    const std::lock_guard<std::mutex> lock(mutex);
    driven.samples.push_back(sample);
  });
  const Clock::time_point start = Clock::now();
  while (Clock::now() - start < std::chrono::seconds(20)) {
    {
      const std::lock_guard<std::mutex> lock(mutex);
      if (driven.samples.size() >= 40) break;
    }
    ::poll(nullptr, 0, 10);
  }
  const std::lock_guard<std::mutex> lock(mutex);
  driven.statistics = driver.statistics();
  Driven copy = driven;
  return copy;
}

TEST(MtiGenerations, SpeaksMtData2) {
  const SimpleDevice device({true, Manners::BaudRate::kAfterReset});
  const Driven driven = drive(device);
  ASSERT_GE(driven.samples.size(), 40U) << driven.statistics.problem;
  EXPECT_EQ(driven.statistics.protocol, "MTData2");
  EXPECT_EQ(driven.statistics.device_id, "07700ABC");
  EXPECT_EQ(driven.statistics.baud_rate, 460800);
  EXPECT_EQ(driven.statistics.rejected, 0U);
  const Sample& sample = driven.samples.back();
  ASSERT_TRUE(sample.acceleration && sample.angular_velocity && sample.magnetic_field &&
              sample.temperature_c && sample.orientation);
  EXPECT_NEAR(sample.angular_velocity->z(), 0.3, 1e-6);
  EXPECT_LT(sample.orientation->angularDistance(Eigen::Quaterniond::Identity()), 1e-6)
      << "ENU was asked for";
  EXPECT_EQ(sample.number - driven.samples.front().number, driven.samples.size() - 1)
      << "across the wrap of the counter";
}

TEST(MtiGenerations, TakesMtData2AsItIs) {
  const SimpleDevice device({true, Manners::BaudRate::kRefused});
  const Driven driven = drive(device, [](DriverOptions& o) { o.configure = false; });
  ASSERT_GE(driven.samples.size(), 40U) << driven.statistics.problem;
  EXPECT_TRUE(driven.samples.back().acceleration);
  EXPECT_FALSE(driven.samples.back().orientation);
}

TEST(MtiGenerations, BaudRateThatChangesAtOnce) {
  const SimpleDevice device({false, Manners::BaudRate::kAtOnce});
  const Driven driven = drive(device);
  ASSERT_GE(driven.samples.size(), 40U) << driven.statistics.problem;
  EXPECT_EQ(driven.statistics.baud_rate, 460800);
  EXPECT_EQ(device.baudRate(), 460800);
}

TEST(MtiGenerations, BaudRateThatIsRefused) {
  const SimpleDevice device({false, Manners::BaudRate::kRefused});
  const Driven driven = drive(device);
  ASSERT_GE(driven.samples.size(), 40U) << driven.statistics.problem;
  EXPECT_EQ(driven.statistics.baud_rate, 115200);
  EXPECT_NE(driven.statistics.notes.find("stays at 115200"), std::string::npos);
}

TEST(MtiGenerations, BaudRateThatIsPromisedOnly) {
  const SimpleDevice device({false, Manners::BaudRate::kPromisedOnly});
  const Driven driven = drive(device);
  ASSERT_GE(driven.samples.size(), 40U) << driven.statistics.problem;
  EXPECT_EQ(driven.statistics.baud_rate, 115200) << "the device is not lost";
  EXPECT_NE(driven.statistics.notes.find("does not answer at 460800"), std::string::npos);
}

}  // namespace
}  // namespace scanner::mti
