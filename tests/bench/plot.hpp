// Writes a line chart as SVG.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace previz::bench {

struct Curve {
  std::string name;
  std::vector<std::pair<double, double>> points;  // x ascending
};

struct Chart {
  std::string title, x_label, y_label;
  std::vector<std::pair<double, std::string>> x_ticks;
  std::vector<Curve> curves;
};

// Both axes start at zero. Throws previz::Error naming the file if it cannot be written.
void write_svg(const Chart& chart, const std::filesystem::path& file);

}  // namespace previz::bench
