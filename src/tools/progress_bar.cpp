#include "tools/progress_bar.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace scanner::tools {
namespace {
constexpr std::size_t kWidth = 30;
}

ProgressBar::ProgressBar(std::string label)
    : label_(std::move(label)),
      terminal_(isatty(STDERR_FILENO) == 1),
      start_(std::chrono::steady_clock::now()) {}

ProgressBar::~ProgressBar() {
  if (drawn_) std::fputc('\n', stderr);
}

void ProgressBar::show(std::size_t done, std::size_t total, const std::string& detail) {
  if (!terminal_) return;
  const std::size_t filled = total == 0 ? 0 : std::min(kWidth, kWidth * done / total);
  const double elapsed =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  std::fprintf(stderr, "\r%s [%s%s] %zu/%zu, %.0f s, %s\033[K", label_.c_str(),
               std::string(filled, '#').c_str(), std::string(kWidth - filled, ' ').c_str(), done,
               total, elapsed, detail.c_str());
  std::fflush(stderr);
  drawn_ = true;
}

}  // namespace scanner::tools
