#include "daemon/core/output/chart.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "daemon/core/output/page.hpp"
#include "daemon/core/output/progress.hpp"
#include "daemon/core/set/check.hpp"

namespace previz::output {
namespace {

constexpr double margin_left = 58, margin_right = 112, margin_top = 30, margin_bottom = 46;
constexpr double label_height = 13;

std::string formatted(const char* format, double value) {
  char text[48];
  std::snprintf(text, sizeof text, format, value);
  return text;
}
std::string coordinate(double value) {
  return formatted("%.1f", value);
}

// Formats two significant digits without an exponent.
std::string two_digits(double value) {
  if (!(value > 0)) return "0";
  const int digits = std::max(0, 1 - static_cast<int>(std::floor(std::log10(value) + 1e-9)));
  char text[48];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  std::string words = text;
  if (words.find('.') == std::string::npos) return words;
  words.erase(words.find_last_not_of('0') + 1);
  if (words.back() == '.') words.pop_back();
  return words;
}

// A logarithmic axis, which maps values to pixels.
struct LogAxis {
  double low = std::numeric_limits<double>::infinity(), high = 0;
  double from_px = 0, to_px = 0;

  void cover(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  // Makes room for dots at the ends, so that the axis always has an extent.
  void widen() {
    low /= 1.35;
    high *= 1.35;
  }
  double at(double value) const {
    return from_px + (to_px - from_px) * std::log(value / low) / std::log(high / low);
  }
  // Returns round numbers, as many as the axis has room for.
  std::vector<double> ticks() const {
    const std::vector<double> steps = high / low < 8     ? std::vector<double>{1, 1.5, 2, 3, 5, 7}
                                      : high / low < 300 ? std::vector<double>{1, 2, 5}
                                                         : std::vector<double>{1};
    std::vector<double> result;
    for (int power = static_cast<int>(std::floor(std::log10(low))); std::pow(10, power) <= high;
         ++power)
      for (const double step : steps) {
        const double tick = step * std::pow(10, power);
        if (tick >= low && tick <= high) result.push_back(tick);
      }
    return result;
  }
};

std::string svg_text(double x, double y, const char* anchor, const char* style,
                     const std::string& words, const std::string& more = "") {
  return "<text class=\"" + std::string(style) + "\" x=\"" + coordinate(x) + "\" y=\"" +
         coordinate(y) + "\" text-anchor=\"" + anchor + "\"" + more + ">" + escaped(words) +
         "</text>\n";
}

std::string svg_line(double x0, double y0, double x1, double y1) {
  return "<line class=\"grid\" x1=\"" + coordinate(x0) + "\" y1=\"" + coordinate(y0) + "\" x2=\"" +
         coordinate(x1) + "\" y2=\"" + coordinate(y1) + "\"/>\n";
}

bool drawable(const ChartPoint& point) {
  return point.x > 0 && point.y > 0;
}

std::string curve_svg(const ChartCurve& curve, const LogAxis& x, const LogAxis& y) {
  std::string line, dots;
  for (const ChartPoint& point : curve.points) {
    if (!drawable(point)) continue;
    const std::string px = coordinate(x.at(point.x)), py = coordinate(y.at(point.y));
    line += px + "," + py + " ";
    dots += "<circle cx=\"" + px + "\" cy=\"" + py + "\" r=\"" + (point.strong ? "4.5" : "3") +
            "\"><title>" + escaped(point.hint) + "</title></circle>\n";
  }
  const bool joined = curve.style != "cloud";
  return "<g class=\"" + curve.style + "\">\n" +
         (joined ? "<polyline points=\"" + line + "\"/>\n" : "") + dots + "</g>\n";
}

// Draws the names beside the ends of the curves, moved apart where they would overlap. The front's
// names stand above their dots.
std::string labels_svg(const LogChart& chart, const LogAxis& x, const LogAxis& y) {
  struct Label {
    double x, y;
    const ChartCurve* curve;
  };
  std::vector<Label> labels;
  for (const ChartCurve& curve : chart.curves) {
    const auto last = std::find_if(curve.points.rbegin(), curve.points.rend(), drawable);
    if (!curve.name.empty() && last != curve.points.rend())
      labels.push_back(curve.style == "front" ? Label{x.at(last->x) + 9, y.at(last->y) - 7, &curve}
                                              : Label{x.to_px + 8, y.at(last->y) + 4, &curve});
  }
  std::ranges::sort(labels, {}, &Label::y);
  for (std::size_t i = 1; i < labels.size(); ++i)
    labels[i].y = std::max(labels[i].y, labels[i - 1].y + label_height);
  // Labels that were pushed below the picture move up again, from the last.
  double lowest = chart.height - margin_bottom - 2;
  for (std::size_t i = labels.size(); i-- > 0; lowest -= label_height)
    labels[i].y = std::min(labels[i].y, lowest);
  std::string svg;
  for (const Label& label : labels)
    svg += svg_text(label.x, label.y, "start", ("name " + label.curve->style).c_str(),
                    label.curve->name);
  return svg;
}

std::string axes_svg(const LogChart& chart, const LogAxis& x, const LogAxis& y) {
  std::string svg;
  for (const double tick : y.ticks())
    svg += svg_line(x.from_px, y.at(tick), x.to_px, y.at(tick)) +
           svg_text(x.from_px - 7, y.at(tick) + 4, "end", "tick", share_words(tick));
  double free_from = 0;
  for (const double tick : x.ticks()) {
    svg += svg_line(x.at(tick), y.from_px, x.at(tick), y.to_px);
    if (x.at(tick) < free_from) continue;
    svg += svg_text(x.at(tick), y.from_px + 16, "middle", "tick", time_words(tick));
    free_from = x.at(tick) + 42;
  }
  svg += svg_text(0.5 * (x.from_px + x.to_px), chart.height - 10, "middle", "label", chart.x_label);
  const double middle = 0.5 * (y.from_px + y.to_px);
  svg += svg_text(13, middle, "middle", "label", chart.y_label,
                  " transform=\"rotate(-90 13 " + coordinate(middle) + ")\"");
  return svg + svg_text(x.from_px, 17, "start", "title", chart.title);
}

}  // namespace

std::string to_svg(const LogChart& chart) {
  LogAxis x, y;
  x.from_px = margin_left;
  x.to_px = chart.width - margin_right;
  y.from_px = chart.height - margin_bottom;
  y.to_px = margin_top;
  for (const ChartCurve& curve : chart.curves)
    for (const ChartPoint& point : curve.points)
      if (drawable(point)) {
        x.cover(point.x);
        y.cover(point.y);
      }
  if (!(x.high > 0)) return "";
  x.widen();
  y.widen();

  std::string svg = "<svg viewBox=\"0 0 " + std::to_string(chart.width) + " " +
                    std::to_string(chart.height) + "\" role=\"img\" aria-label=\"" +
                    escaped(chart.title) + "\">\n";
  if (chart.doubtful_below && *chart.doubtful_below > y.low) {
    const double top = y.at(std::min(*chart.doubtful_below, y.high));
    svg += "<rect class=\"doubt\" x=\"" + coordinate(x.from_px) + "\" y=\"" + coordinate(top) +
           "\" width=\"" + coordinate(x.to_px - x.from_px) + "\" height=\"" +
           coordinate(y.from_px - top) + "\"><title>within the reference's noise</title></rect>\n";
  }
  svg += axes_svg(chart, x, y);
  for (const ChartCurve& curve : chart.curves) svg += curve_svg(curve, x, y);
  return svg + labels_svg(chart, x, y) + "</svg>\n";
}

std::string time_words(double seconds) {
  if (seconds < 0.0995) return two_digits(1000 * seconds) + " ms";
  return seconds < 59.5 ? two_digits(seconds) + " s" : duration_words(seconds);
}

std::string share_words(double share) {
  return std::isfinite(share) ? two_digits(100 * share) + " %" : "unknown";
}

std::string samples_words(int samples) {
  return set::plural(static_cast<std::uint64_t>(samples), "sample");
}

}  // namespace previz::output
