#pragma once

#include <string>

#include "scanner/core/status.h"

namespace scanner::evaluation {

/// Makes `folder`/report.html, one file that needs no network: summary, pictures of the model,
/// plots and every table of the thesis that the scan folder has figures for. Reads report.json,
/// trajectory.tum, config.yaml, model.ply and, when there, deviation.json and the pictures in
/// pictures/. Same folder, same bytes.
Status writeHtmlReport(const std::string& folder);

}  // namespace scanner::evaluation
