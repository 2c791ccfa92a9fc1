#include <gtest/gtest.h>

#include "registration/synthetic.h"
#include "scanner/registration/groups.h"

namespace scanner::registration {
namespace {

using synthetic::kDegree;
using Ids = std::vector<int>;

Eigen::Quaterniond yaw(double deg) { return expSo3(Eigen::Vector3d(0, 0, deg * kDegree)); }

TEST(Groups, SizeComesFromTheFirstViewAndTheCutoff) {
  GroupPlanner planner({});  // 20 deg
  EXPECT_EQ(planner.add(yaw(0)), Ids({}));
  EXPECT_EQ(planner.add(yaw(9)), Ids({0}));
  EXPECT_EQ(planner.groupSize(), 0);
  EXPECT_EQ(planner.add(yaw(18)), Ids({0, 1}));
  EXPECT_EQ(planner.add(yaw(27)), Ids({1, 2}));  // 27 deg from the first: n = 3
  EXPECT_EQ(planner.groupSize(), 3);
  EXPECT_TRUE(planner.isComplete(1, 3));
  EXPECT_FALSE(planner.isComplete(2, 3));
  EXPECT_EQ(planner.add(yaw(36)), Ids({2, 3}));
  // A jump leaves the cutoff of view 3, but view 4's group needs a second member.
  EXPECT_EQ(planner.add(yaw(60)), Ids({4}));
}

TEST(Groups, TwoMembersEvenWhenTheFirstStepLeavesTheCutoff) {
  GroupPlanner planner({});
  planner.add(yaw(0));
  EXPECT_EQ(planner.add(yaw(45)), Ids({0}));
  EXPECT_EQ(planner.groupSize(), 2);
  EXPECT_EQ(planner.add(yaw(46)), Ids({1}));
}

TEST(Groups, AStandingSensorIsBoundedByMaxMembers) {
  GroupPlanner planner({});
  for (int k = 0; k < 30; ++k) EXPECT_LE(planner.add(yaw(0.01 * k)).size(), 7U);
  EXPECT_EQ(planner.groupSize(), 8);
}

TEST(Groups, AggressiveStrideStartsFewerGroups) {
  GroupOptions options;
  options.stride = 3;
  GroupPlanner planner(options);
  for (int k = 0; k < 4; ++k) planner.add(yaw(5.0 * k));
  EXPECT_EQ(planner.add(yaw(20.5)), Ids({1}));  // n = 4: groups of 0..3, 3..6
  EXPECT_EQ(planner.groupSize(), 4);
  EXPECT_TRUE(planner.startsGroup(6));
  EXPECT_FALSE(planner.startsGroup(7));
  EXPECT_EQ(planner.groupStartedBy(6), 2);
  options.stride = 0;
  EXPECT_THROW(GroupPlanner{options}, ConfigurationError);
}

TEST(Groups, SignOfTheQuaternionDoesNotMatter) {
  GroupPlanner planner({});
  planner.add(yaw(0));
  Eigen::Quaterniond q = yaw(5);
  q.coeffs() = -q.coeffs();
  planner.add(q);
  EXPECT_EQ(planner.add(yaw(6)), Ids({0, 1}));
}

}  // namespace
}  // namespace scanner::registration
