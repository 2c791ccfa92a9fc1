#include "scanner/ros/parameters.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

// The parameter server itself is in node_parameters.test.
namespace scanner::bridge {
namespace {

TEST(Parameters, EveryTypeOfTheServerBecomesTheSameTypeInTheTree) {
  XmlRpc::XmlRpcValue value;
  value["flag"] = true;
  value["count"] = 3;
  value["length"] = 0.25;
  value["name"] = "text";
  value["list"][0] = 1;
  value["list"][1] = 2.5;
  value["block"]["inner"] = 7;
  const ParameterTree tree = toTree(value);
  EXPECT_EQ(tree, ParameterTree::parse(R"({"flag": true, "count": 3, "length": 0.25,
      "name": "text", "list": [1, 2.5], "block": {"inner": 7}})"));
  EXPECT_TRUE(tree["count"].is_number_integer());
  EXPECT_TRUE(tree["length"].is_number_float());
}

TEST(Parameters, BinaryIsRefused) {
  char bytes[] = {1, 2, 3};
  XmlRpc::XmlRpcValue value;
  value["data"] = XmlRpc::XmlRpcValue(bytes, 3);
  EXPECT_THROW(toTree(value), ConfigurationError);
}

}  // namespace
}  // namespace scanner::bridge
