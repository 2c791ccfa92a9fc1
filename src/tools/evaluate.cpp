#include <algorithm>
#include <stdexcept>
#include <thread>

#include "scanner/evaluation/deviation_report.h"
#include "tools/progress_bar.h"
#include "tools/run.h"

int main(int argc, char** argv) {
  scanner::evaluation::EvaluationRequest request;
  request.threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  auto& options = request.options;
  const CLI::Range metres(1e-6, 1e3);
  CLI::App app("Deviation of a scan from a reference mesh: figures, colours, plots.", "evaluate");
  app.add_option("MODEL", request.model, "PLY of a mesh or cloud, or a scan folder")->required();
  app.add_option("--reference", request.reference, "PLY of a mesh")->required();
  app.add_option("--truth", request.truth, "TUM file: base_link in the reference's frame");
  app.add_flag("--align", request.align, "best fit (after the placement by the truth, if given)");
  app.add_option("--out", request.out, "folder to fill; may be the scan folder")->required();
  app.add_option("--range", request.range_m,
                 "m, end of the colours; default: by the 95th percentile")
      ->check(metres);
  app.add_option("--outlier", options.outlier_m, "m, further points are counted only")
      ->check(metres)
      ->capture_default_str();
  app.add_flag("--per-point", request.per_point, "write deviation.asc too: x y z deviation");
  app.add_option("--threads", request.threads, "threads to use; the result is the same")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  return scanner::tools::run(app, argc, argv, [&] {
    scanner::tools::ProgressBar bar("evaluate");
    const auto report = scanner::evaluation::evaluateModel(
        request, [&](auto done, auto total, const auto& what) { bar.show(done, total, what); });
    if (!report) throw std::runtime_error(report.status().message());
    std::fputs(summary(*report).c_str(), stdout);
    return scanner::tools::kOk;
  });
}
