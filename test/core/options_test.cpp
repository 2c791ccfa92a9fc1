#include "scanner/core/options.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "support/temporary_folder.h"

namespace scanner::example {

enum class Method { kFast, kGood };
struct Inner {
  double limit_m = 0.003;
};
struct Outer {
  int window_px = 13;
  bool enabled = true;
  std::string name = "left";
  Method method = Method::kGood;
  Inner inner;
};
void describe(OptionVisitor& v, Inner& o) {
  v.option("limit_m", o.limit_m, {0.0, 1.0}, "m", "largest distance");
}
void describe(OptionVisitor& v, Outer& o) {
  v.option("window_px", o.window_px, {3, 51}, "px", "side of the window");
  v.option("enabled", o.enabled, "use it");
  v.option("name", o.name, "which camera");
  v.choice("method", o.method, {{"fast", Method::kFast}, {"good", Method::kGood}}, "how");
  v.group("inner", o.inner, "limits");
}

std::string complaint(const nlohmann::json& tree) {
  Outer options;
  try {
    loadOptions(tree, "outer", options);
  } catch (const ConfigurationError& error) {
    return error.what();
  }
  return "";
}

TEST(Options, LoadsWhatIsNamedAndKeepsTheRest) {
  Outer options;
  loadOptions(nlohmann::json{{"method", "fast"}, {"inner", {{"limit_m", 0}}}}, "outer", options);
  EXPECT_EQ(options.method, Method::kFast);
  EXPECT_EQ(options.inner.limit_m, 0.0);
  EXPECT_EQ(options.window_px, 13);
}

TEST(Options, EmptyTreeKeepsAllDefaults) {
  EXPECT_EQ(complaint(nullptr), "");
  EXPECT_EQ(complaint(nlohmann::json::object()), "");
}

TEST(Options, ComplaintsNameKeyValueAndBound) {
  EXPECT_EQ(complaint({{"window_px", 2}}), "option 'outer.window_px' is 2; expected 3 to 51");
  EXPECT_EQ(complaint({{"window_px", 13.5}}),
            "option 'outer.window_px' is 13.5; expected a whole number");
  EXPECT_EQ(complaint({{"inner", {{"limit_m", 1.5}}}}),
            "option 'outer.inner.limit_m' is 1.5; expected 0 to 1 m");
  EXPECT_EQ(complaint({{"enabled", 1}}), "option 'outer.enabled' is 1; expected true or false");
  EXPECT_EQ(complaint({{"method", "best"}}),
            "option 'outer.method' is \"best\"; expected one of fast, good");
  EXPECT_EQ(complaint({{"inner", 3}}), "option 'outer.inner' is 3; expected a group of options");
}

TEST(Options, UnknownKeysAreRefusedWithAHint) {
  EXPECT_EQ(complaint({{"windw_px", 9}}),
            "unknown option 'outer.windw_px'; did you mean 'outer.window_px'?");
  EXPECT_EQ(complaint({{"inner", {{"zzz", 9}}}}), "unknown option 'outer.inner.zzz'");
}

TEST(Options, NanIsOutOfEveryBound) {
  EXPECT_NE(complaint({{"inner", {{"limit_m", std::nan("")}}}}), "");
}

TEST(Options, DumpLoadsToTheSame) {
  Outer options;
  options.window_px = 21;
  options.method = Method::kFast;
  options.inner.limit_m = 0.25;
  Outer again;
  loadOptions(dumpOptions(options), "outer", again);
  EXPECT_EQ(dumpOptions(again), dumpOptions(options));
  EXPECT_EQ(again.window_px, 21);
}

TEST(Options, DocumentationNamesEveryOption) {
  const std::string text = documentOptions<Outer>("outer");
  for (const char* part : {"`window_px` | 13 | px | 3 to 51 | side of the window",
                           "`inner.limit_m` | 0.003 | m | 0 to 1", "fast, good"}) {
    EXPECT_NE(text.find(part), std::string::npos) << part << "\n" << text;
  }
}

TEST(Yaml, ScalarsKeepTheirTypes) {
  const test::TemporaryFolder folder;
  std::ofstream(folder / "a.yaml")
      << "a: 1\nb: 1.5\nc: true\nd: text\ne: \"7\"\nf: [1, 2]\ng:\n  h: 2\n";
  const ParameterTree tree = readYaml(folder / "a.yaml");
  EXPECT_EQ(tree, (nlohmann::json{{"a", 1},
                                  {"b", 1.5},
                                  {"c", true},
                                  {"d", "text"},
                                  {"e", "7"},
                                  {"f", {1, 2}},
                                  {"g", {{"h", 2}}}}));
  std::ofstream(folder / "b.yaml") << toYaml(tree["g"]);
  EXPECT_EQ(readYaml(folder / "b.yaml"), tree["g"]);
}

TEST(Yaml, ErrorsNameTheFile) {
  const test::TemporaryFolder folder;
  EXPECT_THROW(readYaml(folder / "absent.yaml"), ConfigurationError);
  std::ofstream(folder / "broken.yaml") << "a: [1, 2\nb: 3\n";
  std::ofstream(folder / "twice.yaml") << "a: 1\na: 2\n";
  for (const char* name : {"broken.yaml", "twice.yaml"}) {
    try {
      readYaml(folder / name);
      ADD_FAILURE() << name << " was accepted";
    } catch (const ConfigurationError& error) {
      EXPECT_NE(std::string(error.what()).find(name), std::string::npos) << error.what();
    }
  }
}

}  // namespace scanner::example
