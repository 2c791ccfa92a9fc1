#include <gtest/gtest.h>

#include <limits>

#include "registration/synthetic.h"
#include "scanner/registration/registrar.h"

namespace scanner::registration {
namespace {

using synthetic::kDegree;
using synthetic::Orbit;

const Orbit& orbit() {
  static const Orbit instance = synthetic::makeOrbit(40, 96, 72, 0.0005);
  return instance;
}

struct Errors {
  double max_m = 0.0;
  double max_deg = 0.0;
};

Errors errorsOf(const Registrar& registrar, const Orbit& o) {
  Errors errors;
  for (std::size_t k = 0; k < registrar.views().size(); ++k) {
    const RegisteredView& v = registrar.views()[k];
    if (!v.registered) continue;
    const Eigen::Isometry3d E = o.truth[k].inverse() * v.T_map_base;
    errors.max_m = std::max(errors.max_m, E.translation().norm());
    errors.max_deg = std::max(errors.max_deg, rotationAngle(E) / kDegree);
  }
  return errors;
}

Registrar makeRegistrar(const RegistrationOptions& options, int threads, const Orbit& o) {
  Registrar registrar(options, threads, 1);
  registrar.setFirstPose(o.truth.front());
  return registrar;
}

void addAll(Registrar& registrar, const Orbit& o) {
  for (std::size_t k = 0; k < o.views.size(); ++k) registrar.add(o.views[k], o.priors[k]);
}

TEST(RegistrarOrbit, FieldSettingsPlaceEveryViewLiveAndCloseTheLoop) {
  Registrar registrar = makeRegistrar(synthetic::fieldOptions(), 2, orbit());
  for (std::size_t k = 0; k < orbit().views.size(); ++k) {
    const ViewOutcome outcome = registrar.add(orbit().views[k], orbit().priors[k]);
    ASSERT_TRUE(outcome.registered) << "view " << k << ": " << outcome.status.message();
    EXPECT_EQ(outcome.trial == 0, k == 0);
  }
  const Errors live = errorsOf(registrar, orbit());
  EXPECT_LT(live.max_m, 0.02);
  const GlobalOutcome global = registrar.finish();
  EXPECT_TRUE(global.status) << global.status.message();
  EXPECT_EQ(global.registered, orbit().views.size());
  EXPECT_TRUE(global.loop.closed);
  EXPECT_GT(global.loop.to - global.loop.from, 30);
  const Errors final = errorsOf(registrar, orbit());
  EXPECT_LT(final.max_m, 0.0015);
  EXPECT_LT(final.max_deg, 0.15);
  EXPECT_LE(global.refinement.final_rms_m, global.refinement.initial_rms_m * 1.05);
  std::cout << "live " << live.max_m * 1e3 << " mm " << live.max_deg << " deg; final "
            << final.max_m * 1e3 << " mm " << final.max_deg << " deg; loop residual "
            << global.loop.residual_m * 1e3 << " mm, loops " << global.loop.accepted << " of "
            << global.loop.candidates << ", global " << global.seconds << " s\n";
}

TEST(RegistrarOrbit, ThePublishedMethodPlacesTheViews) {
  RegistrationOptions options;  // thesis, but for the sparser views of this test
  options.sampling.moving_factor = 4.0;
  options.sampling.reference_factor = 2.0;
  options.icp.accept_mean_m = 0.006;
  Registrar registrar = makeRegistrar(options, 2, orbit());
  addAll(registrar, orbit());
  const GlobalOutcome global = registrar.finish();
  std::size_t without_reason = 0;
  for (const RegisteredView& v : registrar.views()) {
    without_reason += !v.registered && v.discard_reason.empty() ? 1 : 0;
  }
  EXPECT_EQ(without_reason, 0U);
  EXPECT_GE(global.registered, 30U);
  const auto total = registrar.trials().total();
  std::size_t sum = 0;
  for (std::size_t s = 1; s <= 8; ++s) sum += total[s];
  EXPECT_GE(sum, registrar.views().size() - 1);
  std::cout << "thesis: " << global.registered << " views, max "
            << errorsOf(registrar, orbit()).max_m * 1e3 << " mm; steps";
  for (std::size_t s = 1; s <= 8; ++s) std::cout << " " << total[s];
  std::cout << "\n";
}

TEST(RegistrarOrbit, SameBytesForEveryThreadCount) {
  Orbit part = orbit();
  part.views.resize(10);
  part.priors.resize(10);
  Registrar one = makeRegistrar(synthetic::fieldOptions(), 1, part);
  Registrar two = makeRegistrar(synthetic::fieldOptions(), 2, part);
  addAll(one, part);
  addAll(two, part);
  one.finish();
  two.finish();
  for (std::size_t k = 0; k < part.views.size(); ++k) {
    EXPECT_EQ(one.views()[k].T_map_base.matrix(), two.views()[k].T_map_base.matrix()) << k;
  }
}

TEST(RegistrarOrbit, GoesOnAfterFinish) {
  Orbit part = orbit();
  part.views.resize(12);
  part.priors.resize(12);
  Registrar through = makeRegistrar(synthetic::fieldOptions(), 2, part);
  addAll(through, part);
  through.finish();
  Registrar halting = makeRegistrar(synthetic::fieldOptions(), 2, part);
  for (std::size_t k = 0; k < part.views.size(); ++k) {
    halting.add(part.views[k], part.priors[k]);
    if (k == 6) halting.finish();
  }
  halting.finish();
  EXPECT_EQ(halting.groups().size(), through.groups().size());
  EXPECT_EQ(halting.trials().total(), through.trials().total());
  for (std::size_t k = 0; k < part.views.size(); ++k) {
    EXPECT_TRUE(halting.views()[k].registered);
    EXPECT_TRUE(halting.views()[k].T_map_base.isApprox(through.views()[k].T_map_base, 1e-4)) << k;
  }
}

TEST(Registrar, UnusableViewsAreDiscardedWithAReasonAndTheScanGoesOn) {
  Orbit part = orbit();
  part.views.resize(8);
  part.priors.resize(8);
  auto broken = std::make_shared<View>(*part.views[3]);
  broken->cloud.points[5].x() = std::numeric_limits<float>::quiet_NaN();
  part.views[3] = broken;
  part.views[4] = std::make_shared<View>();
  Registrar registrar = makeRegistrar(synthetic::fieldOptions(), 2, part);
  std::vector<ViewOutcome> outcomes;
  for (std::size_t k = 0; k < 8; ++k) {
    outcomes.push_back(registrar.add(part.views[k], part.priors[k]));
  }
  EXPECT_EQ(outcomes[3].status.code(), StatusCode::kInvalidInput);
  EXPECT_EQ(outcomes[4].status.code(), StatusCode::kNotEnoughData);
  const GlobalOutcome global = registrar.finish();
  EXPECT_EQ(global.discarded, 2U);
  EXPECT_FALSE(registrar.views()[3].discard_reason.empty());
  EXPECT_FALSE(registrar.views()[4].discard_reason.empty());
  EXPECT_TRUE(registrar.views()[5].registered);
  EXPECT_EQ(registrar.views()[5].previous_registered, 2);
  EXPECT_LT(errorsOf(registrar, part).max_m, 0.003);
}

TEST(Registrar, AForeignViewIsDiscardedNotForcedIn) {
  Orbit part = orbit();
  part.views.resize(8);
  part.priors.resize(8);
  auto foreign = std::make_shared<View>(*part.views[4]);
  synthetic::Random random(3);
  for (auto& p : foreign->cloud.points) p = (0.5 * random.direction()).cast<float>();
  for (auto& n : foreign->cloud.normals) n = random.direction().cast<float>();
  part.views[4] = foreign;
  Registrar registrar = makeRegistrar(synthetic::fieldOptions(), 2, part);
  addAll(registrar, part);
  registrar.finish();
  EXPECT_FALSE(registrar.views()[4].registered);
  EXPECT_NE(registrar.views()[4].discard_reason.find("all trials failed"), std::string::npos);
  EXPECT_TRUE(registrar.views()[5].registered);
  EXPECT_TRUE(registrar.views()[7].registered);
  EXPECT_GE(registrar.trials().total()[8], 1U);
  EXPECT_LT(errorsOf(registrar, part).max_m, 0.003);
}

TEST(Registrar, DiscardLastTakesAViewBack) {
  Orbit part = orbit();
  Registrar registrar = makeRegistrar(synthetic::fieldOptions(), 2, part);
  EXPECT_FALSE(registrar.discardLast());
  for (std::size_t k = 0; k < 5; ++k) registrar.add(part.views[k], part.priors[k]);
  EXPECT_TRUE(registrar.discardLast());
  EXPECT_FALSE(registrar.views()[4].registered);
  for (std::size_t k = 5; k < 7; ++k) {
    EXPECT_TRUE(registrar.add(part.views[k], part.priors[k]).registered);
  }
  EXPECT_EQ(registrar.finish().registered, 6U);
}

TEST(Registrar, BrokenContractsThrow) {
  EXPECT_THROW(Registrar({}, 0, 1), ConfigurationError);
  RegistrationOptions bad;
  bad.icp.accept_mean_m = -1.0;
  EXPECT_THROW(Registrar(bad, 1, 1), ConfigurationError);
  Registrar registrar({}, 1, 1);
  EXPECT_THROW(registrar.add(nullptr, Eigen::Isometry3d::Identity()), ConfigurationError);
  const GlobalOutcome nothing = registrar.finish();
  EXPECT_EQ(nothing.status.code(), StatusCode::kNotEnoughData);
  registrar.add(orbit().views[0], orbit().priors[0]);
  EXPECT_THROW(registrar.setFirstPose(Eigen::Isometry3d::Identity()), ConfigurationError);
}

TEST(PoseGraph, SpreadsTheErrorOfALoopAndDropsAFalseOne) {
  synthetic::Random random(4);
  std::vector<Eigen::Isometry3d> truth;
  for (int k = 0; k < 20; ++k) truth.push_back(random.motion(0.3 * k, 0.1 * k));
  std::vector<PoseGraphEdge> edges;
  const Matrix6 information = Matrix6::Identity() * 1e6;
  std::vector<Eigen::Isometry3d> poses = {truth[0]};
  for (int k = 0; k + 1 < 20; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const Eigen::Isometry3d T = truth[i].inverse() * truth[i + 1] * random.motion(0.002, 0.002);
    edges.push_back({k, k + 1, T, information, false});
    poses.push_back(poses.back() * T);
  }
  edges.push_back({0, 19, truth[0].inverse() * truth[19], information, true});
  edges.push_back({2, 15, random.motion(1.0, 1.0), information, true});
  const double before = (poses[19].inverse() * truth[19]).translation().norm();
  const auto summary = optimizePoseGraph(edges, 0, 5.0, poses);
  ASSERT_TRUE(summary) << summary.status().message();
  EXPECT_EQ(poses[0].matrix(), truth[0].matrix());
  ASSERT_EQ(summary->dropped.size(), 1U);
  EXPECT_EQ(summary->dropped[0], edges.size() - 1);
  EXPECT_LT((poses[19].inverse() * truth[19]).translation().norm(), 0.3 * before);
  edges.push_back({0, 99, truth[0], information, false});
  EXPECT_EQ(optimizePoseGraph(edges, 0, 5.0, poses).status().code(), StatusCode::kInvalidInput);
}

}  // namespace
}  // namespace scanner::registration
