#include "scanner/evaluation/statistics.h"

#include <algorithm>
#include <cmath>

namespace scanner::evaluation {

Statistics summarize(const std::vector<double>& samples) {
  std::vector<double> x;
  x.reserve(samples.size());
  for (const double s : samples) {
    if (std::isfinite(s)) x.push_back(s);
  }
  Statistics out;
  out.count = x.size();
  if (x.empty()) return out;
  // Sorted sums: the result does not depend on the order of the samples.
  std::sort(x.begin(), x.end());
  const std::size_t middle = x.size() / 2;
  out.median = x.size() % 2 == 1 ? x[middle] : 0.5 * (x[middle - 1] + x[middle]);
  out.min = x.front();
  out.max = x.back();
  const double n = static_cast<double>(x.size());
  double sum = 0.0;
  for (const double v : x) sum += v;
  out.mean = sum / n;
  double squares = 0.0;
  for (const double v : x) squares += (v - out.mean) * (v - out.mean);
  out.sigma = x.size() > 1 ? std::sqrt(squares / (n - 1.0)) : 0.0;
  return out;
}

}  // namespace scanner::evaluation
