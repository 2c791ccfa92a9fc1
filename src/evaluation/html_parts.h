#pragma once

#include <string>

#include "evaluation/html_data.h"

/// The parts of report.html. Each is empty when the folder has nothing for it.
namespace scanner::evaluation::html {

// html_verdict.cpp
std::string verdict(const FolderData& data);
std::string keyFigures(const FolderData& data);
std::string accuracy(const FolderData& data);
std::string troubles(const FolderData& data);

// html_pictures.cpp
struct ModelPictures {
  Picture hero;
  std::vector<Picture> sides;
};
/// Renders model.ply; empty without a model.
ModelPictures renderModel(const FolderData& data);
std::string figure(const Picture& picture);
std::string figures(const std::vector<Picture>& pictures);

// html_plots.cpp
std::string plots(const FolderData& data);

// html_tables.cpp
std::string scanTables(const FolderData& data);       ///< views, trials, groups of settings
std::string motionTables(const FolderData& data);     ///< tables 5.2 to 5.6
std::string samplingTables(const FolderData& data);   ///< tables 4.2 and 4.3
std::string deviationTables(const FolderData& data);  ///< tables 5.7 and 5.8
std::string runTables(const FolderData& data);        ///< times, memory, model

}  // namespace scanner::evaluation::html
