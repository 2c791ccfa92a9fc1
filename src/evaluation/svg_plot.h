#pragma once

#include <string>
#include <vector>

/// Small plots as inline SVG. No styles or scripts from outside; same input, same bytes.
namespace scanner::evaluation::svg {

enum class Mark { kLine, kDot, kBar, kCross };

/// Points of one kind. Points that are not finite are left out and interrupt a line.
struct Series {
  Mark mark = Mark::kLine;
  std::vector<double> x, y;
  std::string color = "#2563a8";
  std::vector<std::string> colors;  ///< of every point (of a line: of the piece that ends there)
  std::string label;                ///< in the legend; empty: not there
};

struct Plot {
  std::string title, x_label, y_label;  ///< plain text
  std::vector<Series> series;
  bool equal_scales = false;  ///< a unit is as long in x as in y
  bool from_zero = true;      ///< the y axis includes 0
  int width = 480, height = 280;
};

/// Empty when no series has a finite point.
std::string toSvg(const Plot& plot);

struct Bar {
  std::string label;  ///< plain text
  double value = 0.0;
  std::string text;  ///< plain text, written behind the bar
};
/// Horizontal bars; values that are not finite get none. Empty without bars.
std::string toSvg(const std::string& title, const std::vector<Bar>& bars);

/// "#rrggbb" from dark blue (0) over green to yellow (1), readable in grey too.
std::string sequentialColor(double t);

/// Round numbers covering [low, high], about `count` of them.
std::vector<double> ticks(double low, double high, int count);

}  // namespace scanner::evaluation::svg
