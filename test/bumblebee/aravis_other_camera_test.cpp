// Cameras that offer other formats, features and clocks than the Bumblebee.
#include <arv.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "bumblebee/aravis_fixture.h"
#include "bumblebee/aravis_support.h"
#include "support/temporary_folder.h"

namespace scanner::bumblebee {
namespace {

/// Aravis' fake camera with another GenICam model, whose registers the test writes.
class OtherCameraTest : public AravisTest {
 protected:
  void plugModel(const std::vector<std::pair<std::string, std::string>>& changes) {
    ArvFakeCamera* const model = arv_fake_camera_new("MODEL");
    std::size_t size = 0;
    const char* const xml = arv_fake_camera_get_genicam_xml(model, &size);
    std::string text(xml, size);
    g_object_unref(model);
    for (const auto& [from, to] : changes) {
      const std::size_t place = text.find(from);
      ASSERT_NE(place, std::string::npos) << from;
      text.replace(place, from.size(), to);
    }
    const std::string path = folder_ / "model.xml";
    std::ofstream(path) << text;
    camera_.reset(arv_gv_fake_camera_new_full(kHere, "MODEL", path.c_str()));
    ASSERT_TRUE(camera_ && arv_gv_fake_camera_is_running(camera_.get()));
    write(ARV_FAKE_CAMERA_REGISTER_SENSOR_WIDTH, 64);
    write(ARV_FAKE_CAMERA_REGISTER_SENSOR_HEIGHT, 48);
    write(ARV_FAKE_CAMERA_REGISTER_WIDTH, 64);
    write(ARV_FAKE_CAMERA_REGISTER_HEIGHT, 48);
  }
  void write(std::uint32_t address, std::uint32_t value) {
    arv_fake_camera_write_register(arv_gv_fake_camera_get_fake_camera(camera_.get()), address,
                                   value);
  }

  test::TemporaryFolder folder_;
  aravis::Object<ArvGvFakeCamera> camera_;
};

TEST_F(OtherCameraTest, WithoutMono16IsRefusedWithWhatItHas) {
  plugModel({{"EnumEntry Name=\"Mono16\"", "EnumEntry Name=\"Mono12\""},
             {"<Value>17825799</Value>", "<Value>17825797</Value>"}});
  const auto camera = open();
  ASSERT_TRUE(camera);
  const auto format = camera->configure(0, 0, {});
  EXPECT_EQ(format.status().code(), StatusCode::kUnsupported);
  EXPECT_NE(format.status().message().find("BayerRG8, Mono8, RGB8, Mono12"), std::string::npos)
      << format.status().message();
}

TEST_F(OtherCameraTest, FeaturesOfRicherCameras) {
  plugModel({{"<Max>10</Max>", "<Max>480</Max>"},  // GainRaw: too large for dB
             {"<!-- Analog control -->", R"(
      <Enumeration Name="PixelColorFilter"><EnumEntry Name="BayerGB"><Value>2</Value></EnumEntry>
        <Value>2</Value></Enumeration>
      <Float Name="DeviceTemperature"><Value>41.5</Value></Float>
      <Enumeration Name="BalanceRatioSelector"><EnumEntry Name="Red"><Value>0</Value></EnumEntry>
        <EnumEntry Name="Blue"><Value>1</Value></EnumEntry><Value>0</Value></Enumeration>
      <Float Name="BalanceRatio"><Value>1.5</Value><Min>0.25</Min><Max>4.0</Max></Float>)"}});
  const auto camera = open();
  ASSERT_TRUE(camera);
  const Capabilities c = camera->capabilities();
  ASSERT_TRUE(c.gain_db);
  EXPECT_NEAR(c.gain_db->max, 48.0, 1e-9);
  ASSERT_TRUE(c.white_balance);
  EXPECT_EQ(c.white_balance->min, 0.25);
  EXPECT_EQ(c.white_balance->max, 4.0);
  EXPECT_TRUE(c.temperature);
  EXPECT_EQ(camera->temperatureC(), 41.5);
  Controls controls;
  controls.gain_db = 12.3;
  controls.white_balance_blue = 2.0;
  const auto format = camera->configure(0, 0, controls);
  ASSERT_TRUE(format) << format.status().message();
  EXPECT_EQ(format->pixels, PixelFormat::kBayerGbrg8);
  const auto now = camera->controls();
  ASSERT_TRUE(now);
  EXPECT_NEAR(*now->gain_db, 12.3, 1e-9);
  EXPECT_EQ(*now->white_balance_blue, 2.0);
}

TEST_F(OtherCameraTest, AFrameOfAnotherKindIsDamagedAndTheNextIsGood) {
  plugModel({});
  const auto camera = stream();
  ASSERT_TRUE(camera);
  const auto next = [&](bool good) {
    for (int i = 0; i < 100; ++i) {
      auto frame = camera->grab(kPatience);
      if (!frame || frame->status.isOk() == good) return frame;
    }
    return Result<RawFrame>(Status(StatusCode::kIoError, "never"));
  };
  ASSERT_TRUE(next(true));
  write(ARV_FAKE_CAMERA_REGISTER_WIDTH, 32);
  auto frame = next(false);
  ASSERT_TRUE(frame) << frame.status().message();
  EXPECT_EQ(frame->status.code(), StatusCode::kInvalidInput) << frame->status.message();
  write(ARV_FAKE_CAMERA_REGISTER_WIDTH, 64);
  ASSERT_TRUE(next(true));
  write(ARV_FAKE_CAMERA_REGISTER_PIXEL_FORMAT, ARV_PIXEL_FORMAT_BAYER_RG_8);
  frame = next(false);
  ASSERT_TRUE(frame) << frame.status().message();
  EXPECT_EQ(frame->status.code(), StatusCode::kUnsupported) << frame->status.message();
  EXPECT_TRUE(frame->bytes->empty());
  write(ARV_FAKE_CAMERA_REGISTER_PIXEL_FORMAT, ARV_PIXEL_FORMAT_MONO_16);
  ASSERT_TRUE(next(true));
}

void stampBackwards(ArvBuffer* buffer, void* count, guint32 /*exposure*/, guint32 /*gain*/,
                    ArvPixelFormat /*format*/) {
  const int i = (*static_cast<std::atomic<int>*>(count))++;
  arv_buffer_set_timestamp(buffer, i == 3 ? 5 : 1'000'000U * static_cast<unsigned>(i));
}

TEST_F(OtherCameraTest, AClockThatRunsBackwardsIsNotBelieved) {
  plugModel({});
  std::atomic<int> count{0};  // the first stamp is 0
  arv_fake_camera_set_fill_pattern(arv_gv_fake_camera_get_fake_camera(camera_.get()),
                                   &stampBackwards, &count);
  auto camera = stream();
  ASSERT_TRUE(camera);
  std::vector<bool> stamped;
  for (int i = 0; i < 6; ++i) {
    const auto frame = camera->grab(kPatience);
    ASSERT_TRUE(frame) << frame.status().message();
    stamped.push_back(frame->device_time.has_value());
  }
  EXPECT_EQ(stamped, (std::vector<bool>{false, true, true, false, false, false}));
  camera.reset();
  camera_.reset();  // before `count` goes
}

}  // namespace
}  // namespace scanner::bumblebee
