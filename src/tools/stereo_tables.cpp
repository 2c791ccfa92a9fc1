#include "tools/stereo_tables.h"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

namespace scanner::tools {
namespace {

using evaluation::RegionMeasures;
constexpr std::size_t kOnePixel = 1;
constexpr std::size_t kNonocc = 0, kAll = 1, kDisc = 2;

__attribute__((format(printf, 1, 2))) std::string format(const char* pattern, ...) {
  std::array<char, 512> text{};
  va_list arguments;
  va_start(arguments, pattern);
  std::vsnprintf(text.data(), text.size(), pattern, arguments);
  va_end(arguments);
  return text.data();
}

/// Share as a percentage of fixed width, or a dash.
std::string percent(double share) {
  return std::isnan(share) ? std::string("     -") : format("%6.2f", 100.0 * share);
}
std::string pixels(double value) {
  return std::isnan(value) ? std::string("    -") : format("%5.3f", value);
}

std::string thresholds(const evaluation::BadShares& shares) {
  std::string text;
  for (const double share : shares) text += percent(share) + " ";
  return text;
}

constexpr const char* kShortHead =
    "                   density  bad 1.0 px, %      filled, bad 1.0 px, %    inliers  |error|\n"
    "  method              all %   valid invalid+   nonocc    all   disc    rms px   median      "
    "ms "
    "  Mdisp/s\n";

std::string shortRow(const MethodResult& m) {
  const RegionMeasures& all = m.regions[kAll];
  return format("  %-17s  %s  %s  %s    %s %s %s     %s    %s  %6.1f  %8.0f\n", m.method.c_str(),
                percent(all.density).c_str(), percent(all.bad_valid[kOnePixel]).c_str(),
                percent(all.bad_all[kOnePixel]).c_str(),
                percent(m.regions[kNonocc].bad_filled[kOnePixel]).c_str(),
                percent(all.bad_filled[kOnePixel]).c_str(),
                percent(m.regions[kDisc].bad_filled[kOnePixel]).c_str(),
                pixels(all.inlier_rms_px).c_str(), pixels(all.median_px).c_str(), 1e3 * m.seconds,
                m.million_per_second);
}

constexpr const char* kFullHead =
    "                            density  bad of the valid, %           invalid counted bad, %     "
    " "
    "  filled, %                    inliers  |error|\n"
    "  method             region        %     0.5    1.0    2.0    4.0      0.5    1.0    2.0    "
    "4.0"
    "      0.5    1.0    2.0    4.0   rms px   median\n";

std::string fullRows(const MethodResult& m) {
  std::string text;
  for (std::size_t r = 0; r < kRegions.size(); ++r) {
    const RegionMeasures& in = m.regions[r];
    text += format("  %-17s  %-6s  %s  %s  %s  %s  %s    %s\n", m.method.c_str(), kRegions[r],
                   percent(in.density).c_str(), thresholds(in.bad_valid).c_str(),
                   thresholds(in.bad_all).c_str(), thresholds(in.bad_filled).c_str(),
                   pixels(in.inlier_rms_px).c_str(), pixels(in.median_px).c_str());
  }
  return text;
}

using Selection = std::function<bool(const SceneResult&)>;

/// Mean over the chosen scenes of one method of each.
MethodResult average(const std::vector<SceneResult>& scenes, const Selection& chosen,
                     std::size_t method) {
  MethodResult out;
  out.method = scenes.front().methods[method].method;
  std::array<std::vector<RegionMeasures>, kRegions.size()> measures;
  double cells = 0.0;
  for (const SceneResult& scene : scenes) {
    if (!chosen(scene)) continue;
    const MethodResult& one = scene.methods[method];
    for (std::size_t r = 0; r < kRegions.size(); ++r) measures[r].push_back(one.regions[r]);
    out.seconds += one.seconds;
    cells += one.million_per_second * one.seconds;
  }
  out.million_per_second = out.seconds > 0.0 ? cells / out.seconds : 0.0;
  out.seconds /= static_cast<double>(measures[0].size());
  for (std::size_t r = 0; r < kRegions.size(); ++r) {
    out.regions[r] = evaluation::meanMeasures(measures[r]);
  }
  return out;
}

std::string averageTable(const std::vector<SceneResult>& scenes, const std::string& title,
                         const Selection& chosen) {
  std::vector<MethodResult> means;
  for (std::size_t m = 0; m < scenes.front().methods.size(); ++m) {
    means.push_back(average(scenes, chosen, m));
  }
  std::string text = "\nAverage of " + title + "\n" + kShortHead;
  for (const MethodResult& mean : means) text += shortRow(mean);
  text += kFullHead;
  for (const MethodResult& mean : means) text += fullRows(mean);
  for (const MethodResult& mean : means) {
    double sum = 0.0;
    for (const RegionMeasures& region : mean.regions) sum += region.bad_filled[kOnePixel];
    if (std::isnan(sum)) continue;  // not filled, or a region without pixels
    text += format("  %-17s  bad 1.0 px, filled, mean of nonocc, all and disc: %s %%\n",
                   mean.method.c_str(), percent(sum / kRegions.size()).c_str());
  }
  return text;
}

/// The comparisons of one pair of methods in one region, with the scene of each.
struct Contest {
  std::string ours, other;
  std::size_t region;
  std::vector<std::pair<const SceneResult*, const EqualDensity*>> scenes;
};

std::vector<Contest> contests(const std::vector<SceneResult>& scenes) {
  std::vector<Contest> out;
  for (std::size_t i = 0; i < scenes.front().comparisons.size(); ++i) {
    const EqualDensity& first = scenes.front().comparisons[i];
    Contest contest{first.ours, first.other, first.region, {}};
    for (const SceneResult& scene : scenes) {
      contest.scenes.emplace_back(&scene, &scene.comparisons[i]);
    }
    out.push_back(std::move(contest));
  }
  return out;
}

std::string contestTable(const Contest& contest) {
  std::string text = format(
      "\n%s against %s at equal density, bad 1.0 px of the valid pixels in \"%s\", %%\n"
      "  scene            density        bad at own density   as many as %s\n"
      "                   ours   other      ours   other         ours\n",
      contest.ours.c_str(), contest.other.c_str(), kRegions[contest.region], contest.other.c_str());
  for (const auto& [scene, c] : contest.scenes) {
    const char* verdict = !c->comparable() ? "keeps fewer pixels: not comparable"
                          : c->better()    ? "better"
                                           : "not better";
    text += format("  %-14s %s  %s    %s  %s       %s  %s\n", scene->name.c_str(),
                   percent(c->ours_density).c_str(), percent(c->other_density).c_str(),
                   percent(c->ours_bad).c_str(), percent(c->other_bad).c_str(),
                   percent(c->equal_bad).c_str(), verdict);
  }
  return text;
}

std::string contestLine(const Contest& contest) {
  std::size_t better = 0, fewer = 0;
  for (const auto& [scene, c] : contest.scenes) {
    if (!c->comparable()) ++fewer;
    if (c->better()) ++better;
  }
  std::string text =
      format("%s is better than %s at equal or higher density on %zu of %zu scenes (%s)",
             contest.ours.c_str(), contest.other.c_str(), better, contest.scenes.size(),
             kRegions[contest.region]);
  if (fewer > 0) text += format("; not comparable, for it keeps fewer pixels, on %zu", fewer);
  return text + "\n";
}

const MethodResult& resultOf(const SceneResult& scene, const std::string& method) {
  return *std::find_if(scene.methods.begin(), scene.methods.end(),
                       [&](const MethodResult& m) { return m.method == method; });
}

std::string filledLine(const Contest& contest) {
  std::size_t better = 0;
  for (const auto& [scene, c] : contest.scenes) {
    const auto bad = [&, s = scene](const std::string& method) {
      return resultOf(*s, method).regions[contest.region].bad_filled[kOnePixel];
    };
    if (bad(c->ours) < bad(c->other)) ++better;
  }
  return format("%s, filled, is better than %s, filled, on %zu of %zu scenes (%s)\n",
                contest.ours.c_str(), contest.other.c_str(), better, contest.scenes.size(),
                kRegions[contest.region]);
}

nlohmann::json number(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

nlohmann::json toJson(const RegionMeasures& in) {
  const auto shares = [](const evaluation::BadShares& values) {
    nlohmann::json out;
    for (std::size_t i = 0; i < values.size(); ++i) {
      out[format("%.1f", evaluation::kBadThresholds[i])] = number(values[i]);
    }
    return out;
  };
  return {{"pixels", in.pixels},
          {"valid", in.valid},
          {"density", number(in.density)},
          {"bad_valid", shares(in.bad_valid)},
          {"bad_invalid_counted", shares(in.bad_all)},
          {"bad_filled", shares(in.bad_filled)},
          {"inlier_rms_px", number(in.inlier_rms_px)},
          {"median_px", number(in.median_px)}};
}

nlohmann::json toJson(const EqualDensity& c) {
  return {{"ours", c.ours},
          {"other", c.other},
          {"region", kRegions[c.region]},
          {"ours_density", number(c.ours_density)},
          {"other_density", number(c.other_density)},
          {"ours_bad", number(c.ours_bad)},
          {"ours_bad_at_equal_density", number(c.equal_bad)},
          {"other_bad", number(c.other_bad)},
          {"comparable", c.comparable()},
          {"better", c.better()}};
}

}  // namespace

std::string sceneTable(const SceneResult& scene, bool full) {
  std::string text =
      format("\n%s, %dx%d, disparities %d..%d, nonocc %s, disc %s\n", scene.name.c_str(),
             scene.width, scene.height, scene.min_disparity_px, scene.max_disparity_px,
             scene.nonocc_derived ? "derived" : "given", scene.disc_derived ? "derived" : "given");
  text += kShortHead;
  for (const MethodResult& m : scene.methods) text += shortRow(m);
  if (!full) return text;
  text += kFullHead;
  for (const MethodResult& m : scene.methods) text += fullRows(m);
  return text;
}

std::string averageTables(const std::vector<SceneResult>& scenes) {
  std::map<std::string, int> groups;
  int version2 = 0;
  for (const SceneResult& scene : scenes) {
    ++groups[scene.group];
    if (scene.in_version2_table) ++version2;
  }
  std::string text;
  if (version2 > 0 && version2 < static_cast<int>(scenes.size())) {
    text += averageTable(scenes, format("%d scenes of the Middlebury table, version 2", version2),
                         [](const SceneResult& s) { return s.in_version2_table; });
  }
  for (const auto& [group, count] : groups) {
    if (groups.size() == 1) break;
    text += averageTable(scenes, format("%d scenes in %s", count, group.c_str()),
                         [&name = group](const SceneResult& s) { return s.group == name; });
  }
  return text + averageTable(scenes, format("all %zu scenes", scenes.size()),
                             [](const SceneResult&) { return true; });
}

std::string comparisonTables(const std::vector<SceneResult>& scenes) {
  std::string text, filled, lines;
  for (const Contest& contest : contests(scenes)) {
    text += contestTable(contest);
    // Without filling there is nothing to compare.
    const double share = resultOf(scenes.front(), contest.ours).regions[kAll].bad_filled[kOnePixel];
    if (!std::isnan(share)) filled += filledLine(contest);
    lines += contestLine(contest);
  }
  return lines.empty() ? text : text + "\n" + filled + lines;
}

nlohmann::json toJson(const std::vector<SceneResult>& scenes) {
  nlohmann::json out = nlohmann::json::array();
  for (const SceneResult& scene : scenes) {
    nlohmann::json entry = {{"name", scene.name},
                            {"group", scene.group},
                            {"width", scene.width},
                            {"height", scene.height},
                            {"min_disparity_px", scene.min_disparity_px},
                            {"max_disparity_px", scene.max_disparity_px},
                            {"in_version2_table", scene.in_version2_table},
                            {"nonocc_derived", scene.nonocc_derived},
                            {"disc_derived", scene.disc_derived}};
    for (const MethodResult& m : scene.methods) {
      nlohmann::json& method = entry["methods"][m.method];
      method = {{"ms", 1e3 * m.seconds}, {"million_disparities_per_second", m.million_per_second}};
      for (std::size_t r = 0; r < kRegions.size(); ++r) {
        method["regions"][kRegions[r]] = toJson(m.regions[r]);
      }
    }
    entry["equal_density"] = nlohmann::json::array();
    for (const EqualDensity& c : scene.comparisons) entry["equal_density"].push_back(toJson(c));
    out.push_back(std::move(entry));
  }
  return out;
}

}  // namespace scanner::tools
