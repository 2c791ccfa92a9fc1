#include <cmath>

#include "scanner/core/parallel.h"
#include "scanner/pipeline/report_builder.h"
#include "scanner/registration/correspondence.h"
#include "scanner/registration/sampling.h"

namespace scanner::pipeline {
namespace {

using evaluation::ReportCompatible;
using evaluation::ReportSampling;

constexpr double kBuckets_deg[] = {1.0, 5.0, 10.0, 15.0, 20.0};
constexpr double kCutoffs_deg[] = {5.0, 15.0, 30.0, 45.0, 60.0};
constexpr double kDegree = M_PI / 180.0;

std::vector<const registration::RegisteredView*> registeredOf(
    const std::vector<registration::RegisteredView>& views) {
  std::vector<const registration::RegisteredView*> registered;
  for (const registration::RegisteredView& view : views) {
    if (view.registered && view.view->cloud.hasNormals()) registered.push_back(&view);
  }
  return registered;
}

/// Turns the mean normal to +y: the hemisphere about it is 0 <= theta < 180 deg of the spherical
/// angles, away from their poles.
Eigen::Matrix3f aboutMeanNormal(const std::vector<Eigen::Vector3f>& normals) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3f& normal : normals) mean += normal.cast<double>();
  return Eigen::Quaterniond::FromTwoVectors(mean, Eigen::Vector3d::UnitY())
      .toRotationMatrix()
      .cast<float>();
}

ReportSampling bucketsOf(const std::vector<Eigen::Vector3f>& normals, const Eigen::Matrix3f& turn,
                         double bucket_deg) {
  const registration::NormalBuckets buckets(bucket_deg * kDegree);
  std::vector<std::size_t> population(buckets.count());
  for (const Eigen::Vector3f& normal : normals) {
    const Eigen::Vector3f turned = turn * normal;
    if (turned.y() >= 0.0F) ++population[buckets.of(turned)];
  }
  const std::size_t total = buckets.count() / 2;  // of the hemisphere
  double occupied = 0.0, sum = 0.0, squares = 0.0;
  for (const std::size_t count : population) {
    if (count == 0) continue;
    const auto n = static_cast<double>(count);
    occupied += 1.0;
    sum += n;
    squares += n * n;
  }
  const double mean = sum / occupied;
  return {bucket_deg, static_cast<double>(total), static_cast<double>(total) - occupied, mean,
          std::sqrt(std::max(0.0, squares / occupied - mean * mean))};
}

std::vector<Eigen::Vector3f> sampledNormals(const registration::RegisteredView& view,
                                            const registration::SamplingOptions& options) {
  constexpr std::uint64_t kSeed = 1;
  std::vector<Eigen::Vector3f> normals =
      registration::sampleCloud(view.view->cloud, options.moving_method, options.moving_factor,
                                options, kSeed)
          .normals;
  const Eigen::Matrix3f R_map_base = view.T_map_base.linear().cast<float>();
  for (Eigen::Vector3f& normal : normals) normal = R_map_base * normal;
  return normals;
}

/// Mean number of normals in `reference` that are compatible with one of `moving`.
double meanCompatible(const std::vector<Eigen::Vector3f>& moving,
                      const std::vector<Eigen::Vector3f>& reference,
                      const registration::CorrespondenceOptions& options) {
  // So many samples per view settle the mean; all of them would take a minute.
  constexpr std::size_t kEnough = 200;
  const std::size_t step = std::max<std::size_t>(1, moving.size() / kEnough);
  std::size_t asked = 0, found = 0;
  for (std::size_t i = 0; i < moving.size(); i += step) {
    ++asked;
    for (const Eigen::Vector3f& normal : reference) {
      found += registration::compatible(moving[i], normal, options) ? 1 : 0;
    }
  }
  return static_cast<double>(found) / static_cast<double>(asked);
}

}  // namespace

std::vector<ReportSampling> samplingTable(const std::vector<registration::RegisteredView>& views,
                                          int threads) {
  const auto registered = registeredOf(views);
  std::vector<ReportSampling> table;
  if (registered.empty()) return table;
  for (const double bucket_deg : kBuckets_deg) {
    std::vector<ReportSampling> rows(registered.size());
    parallelFor(rows.size(), 1, threads, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const auto& normals = registered[i]->view->cloud.normals;
        rows[i] = bucketsOf(normals, aboutMeanNormal(normals), bucket_deg);
      }
    });
    ReportSampling mean{bucket_deg, rows.front().buckets, 0.0, 0.0, 0.0};
    const auto n = static_cast<double>(rows.size());
    for (const ReportSampling& row : rows) {
      mean.empty += row.empty / n;
      mean.per_bucket += row.per_bucket / n;
      mean.per_bucket_sigma += row.per_bucket_sigma / n;
    }
    table.push_back(mean);
  }
  return table;
}

std::vector<ReportCompatible> compatibleTable(
    const std::vector<registration::RegisteredView>& views,
    const registration::RegistrationOptions& options, int threads) {
  const auto registered = registeredOf(views);
  std::vector<ReportCompatible> table;
  if (registered.size() < 2) return table;
  std::vector<std::vector<Eigen::Vector3f>> normals(registered.size());
  const auto inParallel = [threads](std::size_t n, const std::function<void(std::size_t)>& body) {
    parallelFor(n, 1, threads, [&body](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) body(i);
    });
  };
  inParallel(normals.size(),
             [&](std::size_t i) { normals[i] = sampledNormals(*registered[i], options.sampling); });
  for (const double angle_deg : kCutoffs_deg) {
    registration::CorrespondenceOptions cutoff = options.correspondence;
    cutoff.compatible_angle_deg = angle_deg;
    std::vector<double> counts(normals.size() - 1);
    inParallel(counts.size(), [&](std::size_t i) {
      counts[i] = meanCompatible(normals[i + 1], normals[i], cutoff);
    });
    ReportCompatible mean{angle_deg, 0.0, 0.0};
    const auto n = static_cast<double>(counts.size());
    for (std::size_t i = 0; i < counts.size(); ++i) {
      mean.points += counts[i] / n;
      mean.share += counts[i] / static_cast<double>(normals[i].size()) / n;
    }
    table.push_back(mean);
  }
  return table;
}

}  // namespace scanner::pipeline
