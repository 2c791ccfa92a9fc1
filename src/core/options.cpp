#include "scanner/core/options.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

namespace scanner {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::string formatNumber(double value) {
  // The shortest text that gives the same double again: 0.1, not 0.10000000000000001.
  char text[32];
  for (int digits = 6; digits <= 17; ++digits) {
    std::snprintf(text, sizeof text, "%.*g", digits, value);
    if (std::stod(text) == value) break;
  }
  return text;
}

std::string formatBounds(const Bounds& b) {
  const bool low = std::isfinite(b.min);
  const bool high = std::isfinite(b.max);
  if (low && high) return formatNumber(b.min) + " to " + formatNumber(b.max);
  if (low) return "at least " + formatNumber(b.min);
  if (high) return "at most " + formatNumber(b.max);
  return "any";
}

std::string join(const std::vector<std::string>& parts, const char* separator) {
  std::string out;
  for (const std::string& part : parts) out += (out.empty() ? "" : separator) + part;
  return out;
}

std::size_t editDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substituted = diagonal + (a[i - 1] == b[j - 1] ? 0U : 1U);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substituted});
    }
  }
  return row[b.size()];
}

/// Reads values out of a tree; complains with the full key.
class Loader : public OptionVisitor {
 public:
  Loader(const ParameterTree& tree, const std::string& path) { open(tree, path); }
  ~Loader() override = default;

  void option(const char* name, bool& value, const char*) override {
    const ParameterTree* node = take(name);
    if (node == nullptr) return;
    if (!node->is_boolean()) fail(name, *node, "true or false");
    value = node->get<bool>();
  }

  void option(const char* name, int& value, Bounds bounds, const char*, const char*) override {
    const ParameterTree* node = take(name);
    if (node == nullptr) return;
    if (!node->is_number_integer()) fail(name, *node, "a whole number");
    const auto wide = node->get<std::int64_t>();
    const auto number = static_cast<double>(wide);
    if (number < bounds.min || number > bounds.max ||
        std::abs(number) > std::numeric_limits<int>::max()) {
      fail(name, *node, formatBounds(bounds));
    }
    value = static_cast<int>(wide);
  }

  void option(const char* name, double& value, Bounds bounds, const char* unit,
              const char*) override {
    const ParameterTree* node = take(name);
    if (node == nullptr) return;
    const std::string suffix = *unit != '\0' ? std::string(" ") + unit : std::string();
    if (!node->is_number()) fail(name, *node, "a number");
    const auto number = node->get<double>();
    if (!std::isfinite(number) || number < bounds.min || number > bounds.max) {
      fail(name, *node, formatBounds(bounds) + suffix);
    }
    value = number;
  }

  void option(const char* name, std::string& value, const char*) override {
    const ParameterTree* node = take(name);
    if (node == nullptr) return;
    if (!node->is_string()) fail(name, *node, "a text");
    value = node->get<std::string>();
  }

  void rejectUnknown() const {
    const Level& level = levels_.back();
    if (level.tree == nullptr) return;
    for (const auto& item : level.tree->items()) {
      if (std::find(level.known.begin(), level.known.end(), item.key()) != level.known.end()) {
        continue;
      }
      std::string message = "unknown option '" + level.path + item.key() + "'";
      const std::string hint = nearest(item.key(), level.known);
      if (!hint.empty()) message += "; did you mean '" + level.path + hint + "'?";
      throw ConfigurationError(message);
    }
  }

 protected:
  std::size_t chooseIndex(const char* name, std::size_t selected,
                          const std::vector<std::string>& names, const char*) override {
    const ParameterTree* node = take(name);
    if (node == nullptr) return selected;
    const std::string expected = "one of " + join(names, ", ");
    if (!node->is_string()) fail(name, *node, expected);
    const auto found = std::find(names.begin(), names.end(), node->get<std::string>());
    if (found == names.end()) fail(name, *node, expected);
    return static_cast<std::size_t>(found - names.begin());
  }

  void beginGroup(const char* name, const char*) override {
    const std::string path = levels_.back().path + name;
    const ParameterTree* node = take(name);
    if (node == nullptr) {
      levels_.push_back({nullptr, path + ".", {}});
    } else {
      open(*node, path);
    }
  }

  void endGroup() override {
    rejectUnknown();
    levels_.pop_back();
  }

 private:
  struct Level {
    const ParameterTree* tree;  ///< null: the group is absent, all defaults stay
    std::string path;
    std::vector<std::string> known;
  };

  void open(const ParameterTree& tree, const std::string& path) {
    if (!tree.is_object() && !tree.is_null()) {
      throw ConfigurationError("option '" + path + "' is " + tree.dump() +
                               "; expected a group of options");
    }
    levels_.push_back({tree.is_null() ? nullptr : &tree, path.empty() ? "" : path + ".", {}});
  }

  const ParameterTree* take(const char* name) {
    Level& level = levels_.back();
    level.known.emplace_back(name);
    if (level.tree == nullptr) return nullptr;
    const auto found = level.tree->find(name);
    return found == level.tree->end() ? nullptr : &*found;
  }

  [[noreturn]] void fail(const char* name, const ParameterTree& node,
                         const std::string& expected) const {
    throw ConfigurationError("option '" + levels_.back().path + name + "' is " + node.dump() +
                             "; expected " + expected);
  }

  static std::string nearest(const std::string& key, const std::vector<std::string>& known) {
    std::string best;
    std::size_t best_distance = key.size() / 2 + 1;
    for (const std::string& candidate : known) {
      const std::size_t distance = editDistance(key, candidate);
      if (distance < best_distance) {
        best_distance = distance;
        best = candidate;
      }
    }
    return best;
  }

  std::vector<Level> levels_;
};

/// Writes values into a tree.
class Dumper : public OptionVisitor {
 public:
  Dumper() : levels_{nlohmann::json::object()} {}

  void option(const char* name, bool& value, const char*) override { levels_.back()[name] = value; }
  void option(const char* name, int& value, Bounds, const char*, const char*) override {
    levels_.back()[name] = value;
  }
  void option(const char* name, double& value, Bounds, const char*, const char*) override {
    levels_.back()[name] = value;
  }
  void option(const char* name, std::string& value, const char*) override {
    levels_.back()[name] = value;
  }
  const ParameterTree& tree() const { return levels_.back(); }

 protected:
  std::size_t chooseIndex(const char* name, std::size_t selected,
                          const std::vector<std::string>& names, const char*) override {
    levels_.back()[name] = names.at(selected);
    return selected;
  }
  void beginGroup(const char* name, const char*) override {
    names_.emplace_back(name);
    levels_.push_back(nlohmann::json::object());
  }
  void endGroup() override {
    const ParameterTree group = levels_.back();
    levels_.pop_back();
    levels_.back()[names_.back()] = group;
    names_.pop_back();
  }

 private:
  std::vector<ParameterTree> levels_;
  std::vector<std::string> names_;
};

/// Writes one Markdown table row per option.
class Documenter : public OptionVisitor {
 public:
  explicit Documenter(const std::string& title) {
    out_ << "## `" << title << "`\n\n| option | default | unit | allowed | meaning |\n"
         << "|---|---|---|---|---|\n";
  }

  void option(const char* name, bool& value, const char* meaning) override {
    row(name, value ? "true" : "false", "", "true or false", meaning);
  }
  void option(const char* name, int& value, Bounds bounds, const char* unit,
              const char* meaning) override {
    row(name, std::to_string(value), unit, formatBounds(bounds), meaning);
  }
  void option(const char* name, double& value, Bounds bounds, const char* unit,
              const char* meaning) override {
    row(name, formatNumber(value), unit, formatBounds(bounds), meaning);
  }
  void option(const char* name, std::string& value, const char* meaning) override {
    row(name, value.empty() ? "(empty)" : value, "", "text", meaning);
  }
  std::string text() const { return out_.str(); }

 protected:
  std::size_t chooseIndex(const char* name, std::size_t selected,
                          const std::vector<std::string>& names, const char* meaning) override {
    row(name, names.at(selected), "", join(names, ", "), meaning);
    return selected;
  }
  void beginGroup(const char* name, const char* meaning) override {
    out_ << "| **`" << prefix() << name << "`** | | | | *" << meaning << "* |\n";
    groups_.emplace_back(name);
  }
  void endGroup() override { groups_.pop_back(); }

 private:
  std::string prefix() const {
    std::string text;
    for (const std::string& group : groups_) text += group + ".";
    return text;
  }
  void row(const char* name, const std::string& value, const char* unit, const std::string& allowed,
           const char* meaning) {
    out_ << "| `" << prefix() << name << "` | " << value << " | " << unit << " | " << allowed
         << " | " << meaning << " |\n";
  }

  std::ostringstream out_;
  std::vector<std::string> groups_;
};

}  // namespace

Bounds Bounds::atLeast(double min) { return {min, kInfinity}; }
Bounds Bounds::any() { return {-kInfinity, kInfinity}; }

void loadOptions(const ParameterTree& tree, const std::string& path, DescribeCall call,
                 void* options) {
  Loader loader(tree, path);
  call(loader, options);
  loader.rejectUnknown();
}

void dumpOptions(DescribeCall call, void* options, ParameterTree* tree) {
  Dumper dumper;
  call(dumper, options);
  *tree = dumper.tree();
}

std::string documentOptions(const std::string& title, DescribeCall call, void* options) {
  Documenter documenter(title);
  call(documenter, options);
  return documenter.text();
}

}  // namespace scanner
