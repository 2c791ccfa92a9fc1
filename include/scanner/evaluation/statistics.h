#pragma once

#include <cstddef>
#include <limits>
#include <vector>

namespace scanner::evaluation {

/// Summary of a column, as under the tables of the thesis (chapter 5). NaN throughout, with count
/// 0, when there is nothing to summarise; reports write that as null.
struct Statistics {
  double median = std::numeric_limits<double>::quiet_NaN();
  double mean = std::numeric_limits<double>::quiet_NaN();
  double sigma = std::numeric_limits<double>::quiet_NaN();  ///< n - 1 in the denominator
  double min = std::numeric_limits<double>::quiet_NaN();
  double max = std::numeric_limits<double>::quiet_NaN();
  std::size_t count = 0;
};

/// Statistics of the finite samples; `count` says how many those are. The median of an even number
/// of samples is the mean of the middle two; sigma of a single sample is 0.
Statistics summarize(const std::vector<double>& samples);

}  // namespace scanner::evaluation
