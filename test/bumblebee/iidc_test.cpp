#include "bumblebee/iidc.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "bumblebee/register_map.h"

namespace scanner::bumblebee {
namespace {

/// Registers of an emulated camera as a bus reaches them.
class MapBus : public RegisterBus {
 public:
  Result<std::uint32_t> read(std::uint64_t offset) const override {
    const auto value = map.read(offset);
    if (!value) return Status(StatusCode::kIoError, "address error");
    return *value;
  }
  Status write(std::uint64_t offset, std::uint32_t value) override {
    if (map.write(offset, value)) return Status::ok();
    return {StatusCode::kIoError, "address error"};
  }
  RegisterMap map;
};

constexpr std::uint64_t kFormat7 = RegisterMap::kFormat7;

TEST(Iidc, ConfiguresTheStereoMode) {
  MapBus bus;
  bus.map.set(0x614, 0x80000000);  // what a crashed program left on
  const auto setup = configureIidc(bus, 0, 0);
  ASSERT_TRUE(setup) << setup.status().message();
  EXPECT_EQ(setup->format.width_px, 640);
  EXPECT_EQ(setup->format.height_px, 480);
  EXPECT_EQ(setup->format.pixels, PixelFormat::kBayerGrbg8);
  EXPECT_EQ(setup->format.order, ByteOrder::kRightFirst);
  EXPECT_TRUE(setup->format.embedded_timestamp);
  EXPECT_TRUE(setup->format.embedded_counter);
  EXPECT_EQ(setup->bytes_per_packet, 4096U);

  EXPECT_EQ(bus.map.get(0x610), 0x80000000U);
  EXPECT_EQ(bus.map.get(0x614), 0U);
  EXPECT_EQ(bus.map.get(0x608), 7U << 29);
  EXPECT_EQ(bus.map.get(0x604), 3U << 29);
  EXPECT_EQ(bus.map.get(kFormat7 + 0x0C), 640U << 16 | 480);
  EXPECT_EQ(bus.map.get(kFormat7 + 0x10), 10U << 24);  // RAW16
  EXPECT_EQ(bus.map.get(0x1048), 0x80000000U);
  EXPECT_EQ(bus.map.get(0x12F8), 0x80000041U);  // time stamp, counter, nothing else
}

TEST(Iidc, SensorBoardsGiveSizeAndColour) {
  const struct {
    std::uint32_t board;
    int width, height;
    PixelFormat pixels;
  } cases[] = {{0xA, 640, 480, PixelFormat::kBayerGrbg8},  {0xB, 640, 480, PixelFormat::kMono8},
               {0xC, 1024, 768, PixelFormat::kBayerGrbg8}, {0xD, 1024, 768, PixelFormat::kMono8},
               {0xE, 1280, 960, PixelFormat::kBayerGrbg8}, {0xF, 1280, 960, PixelFormat::kMono8}};
  for (const auto& c : cases) {
    MapBus bus;
    bus.map.set(0x1F28, 0xAB00 | c.board);
    bus.map.set(kFormat7, 1280U << 16 | 960);
    const auto setup = configureIidc(bus, c.width, c.height);
    ASSERT_TRUE(setup) << setup.status().message();
    EXPECT_EQ(setup->format.width_px, c.width);
    EXPECT_EQ(setup->format.height_px, c.height);
    EXPECT_EQ(setup->format.pixels, c.pixels);
    EXPECT_EQ(bus.map.get(kFormat7 + 0x10) >> 24, c.pixels == PixelFormat::kMono8 ? 5U : 10U);
  }
}

TEST(Iidc, BayerTiles) {
  const std::pair<std::uint32_t, PixelFormat> tiles[] = {{0x52474742, PixelFormat::kBayerRggb8},
                                                         {0x47425247, PixelFormat::kBayerGbrg8},
                                                         {0x47524247, PixelFormat::kBayerGrbg8},
                                                         {0x42474752, PixelFormat::kBayerBggr8},
                                                         {0x59595959, PixelFormat::kMono8}};
  for (const auto& [value, pixels] : tiles) {
    MapBus bus;
    bus.map.set(0x1040, value);
    const auto setup = configureIidc(bus, 0, 0);
    ASSERT_TRUE(setup);
    EXPECT_EQ(setup->format.pixels, pixels);
  }
  MapBus bus;
  bus.map.set(0x1040, 0x12345678);
  EXPECT_EQ(configureIidc(bus, 0, 0).status().code(), StatusCode::kUnsupported);
}

TEST(Iidc, EyeOrderCanBeOverridden) {
  MapBus bus;
  EXPECT_EQ(configureIidc(bus, 0, 0, EyeOrder::kLeftFirst)->format.order, ByteOrder::kLeftFirst);
  EXPECT_EQ(configureIidc(bus, 0, 0, EyeOrder::kRightFirst)->format.order, ByteOrder::kRightFirst);
  EXPECT_EQ(bus.map.get(0x1048), 0x80000000U);
}

TEST(Iidc, RefusesWhatIsNoBumblebee) {
  const auto codeOf = [](std::uint64_t offset, std::uint32_t value) {
    MapBus bus;
    bus.map.set(offset, value);
    const auto setup = configureIidc(bus, 0, 0);
    EXPECT_FALSE(setup) << "register " << offset;
    return setup ? StatusCode::kOk : setup.status().code();
  };
  for (const std::uint64_t offset :
       {std::uint64_t{0x1F28}, std::uint64_t{0x100}, std::uint64_t{0x19C}, std::uint64_t{0x2EC},
        kFormat7 + 0x14, kFormat7 + 0x40})
    EXPECT_EQ(codeOf(offset, 0), StatusCode::kUnsupported);
  EXPECT_EQ(codeOf(kFormat7, 320U << 16 | 240), StatusCode::kUnsupported);
  MapBus bus;
  EXPECT_EQ(configureIidc(bus, 320, 240).status().code(), StatusCode::kUnsupported);
}

TEST(Iidc, RefusesAByteOrderThatDoesNotStay) {
  MapBus bus;
  bus.map.stick(0x1048);  // stays big-endian
  const auto setup = configureIidc(bus, 0, 0);
  ASSERT_FALSE(setup);
  EXPECT_EQ(setup.status().code(), StatusCode::kUnsupported);
  EXPECT_NE(setup.status().message().find("0x1048"), std::string::npos);
}

TEST(Iidc, StreamsWithoutEmbeddedInformationWhenThereIsNone) {
  for (const bool failing : {true, false}) {
    MapBus bus;
    if (failing) bus.map.fail(0x12F8);
    bus.map.set(0x12F8, 0);
    const auto setup = configureIidc(bus, 0, 0);
    ASSERT_TRUE(setup) << setup.status().message();
    EXPECT_FALSE(setup->format.embedded_timestamp);
    EXPECT_FALSE(setup->format.embedded_counter);
    EXPECT_FALSE(bus.map.written(0x12F8));
  }
}

TEST(Iidc, FailuresNameTheRegister) {
  for (const std::uint64_t offset :
       {std::uint64_t{0x1F28}, std::uint64_t{0x400}, std::uint64_t{0x604}, std::uint64_t{0x608},
        std::uint64_t{0x610}, std::uint64_t{0x614}, std::uint64_t{0x2EC}, std::uint64_t{0x1040},
        std::uint64_t{0x1048}, kFormat7 + 0x08, kFormat7 + 0x0C, kFormat7 + 0x44}) {
    MapBus bus;
    bus.map.fail(offset);
    const auto setup = configureIidc(bus, 0, 0);
    ASSERT_FALSE(setup) << offset;
    EXPECT_EQ(setup.status().code(), StatusCode::kIoError);
    char name[16];
    std::snprintf(name, sizeof name, "0x%llX", static_cast<unsigned long long>(offset));
    EXPECT_NE(setup.status().message().find(name), std::string::npos) << setup.status().message();
    EXPECT_EQ(setup.status().message().find('\n'), std::string::npos);
  }
}

TEST(Iidc, StartAndStop) {
  MapBus bus;
  ASSERT_TRUE(startIidc(bus));
  EXPECT_EQ(bus.map.get(0x614), 0x80000000U);
  ASSERT_TRUE(stopIidc(bus));
  EXPECT_EQ(bus.map.get(0x614), 0U);
  bus.map.stick(0x614);
  EXPECT_EQ(startIidc(bus).code(), StatusCode::kIoError);  // does not stay on
}

TEST(Iidc, CapabilitiesComeFromTheInquiries) {
  MapBus bus;
  auto capabilities = iidcCapabilities(bus);
  ASSERT_TRUE(capabilities) << capabilities.status().message();
  EXPECT_EQ(capabilities->width_px, 640);
  EXPECT_EQ(capabilities->height_px, 480);
  ASSERT_TRUE(capabilities->exposure_s && capabilities->gain_db && capabilities->rate_hz &&
              capabilities->white_balance);
  EXPECT_FLOAT_EQ(static_cast<float>(capabilities->exposure_s->max), 0.5F);
  EXPECT_FLOAT_EQ(static_cast<float>(capabilities->gain_db->max), 24.0F);
  EXPECT_FLOAT_EQ(static_cast<float>(capabilities->rate_hz->min), 0.5F);
  EXPECT_EQ(capabilities->white_balance->max, 1023.0);
  EXPECT_TRUE(capabilities->registers && capabilities->frame_counter && capabilities->temperature);
  EXPECT_FALSE(capabilities->device_clock);  // the transport knows

  bus.map.set(0x51C, 0x81000000);                                // no absolute value
  bus.map.set(0x404, bus.map.get(0x404) & ~(0x80000000U >> 8));  // no gain
  bus.map.setFloat(RegisterMap::kRateAbs, std::numeric_limits<float>::quiet_NaN());
  bus.map.set(0x12F8, 0);
  capabilities = iidcCapabilities(bus);
  ASSERT_TRUE(capabilities);
  EXPECT_FALSE(capabilities->exposure_s || capabilities->gain_db || capabilities->rate_hz);
  EXPECT_FALSE(capabilities->frame_counter);
}

TEST(Iidc, SetsControlsInAbsoluteUnits) {
  MapBus bus;
  Controls controls;
  controls.exposure_s = 0.004;
  controls.gain_db = 6.0;
  controls.rate_hz = 1.82;
  controls.white_balance_red = 700;
  const auto status = setIidcControls(bus, controls);
  ASSERT_TRUE(status) << status.message();
  EXPECT_FLOAT_EQ(bus.map.getFloat(RegisterMap::kShutterAbs + 8), 0.004F);
  EXPECT_FLOAT_EQ(bus.map.getFloat(RegisterMap::kGainAbs + 8), 6.0F);
  EXPECT_FLOAT_EQ(bus.map.getFloat(RegisterMap::kRateAbs + 8), 1.82F);
  for (const std::uint64_t feature : {0x81C, 0x820, 0x83C}) {
    EXPECT_NE(bus.map.get(feature) & 1U << 30, 0U) << "absolute";
    EXPECT_NE(bus.map.get(feature) & 1U << 25, 0U) << "on";
    EXPECT_EQ(bus.map.get(feature) & 1U << 24, 0U) << "manual";
  }
  // The blue half was not asked for and stays.
  EXPECT_EQ(bus.map.get(0x80C), 0x82000000U | 512U << 12 | 700);

  const auto read = iidcControls(bus);
  ASSERT_TRUE(read);
  EXPECT_NEAR(read->exposure_s.value_or(0), 0.004, 1e-9);
  EXPECT_NEAR(read->rate_hz.value_or(0), 1.82, 1e-6);
  EXPECT_EQ(read->white_balance_blue, 512.0);
  EXPECT_EQ(read->white_balance_red, 700.0);
}

TEST(Iidc, RefusesControlsBeforeItWritesAny) {
  MapBus bus;
  const auto codeOf = [&bus](const Controls& controls) {
    bus.map.forgetWrites();
    const StatusCode code = setIidcControls(bus, controls).code();
    EXPECT_FALSE(bus.map.written(RegisterMap::kRateAbs + 8));
    EXPECT_FALSE(bus.map.written(0x83C));
    return code;
  };
  Controls good;
  good.rate_hz = 2.0;
  Controls controls = good;
  controls.exposure_s = 2.0;
  EXPECT_EQ(codeOf(controls), StatusCode::kInvalidInput);
  controls = good;
  controls.gain_db = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(codeOf(controls), StatusCode::kInvalidInput);
  controls = good;
  controls.white_balance_blue = 5000;
  EXPECT_EQ(codeOf(controls), StatusCode::kInvalidInput);
  bus.map.set(0x51C, 0);
  controls = good;
  controls.exposure_s = 0.01;
  EXPECT_EQ(codeOf(controls), StatusCode::kUnsupported);
  EXPECT_TRUE(setIidcControls(bus, good));
}

TEST(Iidc, LimitsThatACameraNamesAreAccepted) {
  MapBus bus;
  const auto capabilities = iidcCapabilities(bus);
  ASSERT_TRUE(capabilities);
  Controls controls;
  controls.exposure_s = 1e-5;  // the camera's own limit is the float nearest to it
  EXPECT_TRUE(setIidcControls(bus, controls));
  controls.exposure_s = capabilities->exposure_s->max;
  EXPECT_TRUE(setIidcControls(bus, controls));
}

TEST(Iidc, Temperature) {
  MapBus bus;
  EXPECT_NEAR(iidcTemperatureC(bus).value_or(0), 308.8 - 273.15, 1e-9);
  bus.map.set(0x82C, 0x80000000);  // 0 K
  EXPECT_FALSE(iidcTemperatureC(bus));
  bus.map.set(0x82C, 0x82000C10);
  bus.map.set(0x404, 0);
  EXPECT_FALSE(iidcTemperatureC(bus));
}

TEST(Iidc, EmbeddedInformation) {
  FrameFormat format;
  format.embedded_timestamp = true;
  format.embedded_counter = true;
  // 100 s, cycle 7999, offset 3071; counter
  const std::uint32_t timer = 100U << 25 | 7999U << 12 | 3071U;
  std::uint8_t bytes[8] = {static_cast<std::uint8_t>(timer >> 24),
                           static_cast<std::uint8_t>(timer >> 16),
                           static_cast<std::uint8_t>(timer >> 8),
                           static_cast<std::uint8_t>(timer),
                           0x01,
                           0x02,
                           0x03,
                           0x04};
  auto info = readEmbeddedInfo(bytes, sizeof bytes, format);
  ASSERT_TRUE(info.cycle_time && info.counter);
  EXPECT_NEAR(toSeconds(*info.cycle_time), 101.0, 1e-7);
  EXPECT_EQ(*info.counter, 0x01020304U);

  bytes[2] = 0xFF;  // offset above 3071
  info = readEmbeddedInfo(bytes, sizeof bytes, format);
  EXPECT_FALSE(info.cycle_time);
  EXPECT_TRUE(info.counter);

  info = readEmbeddedInfo(bytes, 7, format);
  EXPECT_FALSE(info.cycle_time || info.counter);

  format.embedded_timestamp = false;
  EXPECT_EQ(readEmbeddedInfo(bytes + 4, 4, format).counter, 0x01020304U);
  format.embedded_counter = false;
  EXPECT_FALSE(readEmbeddedInfo(nullptr, 0, format).counter);
}

}  // namespace
}  // namespace scanner::bumblebee
