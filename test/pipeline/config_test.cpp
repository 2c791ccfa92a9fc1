#include "scanner/pipeline/config.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "support/temporary_folder.h"

namespace scanner::pipeline {
namespace {

TEST(Config, EveryShippedConfigurationLoads) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(SCANNER_SOURCE_DIR "/config")) {
    if (entry.path().extension() != ".yaml") continue;
    EXPECT_NO_THROW(loadConfig(entry.path().string())) << entry.path();
    ++count;
  }
  EXPECT_GE(count, 3);
}

TEST(Config, AnEmptyFileGivesTheDefaults) {
  const test::TemporaryFolder folder;
  std::ofstream(folder / "empty.yaml") << "# nothing\n";
  EXPECT_EQ(dumpOptions(loadConfig(folder / "empty.yaml")), dumpOptions(ScannerConfig{}));
}

TEST(Config, WhatWasUsedCanBeLoadedAgain) {
  const test::TemporaryFolder folder;
  ScannerConfig config = loadConfig(SCANNER_SOURCE_DIR "/config/field.yaml");
  config.scan.seed = 42;
  std::ofstream(folder / "used.yaml") << toYaml(dumpOptions(config));
  EXPECT_EQ(dumpOptions(loadConfig(folder / "used.yaml")), dumpOptions(config));
}

TEST(Config, ErrorsNameFileKeyValueAndBound) {
  const test::TemporaryFolder folder;
  std::ofstream(folder / "bad.yaml") << "scan:\n  model_factor: 0\n";
  try {
    loadConfig(folder / "bad.yaml");
    FAIL() << "model_factor 0 was accepted";
  } catch (const ConfigurationError& error) {
    const std::string text = error.what();
    for (const char* part : {"bad.yaml", "scan.model_factor", "is 0", "1 to 1000"}) {
      EXPECT_NE(text.find(part), std::string::npos) << text;
    }
  }
  std::ofstream(folder / "block.yaml") << "sterio:\n  a: 0\n";
  EXPECT_THROW(loadConfig(folder / "block.yaml"), ConfigurationError);
}

TEST(Config, DocumentationHasEveryBlock) {
  const std::string text = documentConfiguration();
  for (const char* block : {"## `scan`", "## `mti`", "## `bumblebee`", "## `stereo`",
                            "## `inertial`", "## `registration`", "## `surface`"}) {
    EXPECT_NE(text.find(block), std::string::npos) << block;
  }
}

}  // namespace
}  // namespace scanner::pipeline
