#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "scanner/mti/bytes.h"
#include "scanner/mti/driver.h"
#include "scanner/mti/mt_data2.h"
#include "scanner/mti/settings.h"

namespace scanner::mti {
namespace {

using Bytes = std::vector<std::uint8_t>;

Message acknowledge(MessageId id, Bytes data = {}) {
  return {static_cast<std::uint8_t>(static_cast<unsigned>(id) + 1U), std::move(data)};
}

/// Bytes as MT0100P and public clients write them.
TEST(Settings, RequestsAreTheBytesOfTheManual) {
  EXPECT_EQ(encode(request(MessageId::kReqDid)), (Bytes{0xFA, 0xFF, 0x00, 0x00, 0x01}));
  EXPECT_EQ(encode(setPeriod(1152)), (Bytes{0xFA, 0xFF, 0x04, 0x02, 0x04, 0x80, 0x77}));
  EXPECT_EQ(setBaudRate(460800).data, Bytes{0x00});
  EXPECT_EQ(setOutputMode(0x0006).data, (Bytes{0x00, 0x06}));
  EXPECT_EQ(setOutputSettings(0x80000009U).data, (Bytes{0x80, 0x00, 0x00, 0x09}));
  EXPECT_EQ(setOutputSkipFactor(0xFFFF).data, (Bytes{0xFF, 0xFF}));
  EXPECT_EQ(resetOrientation(OrientationReset::kAlign).data, (Bytes{0x00, 0x04}));
  EXPECT_EQ(setHeading(-0.5).data, (Bytes{0xBF, 0x00, 0x00, 0x00}));
  EXPECT_EQ(setFilterScenario(3).data, (Bytes{0x00, 0x03}));
  EXPECT_EQ(setFilterParameter(FilterParameter::kWeighting, 2.0, true).data,
            (Bytes{0x01, 0x40, 0x00, 0x00, 0x00, 0x01}));
  EXPECT_EQ(requestFilterParameter(FilterParameter::kGain).data, Bytes{0x00});
  EXPECT_EQ(
      setOutputConfiguration({{xdi::kPacketCounter, kEveryMessage}, {xdi::kQuaternion, 100}}).data,
      (Bytes{0x10, 0x20, 0xFF, 0xFF, 0x20, 0x10, 0x00, 0x64}));
}

TEST(Settings, ImpossibleValuesThrow) {
  EXPECT_THROW(setBaudRate(115201), ConfigurationError);
  EXPECT_THROW(setPeriod(224), ConfigurationError);
  EXPECT_THROW(setErrorMode(4), ConfigurationError);
  EXPECT_THROW(setHeading(3.2), ConfigurationError);
  EXPECT_THROW(setHeading(std::numeric_limits<double>::quiet_NaN()), ConfigurationError);
  EXPECT_THROW(setFilterParameter(FilterParameter::kGain, 0.01, false), ConfigurationError);
  EXPECT_THROW(setFilterParameter(FilterParameter::kWeighting, 10.0, false), ConfigurationError);
  EXPECT_NO_THROW(setFilterParameter(FilterParameter::kWeighting, 0.0, false));
  EXPECT_THROW(setOutputConfiguration(std::vector<OutputSelection>(33)), ConfigurationError);
  EXPECT_THROW(encodeConfiguration({}), ConfigurationError);
}

TEST(Settings, BaudRatesHaveIdentifiersBothWays) {
  for (const int rate :
       {4800, 9600, 14400, 19200, 28800, 38400, 57600, 76800, 115200, 230400, 460800, 921600}) {
    const auto identifier = baudRateIdentifier(rate);
    ASSERT_TRUE(identifier) << rate;
    EXPECT_EQ(baudRateOf(*identifier), rate);
    EXPECT_EQ(std::count(baudRates().begin(), baudRates().end(), rate), 1);
  }
  EXPECT_EQ(baudRateIdentifier(921600), 0x80);
  EXPECT_EQ(baudRateOf(0x0A), 921600) << "as later devices write it";
  EXPECT_EQ(baudRateOf(0x02), 115200);
  EXPECT_FALSE(baudRateOf(0x7F));
  EXPECT_FALSE(baudRateIdentifier(0));
  EXPECT_EQ(*parseBaudRate(acknowledge(MessageId::kSetBaudRate, {0x01})), 230400);
  EXPECT_FALSE(parseBaudRate(acknowledge(MessageId::kSetBaudRate, {0x55})));
}

TEST(Settings, PeriodsAndRates) {
  EXPECT_EQ(periodOfRate(100.0), 1152);
  EXPECT_EQ(periodOfRate(512.0), 225);
  EXPECT_EQ(periodOfRate(120.0), 960);
  EXPECT_FALSE(periodOfRate(520.0));
  EXPECT_FALSE(periodOfRate(0.0));
  EXPECT_FALSE(periodOfRate(-100.0));
  EXPECT_FALSE(periodOfRate(1.0));
  EXPECT_FALSE(periodOfRate(std::numeric_limits<double>::quiet_NaN()));
  EXPECT_DOUBLE_EQ(rateOfPeriod(1152), 100.0);
  EXPECT_EQ(rateOfPeriod(0), 0.0);
}

TEST(Settings, AnswersAreToldApart) {
  const MessageId asked = MessageId::kSetPeriod;
  EXPECT_EQ(answerKind(acknowledge(asked), asked), AnswerKind::kAcknowledgement);
  EXPECT_EQ(answerKind({0x42, {0x03}}, asked), AnswerKind::kError);
  EXPECT_EQ(answerKind({0x32, Bytes(54)}, asked), AnswerKind::kOther);
  EXPECT_EQ(*parseNumber(acknowledge(asked, {0x04, 0x80}), asked, 2), 1152U);
  EXPECT_EQ(parseNumber(acknowledge(asked, {0x04}), asked, 2).status().code(),
            StatusCode::kInvalidInput);
  EXPECT_EQ(parseNumber(acknowledge(MessageId::kReqDid, {4, 128}), asked, 2).status().code(),
            StatusCode::kInvalidInput);
  const Status refused = parseNumber({0x42, {0x03}}, asked, 2).status();
  EXPECT_EQ(refused.code(), StatusCode::kUnsupported);
  EXPECT_NE(refused.message().find("period"), std::string::npos) << refused.message();
  EXPECT_EQ(*parseError({0x42, {0x21}}), ErrorCode::kParameter);
  EXPECT_FALSE(parseError({0x42, {}}));
  EXPECT_FALSE(parseError({0x41, {0x21}}));
  EXPECT_EQ(describe(static_cast<ErrorCode>(0x77)), "error 0x77");
}

TEST(Settings, WhatTheDeviceIs) {
  const auto id = parseDeviceId(acknowledge(MessageId::kReqDid, {0x00, 0x30, 0x01, 0x23}));
  ASSERT_TRUE(id);
  EXPECT_EQ(deviceIdText(*id), "00300123");
  EXPECT_EQ(
      deviceIdText(*parseDeviceId(acknowledge(MessageId::kReqDid, {0, 0, 0, 3, 0x88, 0, 0, 1}))),
      "0000000388000001");
  EXPECT_FALSE(parseDeviceId(acknowledge(MessageId::kReqDid, {1, 2, 3})));
  const auto old = parseFirmwareRevision(acknowledge(MessageId::kReqFirmwareRevision, {2, 8, 1}));
  EXPECT_EQ(toString(*old), "2.8.1");
  const auto later = parseFirmwareRevision(
      acknowledge(MessageId::kReqFirmwareRevision, {1, 8, 2, 0, 0, 0, 38, 0, 0, 1, 0}));
  EXPECT_EQ(toString(*later), "1.8.2 build 38");
  EXPECT_FALSE(parseFirmwareRevision(acknowledge(MessageId::kReqFirmwareRevision, {1, 8})));
  EXPECT_EQ(*parseProductCode(acknowledge(MessageId::kReqProductCode,
                                          {'M', 'T', 'i', '-', '3', ' ', ' ', 0, 'x'})),
            "MTi-3");
}

/// 118 bytes, offsets as MT0100P lists them.
TEST(Settings, ConfigurationOfALegacyDevice) {
  Bytes data(118, 0);
  const auto put = [&data](std::size_t at, const Bytes& bytes) {
    std::copy(bytes.begin(), bytes.end(), data.begin() + static_cast<std::ptrdiff_t>(at));
  };
  put(0, {0x00, 0x30, 0x01, 0x23});
  put(4, {0x04, 0x80});
  put(6, {0x00, 0x01});
  put(12, {0x00, 0x00, 0x12, 0x34});
  put(96, {0x00, 0x01});
  put(98, {0x00, 0x30, 0x01, 0x23, 0x00, 0x4A, 0x00, 0x06, 0x00, 0x00, 0x00, 0x09});
  const auto configuration = parseConfiguration(acknowledge(MessageId::kReqConfiguration, data));
  ASSERT_TRUE(configuration) << configuration.status().message();
  EXPECT_EQ(configuration->master_id, 0x00300123U);
  EXPECT_EQ(configuration->sync_in_offset, 0x1234U);
  EXPECT_DOUBLE_EQ(configuration->rateHz(), 50.0);
  ASSERT_EQ(configuration->devices.size(), 1U);
  EXPECT_EQ(configuration->devices[0].data_length, 74);
  EXPECT_EQ(configuration->devices[0].output_mode, 0x0006);
  EXPECT_EQ(configuration->devices[0].output_settings, 9U);
  EXPECT_EQ(encodeConfiguration(*configuration).data, data);

  put(6, {0xFF, 0xFF});
  EXPECT_EQ(parseConfiguration(acknowledge(MessageId::kReqConfiguration, data))->rateHz(), 0.0)
      << "on request only";
  for (const std::size_t size : {0U, 97U, 98U, 117U, 119U, 138U}) {
    EXPECT_FALSE(parseConfiguration(acknowledge(MessageId::kReqConfiguration, Bytes(size))))
        << size;
  }
}

TEST(Settings, FilterOfTheFirstDevices) {
  const auto value =
      parseFilterParameter(acknowledge(MessageId::kFilterSettings, {0x00, 0x3F, 0x80, 0x00, 0x00}),
                           FilterParameter::kGain);
  ASSERT_TRUE(value);
  EXPECT_EQ(*value, 1.0);
  EXPECT_FALSE(
      parseFilterParameter(acknowledge(MessageId::kFilterSettings, {0x01, 0x3F, 0x80, 0x00, 0x00}),
                           FilterParameter::kGain));
  EXPECT_EQ(parseFilterParameter({0x42, {0x04}}, FilterParameter::kGain).status().code(),
            StatusCode::kUnsupported)
      << "later firmware";
}

TEST(Settings, FilterScenariosOfLaterFirmware) {
  Bytes data = {3, 1, 'h', 'u', 'm', 'a', 'n'};
  data.resize(22, ' ');
  const auto scenarios = parseFilterScenarios(acknowledge(MessageId::kReqFilterScenarios, data));
  ASSERT_TRUE(scenarios);
  ASSERT_EQ(scenarios->size(), 1U);
  EXPECT_EQ(scenarios->front().label, "human");
  EXPECT_EQ(scenarios->front().type, 3);
  data.pop_back();
  EXPECT_FALSE(parseFilterScenarios(acknowledge(MessageId::kReqFilterScenarios, data)));
}

TEST(Settings, OutputConfiguration) {
  const std::vector<OutputSelection> selections = {{xdi::kSampleTimeFine, kEveryMessage},
                                                   {0x4023, 100}};
  const auto back = parseOutputConfiguration(
      acknowledge(MessageId::kSetOutputConfiguration, setOutputConfiguration(selections).data));
  ASSERT_TRUE(back);
  ASSERT_EQ(back->size(), 2U);
  EXPECT_EQ((*back)[1].identifier, 0x4023);
  EXPECT_EQ((*back)[1].rate_hz, 100);
  EXPECT_FALSE(parseOutputConfiguration(
      acknowledge(MessageId::kSetOutputConfiguration, {0x10, 0x20, 0xFF})));
}

}  // namespace
}  // namespace scanner::mti
