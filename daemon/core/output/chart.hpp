// A line chart with two logarithmic axes, as an SVG element that takes its colours from the page.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace previz::output {

struct ChartPoint {
  double x = 0, y = 0;  // only points with both above 0 can be drawn
  bool strong = false;  // a filled, larger dot
  std::string hint;     // shown under the pointer
};

struct ChartCurve {
  std::string name;   // label at its end
  std::string style;  // CSS class: "own", "front", "cloud" (dots alone) or "s1" to "s6"
  std::vector<ChartPoint> points;
};

struct LogChart {
  std::string title, x_label, y_label;  // y is a share, and labelled in percent; x in seconds
  std::vector<ChartCurve> curves;
  std::optional<double> doubtful_below;  // the area below this y is shaded
  int width = 460, height = 320;
};

// Returns the chart as SVG, or nothing if there is no point to draw.
std::string to_svg(const LogChart& chart);

// Returns a time as "32 ms", "3.2 s" or "1:20".
std::string time_words(double seconds);
// Returns a share with two digits: "0.35 %", "4 %", "120 %"; one that is not finite is
// "unknown".
std::string share_words(double share);
std::string samples_words(int samples);

}  // namespace previz::output
