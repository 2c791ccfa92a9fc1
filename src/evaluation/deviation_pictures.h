#pragma once

#include <opencv2/core.hpp>

#include "scanner/evaluation/deviation_report.h"

namespace scanner::evaluation {

/// The smallest readable range (1, 2, 3 or 5 times a power of ten) that holds the 95th percentile.
double readableRange(const DeviationStatistics& statistics);

/// Bar of the colours from -range_m (below) to +range_m (above) with labels in mm. CV_8UC3.
cv::Mat drawLegend(double range_m, int width, int height);

/// The coloured model from four sides, framed as the reference (z up, same frame), with a legend.
cv::Mat drawDeviation(const Mesh& colored_in_reference, const Mesh& reference,
                      const DeviationReport& report);

/// How often which deviation occurs; the first and last bars hold what is beyond the range.
cv::Mat drawHistogram(const DeviationReport& report);

}  // namespace scanner::evaluation
