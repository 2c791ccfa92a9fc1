#include "evaluation/svg_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "evaluation/html_text.h"

namespace scanner::evaluation::svg {
namespace {

using html::escape;
using html::fixed;

constexpr double kLeft = 54, kRight = 14, kTop = 30, kBottom = 42;

struct Range {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();

  void include(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  double size() const { return high - low; }
  void widen(double size_wanted) {
    const double middle = 0.5 * (low + high);
    low = middle - 0.5 * size_wanted;
    high = middle + 0.5 * size_wanted;
  }
  void pad(double share) { widen(size() * (1.0 + 2.0 * share)); }
};

/// From data to pixels of the picture.
struct Axes {
  Range x, y;
  double width, height;

  double px(double v) const { return kLeft + (v - x.low) / x.size() * (width - kLeft - kRight); }
  double py(double v) const {
    return height - kBottom - (v - y.low) / y.size() * (height - kTop - kBottom);
  }
};

std::string at(double v) { return fixed(v, 1); }

bool drawable(const Series& s, std::size_t i) {
  return i < s.y.size() && std::isfinite(s.x[i]) && std::isfinite(s.y[i]);
}

const std::string& colorAt(const Series& s, std::size_t i) {
  return i < s.colors.size() ? s.colors[i] : s.color;
}

Axes axesFor(const Plot& plot) {
  Axes axes{{}, {}, static_cast<double>(plot.width), static_cast<double>(plot.height)};
  bool bars = false;
  for (const Series& s : plot.series) {
    for (std::size_t i = 0; i < s.x.size(); ++i) {
      if (!drawable(s, i)) continue;
      axes.x.include(s.x[i]);
      axes.y.include(s.y[i]);
    }
    bars = bars || s.mark == Mark::kBar;
  }
  if (axes.x.size() < 0.0) return axes;  // nothing to draw
  if (plot.from_zero) axes.y.include(0.0);
  // A single value still needs an interval around it.
  constexpr double kSmallest = 1e-9;
  if (axes.x.size() < kSmallest) axes.x.widen(1.0);
  if (axes.y.size() < kSmallest) axes.y.widen(1.0);
  if (plot.equal_scales) {
    axes.x.pad(0.06);
    axes.y.pad(0.06);
    const double across = axes.width - kLeft - kRight, up = axes.height - kTop - kBottom;
    const double unit = std::max(axes.x.size() / across, axes.y.size() / up);
    axes.x.widen(unit * across);
    axes.y.widen(unit * up);
    return axes;
  }
  if (bars) axes.x = {axes.x.low - 0.5, axes.x.high + 0.5};
  const double head = 0.06 * axes.y.size();
  if (!plot.from_zero || axes.y.high > 0.0) axes.y.high += head;
  if (!plot.from_zero || axes.y.low < 0.0) axes.y.low -= head;
  return axes;
}

int digitsFor(const std::vector<double>& values) {
  const double step = values.size() > 1 ? values[1] - values[0] : 1.0;
  return std::clamp(static_cast<int>(std::ceil(-std::log10(step) - 1e-9)), 0, 6);
}

std::string text(double x, double y, const char* anchor, const std::string& content,
                 const std::string& more = "") {
  return "<text x=\"" + at(x) + "\" y=\"" + at(y) + "\" text-anchor=\"" + anchor + "\"" + more +
         ">" + escape(content) + "</text>\n";
}

std::string line(double x1, double y1, double x2, double y2, const std::string& color,
                 const char* width) {
  return "<line x1=\"" + at(x1) + "\" y1=\"" + at(y1) + "\" x2=\"" + at(x2) + "\" y2=\"" + at(y2) +
         "\" stroke=\"" + color + "\" stroke-width=\"" + width + "\"/>\n";
}

std::string grid(const Plot& plot, const Axes& axes) {
  const std::string grey = "#e3e7ec";
  std::string out;
  const std::vector<double> xs = ticks(axes.x.low, axes.x.high, 7);
  const std::vector<double> ys = ticks(axes.y.low, axes.y.high, 6);
  const double floor = axes.height - kBottom;
  for (const double v : xs) {
    out += line(axes.px(v), kTop, axes.px(v), floor, grey, "1");
    out += text(axes.px(v), floor + 15, "middle", fixed(v, digitsFor(xs)));
  }
  for (const double v : ys) {
    out += line(kLeft, axes.py(v), axes.width - kRight, axes.py(v), grey, "1");
    out += text(kLeft - 6, axes.py(v) + 4, "end", fixed(v, digitsFor(ys)));
  }
  const double middle = 0.5 * (kTop + floor);
  out += text(0.5 * (kLeft + axes.width - kRight), axes.height - 8, "middle", plot.x_label);
  out +=
      text(13, middle, "middle", plot.y_label, " transform=\"rotate(-90 13 " + at(middle) + ")\"");
  return out;
}

std::string drawLine(const Series& s, const Axes& axes) {
  std::string out;
  if (!s.colors.empty()) {
    for (std::size_t i = 1; i < s.x.size(); ++i) {
      if (!drawable(s, i - 1) || !drawable(s, i)) continue;
      out += line(axes.px(s.x[i - 1]), axes.py(s.y[i - 1]), axes.px(s.x[i]), axes.py(s.y[i]),
                  colorAt(s, i), "2");
    }
    return out;
  }
  std::string points;
  const auto flush = [&] {
    if (!points.empty()) {
      out += "<polyline fill=\"none\" stroke=\"" + s.color + "\" stroke-width=\"1.6\" points=\"" +
             points + "\"/>\n";
    }
    points.clear();
  };
  for (std::size_t i = 0; i < s.x.size(); ++i) {
    if (!drawable(s, i)) {
      flush();
      continue;
    }
    points += (points.empty() ? "" : " ") + at(axes.px(s.x[i])) + "," + at(axes.py(s.y[i]));
  }
  flush();
  return out;
}

std::string drawMark(const Series& s, std::size_t i, const Axes& axes, double bar_width) {
  const double x = axes.px(s.x[i]), y = axes.py(s.y[i]);
  if (s.mark == Mark::kDot) {
    return "<circle cx=\"" + at(x) + "\" cy=\"" + at(y) + "\" r=\"3\" fill=\"" + colorAt(s, i) +
           "\"/>\n";
  }
  if (s.mark == Mark::kCross) {
    constexpr double kArm = 4.0;
    return line(x - kArm, y - kArm, x + kArm, y + kArm, colorAt(s, i), "2") +
           line(x - kArm, y + kArm, x + kArm, y - kArm, colorAt(s, i), "2");
  }
  const double base = axes.py(std::clamp(0.0, axes.y.low, axes.y.high));
  return "<rect x=\"" + at(x - 0.5 * bar_width) + "\" y=\"" + at(std::min(y, base)) +
         "\" width=\"" + at(bar_width) + "\" height=\"" + at(std::abs(base - y)) + "\" fill=\"" +
         colorAt(s, i) + "\"/>\n";
}

std::string draw(const Series& s, const Axes& axes) {
  if (s.mark == Mark::kLine) return drawLine(s, axes);
  const double bar_width = std::max(1.0, 0.8 * (axes.px(1.0) - axes.px(0.0)));
  std::string out;
  for (std::size_t i = 0; i < s.x.size(); ++i) {
    if (drawable(s, i)) out += drawMark(s, i, axes, bar_width);
  }
  return out;
}

/// In the line of the title, from the right.
std::string legend(const Plot& plot, const Axes& axes) {
  constexpr double kLetter = 6.2;
  std::string out;
  double x = axes.width - kRight;
  for (auto s = plot.series.rbegin(); s != plot.series.rend(); ++s) {
    if (s->label.empty()) continue;
    out += text(x, kTop - 12, "end", s->label);
    x -= kLetter * static_cast<double>(s->label.size()) + 8;
    out += "<rect x=\"" + at(x - 4) + "\" y=\"" + at(kTop - 20) +
           "\" width=\"8\" height=\"8\" fill=\"" + s->color + "\"/>\n";
    x -= 14;
  }
  return out;
}

std::string open(const std::string& title, double width, double height) {
  return "<svg viewBox=\"0 0 " + fixed(width, 0) + " " + fixed(height, 0) +
         "\" role=\"img\" font-size=\"11\" fill=\"#334155\">\n<title>" + escape(title) +
         "</title>\n" + text(8, 16, "start", title, " font-size=\"13\" font-weight=\"600\"");
}

}  // namespace

std::vector<double> ticks(double low, double high, int count) {
  if (!(high > low) || count < 1) return {};
  const double rough = (high - low) / count;
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  double step = 10.0 * power;
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= rough * (1.0 - 1e-9)) {
      step = factor * power;
      break;
    }
  }
  std::vector<double> values;
  const double first = std::ceil(low / step - 1e-9), last = std::floor(high / step + 1e-9);
  for (double k = first; k <= last; k += 1.0) values.push_back(k * step);
  return values;
}

std::string sequentialColor(double t) {
  // Support points of the viridis map (Smith, van der Walt, 2015; CC0), short of its palest end.
  constexpr std::array<std::array<double, 3>, 5> kMap = {
      {{68, 1, 84}, {59, 82, 139}, {33, 145, 140}, {94, 201, 98}, {230, 200, 40}}};
  const double place = std::clamp(t, 0.0, 1.0) * (kMap.size() - 1);
  const auto k = std::min<std::size_t>(static_cast<std::size_t>(place), kMap.size() - 2);
  const double share = place - static_cast<double>(k);
  static const char* kHex = "0123456789abcdef";
  std::string out = "#";
  for (std::size_t c = 0; c < 3; ++c) {
    const double value = kMap[k][c] + share * (kMap[k + 1][c] - kMap[k][c]);
    const auto byte = static_cast<unsigned>(std::lround(value));
    out += kHex[byte >> 4U];
    out += kHex[byte & 15U];
  }
  return out;
}

std::string toSvg(const Plot& plot) {
  const Axes axes = axesFor(plot);
  if (axes.x.size() < 0.0) return "";
  std::string out = open(plot.title, axes.width, axes.height) + grid(plot, axes);
  for (const Series& s : plot.series) out += draw(s, axes);
  return out + legend(plot, axes) + "</svg>\n";
}

std::string toSvg(const std::string& title, const std::vector<Bar>& bars) {
  if (bars.empty()) return "";
  constexpr double kWidth = 480, kRow = 26, kLabels = 104, kTexts = 84;
  double longest = 0.0;
  for (const Bar& bar : bars) {
    if (std::isfinite(bar.value)) longest = std::max(longest, bar.value);
  }
  const double height = kTop + kRow * static_cast<double>(bars.size()) + 8;
  std::string out = open(title, kWidth, height);
  double y = kTop;
  for (const Bar& bar : bars) {
    const bool known = std::isfinite(bar.value) && bar.value > 0.0 && longest > 0.0;
    const double length = known ? bar.value / longest * (kWidth - kLabels - kTexts) : 0.0;
    out += text(kLabels - 8, y + 16, "end", bar.label);
    out += "<rect x=\"" + at(kLabels) + "\" y=\"" + at(y + 4) + "\" width=\"" + at(length) +
           "\" height=\"17\" fill=\"#2563a8\"/>\n";
    out += text(kLabels + length + 6, y + 16, "start", bar.text);
    y += kRow;
  }
  return out + "</svg>\n";
}

}  // namespace scanner::evaluation::svg
