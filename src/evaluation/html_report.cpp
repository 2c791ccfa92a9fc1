#include "scanner/evaluation/html_report.h"

#include <ctime>
#include <filesystem>

#include "evaluation/html_data.h"
#include "evaluation/html_parts.h"
#include "evaluation/html_style.h"
#include "evaluation/html_text.h"
#include "scanner/core/ply.h"

namespace scanner::evaluation {
namespace html {
namespace {

/// Day and hour of the first view, "" for clocks that do not know the day.
std::string taken(const ScanReport& report) {
  constexpr std::int64_t kYear2000_s = 946'684'800;
  if (report.views.empty()) return "";
  const auto since_epoch = toNanoseconds(report.views.front().stamp) / 1'000'000'000;
  if (since_epoch < kYear2000_s) return "";
  const auto time = static_cast<std::time_t>(since_epoch);
  std::tm parts{};
  if (gmtime_r(&time, &parts) == nullptr) return "";
  char text[64];
  const std::size_t length = std::strftime(text, sizeof text, "%Y-%m-%d %H:%M:%S UTC", &parts);
  return std::string(text, length);
}

std::string optionalSection(const char* id, const char* title, const std::string& body) {
  return body.empty() ? "" : section(id, title, body);
}

std::string head(const FolderData& data) {
  const std::string title = "Scan report: " + escape(data.name);
  return "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
         "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>" +
         title + "</title>\n<style>" + kStyle + "</style>\n</head>\n";
}

std::string page(const FolderData& data) {
  const ModelPictures model = renderModel(data);
  const std::string day = taken(data.report);
  std::string out = head(data) + "<body>\n<main>\n<header>\n<h1>Scan of " + escape(data.name) +
                    "</h1>\n<p>" + (day.empty() ? "" : "First view taken " + day) +
                    "</p>\n</header>\n";
  out += verdict(data);
  out += keyFigures(data);
  out += optionalSection("model", "The model", figure(model.hero) + figures(model.sides));
  out += optionalSection("accuracy", "How accurate it is",
                         accuracy(data) + figures(data.deviation_pictures));
  out += optionalSection("notes", "Warnings and what was left out", troubles(data));
  out += optionalSection("pictures", "What the camera saw", figures(data.samples));
  out += optionalSection("plots", "The scan in plots", plots(data));
  out += optionalSection("views", "Views and registration", scanTables(data));
  const std::string motion = motionTables(data);
  out += optionalSection("motion", "Motion and its prior",
                         motion.empty()
                             ? ""
                             : paragraph("Figures in italics are those published for the artwork"
                                         " sequence of the thesis (50 views).") +
                                   motion);
  out += optionalSection("sampling", "Sampling", samplingTables(data));
  out += optionalSection("deviation", "Deviation by view and group", deviationTables(data));
  out += optionalSection("run", "Model and processing", runTables(data));
  if (!data.config.empty()) {
    out += section("configuration", "Configuration as used",
                   "<details><summary>config.yaml</summary>\n<pre>" + escape(data.config) +
                       "</pre></details>\n");
  }
  return out +
         "<footer>Made from the files of the scan folder; the figures are in report.json."
         "</footer>\n</main>\n</body>\n</html>\n";
}

}  // namespace
}  // namespace html

Status writeHtmlReport(const std::string& folder) {
  const Result<html::FolderData> data = html::readFolder(folder);
  if (!data) return data.status();
  return writeFileAtomically((std::filesystem::path(folder) / "report.html").string(),
                             html::page(*data));
}

}  // namespace scanner::evaluation
