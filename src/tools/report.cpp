#include "scanner/evaluation/html_report.h"

#include <string>

#include "tools/run.h"

int main(int argc, char** argv) {
  CLI::App app("Makes report.html of a scan folder again, from the files in it.", "report");
  std::string folder;
  app.add_option("DIR", folder, "scan folder with a report.json")->required();
  return scanner::tools::run(app, argc, argv, [&] {
    const scanner::Status status = scanner::evaluation::writeHtmlReport(folder);
    if (!status) throw scanner::ConfigurationError(status.message());
    std::printf("%s/report.html\n", folder.c_str());
    return scanner::tools::kOk;
  });
}
