#include "evaluation/html_data.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "evaluation/html_text.h"
#include "evaluation/lenient_json.h"
#include "scanner/core/ply.h"
#include "scanner/core/trajectory_io.h"

namespace scanner::evaluation::html {
namespace {

namespace fs = std::filesystem;

Result<std::string> contents(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream out;
  // Writing out an empty file counts as a failure of `out`, but is none.
  if (file && file.peek() != std::ifstream::traits_type::eof()) out << file.rdbuf();
  if (!file.is_open() || file.bad() || !out) {
    return Status(StatusCode::kIoError, "cannot read " + path.string());
  }
  return out.str();
}

DeviationFigures deviationFigures(const Json& json) {
  DeviationFigures row;
  row.max_m = numberOf(json, "max_m");
  row.min_m = numberOf(json, "min_m");
  row.mean_positive_m = numberOf(json, "mean_positive_m");
  row.mean_negative_m = numberOf(json, "mean_negative_m");
  row.sigma_m = numberOf(json, "sigma_m");
  for (const char* key : {"index", "view", "group", "id"}) {
    if (member(json, key).is_number_integer()) row.label = member(json, key).dump();
  }
  for (const char* key : {"name", "file"}) {
    if (row.label.empty()) row.label = textOf(json, key);
  }
  return row;
}

std::vector<DeviationFigures> deviationTable(const Json& json, const char* key) {
  std::vector<DeviationFigures> rows;
  for (const Json* row : objectsOf(json, key)) rows.push_back(deviationFigures(*row));
  if (!rows.empty()) return rows;
  for (const Json* row : objectsOf(member(json, "tables"), key))
    rows.push_back(deviationFigures(*row));
  return rows;
}

Result<DeviationFile> readDeviation(const fs::path& path) {
  const Result<std::string> text = contents(path);
  if (!text) return text.status();
  const Json json = Json::parse(*text, nullptr, false);
  if (!json.is_object()) {
    return Status(StatusCode::kInvalidInput, path.string() + ": no JSON object");
  }
  DeviationFile file;
  file.model = deviationFigures(json);
  file.mean_m = numberOf(json, "mean_m");
  file.rmse_m = numberOf(json, "rmse_m");
  file.median_absolute_m = numberOf(json, "median_absolute_m");
  file.p95_absolute_m = numberOf(json, "p95_absolute_m");
  file.coverage = numberOf(json, "coverage");
  file.points = integerOf<std::size_t>(json, "points");
  file.outliers = integerOf<std::size_t>(json, "outliers");
  file.views = deviationTable(json, "views");
  file.groups = deviationTable(json, "groups");
  file.placement = textOf(json, "placement");
  const Json& summaries = member(json, "summaries");
  file.all_views = deviationFigures(member(member(summaries, "views"), "model"));
  file.all_groups = deviationFigures(member(member(summaries, "groups"), "model"));
  return file;
}

/// A PNG or JPEG as it is. Its first bytes say what it is, so that a wrong name does no harm.
Result<Picture> readPicture(const fs::path& path, const std::string& caption) {
  const Result<std::string> bytes = contents(path);
  if (!bytes) return bytes.status();
  if (bytes->rfind("\xFF\xD8\xFF", 0) == 0) return Picture{caption, dataUri("image/jpeg", *bytes)};
  if (bytes->rfind("\x89PNG", 0) == 0) return Picture{caption, dataUri("image/png", *bytes)};
  return Status(StatusCode::kInvalidInput, path.string() + ": neither PNG nor JPEG");
}

/// "frame_012_left.jpg" -> "frame 012 left".
std::string captionOf(const fs::path& path) {
  std::string caption = path.stem().string();
  std::replace(caption.begin(), caption.end(), '_', ' ');
  return caption;
}

class Reader {
 public:
  Reader(const fs::path& folder, FolderData& data) : folder_(folder), data_(data) {}

  void readAll() {
    readTrajectory();
    readConfig();
    if (const fs::path path = folder_ / "model.ply"; there(path)) {
      take(readPly(path.string()), data_.model);
    }
    if (const fs::path path = folder_ / "deviation.json"; there(path)) {
      take(readDeviation(path), data_.deviation);
    }
    addPicture(folder_ / "deviation.png", "Deviation from the reference", data_.deviation_pictures);
    addPicture(folder_ / "histogram.png", "Histogram of the deviation", data_.deviation_pictures);
    readSamples();
  }

 private:
  static bool there(const fs::path& path) {
    std::error_code ignored;
    return fs::exists(path, ignored);
  }

  template <typename T>
  void take(Result<T> result, std::optional<T>& target) {
    if (result) {
      target = std::move(*std::move(result));
    } else {
      data_.trouble.push_back(result.status().message());
    }
  }

  void readTrajectory() {
    const fs::path path = folder_ / "trajectory.tum";
    if (!there(path)) return;
    std::optional<Trajectory> trajectory;
    take(readTum(path.string()), trajectory);
    if (trajectory) data_.trajectory = std::move(*trajectory);
  }

  void readConfig() {
    const fs::path path = folder_ / "config.yaml";
    if (!there(path)) return;
    std::optional<std::string> config;
    take(contents(path), config);
    if (config) data_.config = std::move(*config);
  }

  void readSamples() {
    std::vector<fs::path> files;
    std::error_code ignored;
    for (const auto& entry : fs::directory_iterator(folder_ / "pictures", ignored)) {
      const std::string extension = entry.path().extension().string();
      if (extension == ".jpg" || extension == ".png") files.push_back(entry.path());
    }
    std::sort(files.begin(), files.end());
    for (const fs::path& file : files) addPicture(file, captionOf(file), data_.samples);
  }

  void addPicture(const fs::path& path, const std::string& caption, std::vector<Picture>& target) {
    if (!there(path)) return;
    std::optional<Picture> picture;
    take(readPicture(path, caption), picture);
    if (picture) target.push_back(std::move(*picture));
  }

  fs::path folder_;
  FolderData& data_;
};

}  // namespace

Result<FolderData> readFolder(const std::string& folder) {
  const fs::path path = fs::path(folder) / "report.json";
  const Result<std::string> text = contents(path);
  if (!text) return text.status();
  Result<ScanReport> report = parseReport(*text);
  if (!report)
    return Status(report.status().code(), path.string() + ": " + report.status().message());
  FolderData data;
  data.report = *std::move(report);
  std::error_code ignored;
  const fs::path whole = fs::weakly_canonical(fs::absolute(folder, ignored), ignored);
  data.name = whole.filename().empty() ? whole.parent_path().filename().string()
                                       : whole.filename().string();
  Reader(folder, data).readAll();
  return data;
}

}  // namespace scanner::evaluation::html
