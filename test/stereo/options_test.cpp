#include "scanner/stereo/options.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace scanner::stereo {
namespace {

TEST(StereoOptions, PublishedDefaults) {
  const StereoOptions o;
  EXPECT_EQ(o.matcher.block.window_px, 13);
  EXPECT_EQ(o.matcher.block.edge_mask_px, 9);
  EXPECT_EQ(o.matcher.min_disparity_px, 100);
  EXPECT_EQ(o.matcher.max_disparity_px, 330);
  EXPECT_EQ(o.matcher.validation.surface_size_px, 200);
  EXPECT_EQ(o.matcher.validation.surface_step_px, 1.0);
  EXPECT_EQ(o.normals.window_px, 5);
  EXPECT_EQ(o.conditioning.ground_resolution_m, 0.015);
  EXPECT_EQ(o.conditioning.outlier_sigmas, 2.0);
  EXPECT_NO_THROW(validate(o));
}

TEST(StereoOptions, RoundTripThroughTheTree) {
  StereoOptions o;
  o.matcher.method = MatchMethod::kSemiGlobal;
  o.matcher.refinement.subpixel_refinement = SubpixelRefinement::kCostFit;
  o.conditioning.remove_ground = false;
  const ParameterTree tree = dumpOptions(o);
  EXPECT_EQ(tree["matcher"]["method"], "semi_global");
  EXPECT_EQ(tree["conditioning"]["remove_ground"], false);
  StereoOptions loaded;
  loadOptions(tree, "stereo", loaded);
  EXPECT_EQ(dumpOptions(loaded), tree);
  EXPECT_EQ(loaded.matcher.method, MatchMethod::kSemiGlobal);
}

TEST(StereoOptions, WrongOnesAreNamed) {
  const auto message = [](const char* json) -> std::string {
    StereoOptions o;
    try {
      loadOptions(nlohmann::json::parse(json), "stereo", o);
      validate(o);
    } catch (const ConfigurationError& error) {
      return error.what();
    }
    return {};
  };
  EXPECT_NE(message(R"({"matcher":{"block":{"window_px":4}}})").find("stereo.matcher.block.window"),
            std::string::npos);
  EXPECT_NE(message(R"({"matcher":{"block":{"window_px":12}}})").find("odd"), std::string::npos);
  EXPECT_NE(message(R"({"matcher":{"min_disparity_px":400}})").find("min_disparity_px = 400"),
            std::string::npos);
  EXPECT_NE(message(R"({"depth":{"min_depth_m":5,"max_depth_m":4}})").find("stereo.depth"),
            std::string::npos);
  EXPECT_NE(message(R"({"normals":{"min_points":26}})").find("min_points"), std::string::npos);
  EXPECT_FALSE(message(R"({"conditioning":{"grnd":1}})").empty());
  EXPECT_TRUE(message(R"({"matcher":{"method":"semi_global"}})").empty());
}

}  // namespace
}  // namespace scanner::stereo
