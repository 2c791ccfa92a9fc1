#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

#include "scanner/core/status.h"

/// Options are plain structs with defaults. Each has one function
///
///     void describe(OptionVisitor& v, BlockMatcherOptions& o);
///
/// that names every field once with unit, bounds and meaning. That one description drives loading
/// with validation, rejection of unknown keys, the configuration written into a scan folder and
/// docs/configuration.md.
namespace scanner {

/// Neutral parameter tree: a JSON object per block, filled from a YAML file or the ROS parameter
/// server.
using ParameterTree = nlohmann::json;

/// Closed interval. Bounds::atLeast and friends read well at the place of use.
struct Bounds {
  double min;
  double max;
  static Bounds atLeast(double min);
  static Bounds any();
};

/// Visits the fields of an options struct. Names are snake_case; units "", "m", "px", "deg", "s"
/// ...
class OptionVisitor {
 public:
  virtual ~OptionVisitor() = default;
  virtual void option(const char* name, bool& value, const char* meaning) = 0;
  virtual void option(const char* name, int& value, Bounds bounds, const char* unit,
                      const char* meaning) = 0;
  virtual void option(const char* name, double& value, Bounds bounds, const char* unit,
                      const char* meaning) = 0;
  virtual void option(const char* name, std::string& value, const char* meaning) = 0;

  /// An enum field: `choices` lists every value with its name in the configuration.
  template <typename Enum>
  void choice(const char* name, Enum& value,
              const std::vector<std::pair<std::string, Enum>>& choices, const char* meaning) {
    std::vector<std::string> names;
    std::size_t selected = choices.size();
    for (std::size_t i = 0; i < choices.size(); ++i) {
      names.push_back(choices[i].first);
      if (choices[i].second == value) selected = i;
    }
    value = choices.at(chooseIndex(name, selected, names, meaning)).second;
  }

  /// A nested options struct under `name`. Finds describe() by argument-dependent lookup.
  template <typename Options>
  void group(const char* name, Options& options, const char* meaning) {
    beginGroup(name, meaning);
    describe(*this, options);
    endGroup();
  }

 protected:
  virtual std::size_t chooseIndex(const char* name, std::size_t selected,
                                  const std::vector<std::string>& names, const char* meaning) = 0;
  virtual void beginGroup(const char* name, const char* meaning) = 0;
  virtual void endGroup() = 0;
};

/// Type-erased call of describe() on one struct; made by the templates below.
using DescribeCall = void (*)(OptionVisitor&, void*);

void loadOptions(const ParameterTree& tree, const std::string& path, DescribeCall call,
                 void* options);
void dumpOptions(DescribeCall call, void* options, ParameterTree* tree);
std::string documentOptions(const std::string& title, DescribeCall call, void* options);

/// Overwrites the fields of `options` that `tree` names; keeps the others. Throws
/// ConfigurationError with the full key ("stereo.block.window_px"), the value and the bound for a
/// wrong type, a value out of bounds or not finite, an unknown choice, or an unknown key (with the
/// nearest known key as a hint). `path` is the prefix for messages.
template <typename Options>
void loadOptions(const ParameterTree& tree, const std::string& path, Options& options) {
  loadOptions(
      tree, path, [](OptionVisitor& v, void* o) { describe(v, *static_cast<Options*>(o)); },
      &options);
}

/// All fields as a tree: what was really used. loadOptions(dumpOptions(o)) gives o again. (The
/// second template parameter lets this header do with the forward declaration of the JSON type.)
template <typename Options, typename Tree = ParameterTree>
Tree dumpOptions(Options options) {
  Tree tree;
  dumpOptions([](OptionVisitor& v, void* o) { describe(v, *static_cast<Options*>(o)); }, &options,
              &tree);
  return tree;
}

/// Markdown table of all fields: key, default, unit, bounds, meaning.
template <typename Options>
std::string documentOptions(const std::string& title, Options options = {}) {
  return documentOptions(
      title, [](OptionVisitor& v, void* o) { describe(v, *static_cast<Options*>(o)); }, &options);
}

/// Reads a YAML file into a tree. Throws ConfigurationError naming file and line.
ParameterTree readYaml(const std::string& path);
/// Writes a tree as YAML with keys in order.
std::string toYaml(const ParameterTree& tree);

}  // namespace scanner
