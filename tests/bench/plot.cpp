#include "tests/bench/plot.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>

#include "drivers/error.hpp"

namespace previz::bench {
namespace {

constexpr double width = 760, height = 480, left = 80, right = 150, top = 40, bottom = 70;
constexpr std::array colours{"#1b6ca8", "#d1495b", "#2e8b57", "#8d5fb4", "#c58b00", "#444444"};

// A round number of which about six reach `most`.
double tick_step(double most) {
  const double rough = most / 6;
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  for (const double factor : {1.0, 2.0, 5.0})
    if (rough <= factor * power) return factor * power;
  return 10 * power;
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

std::string text(double x, double y, const std::string& anchor, const std::string& words,
                 const std::string& more = {}) {
  return "<text x=\"" + number(x) + "\" y=\"" + number(y) + "\" text-anchor=\"" + anchor + "\"" +
         more + ">" + words + "</text>\n";
}

std::string line(double x0, double y0, double x1, double y1, const std::string& colour) {
  return "<line x1=\"" + number(x0) + "\" y1=\"" + number(y0) + "\" x2=\"" + number(x1) +
         "\" y2=\"" + number(y1) + "\" stroke=\"" + colour + "\"/>\n";
}

}  // namespace

void write_svg(const Chart& chart, const std::filesystem::path& file) {
  double most_x = 0, most_y = 0;
  for (const Curve& curve : chart.curves) {
    for (const auto& [x, y] : curve.points) {
      most_x = std::max(most_x, x);
      most_y = std::max(most_y, y);
    }
  }
  if (!(most_x > 0) || !(most_y > 0))
    throw Error("bench: " + file.string() + ": a chart needs points above zero");
  const double step = tick_step(most_y);
  const int ticks = static_cast<int>(std::ceil(most_y / step));
  most_y = ticks * step;
  const auto at_x = [&](double x) { return left + (width - left - right) * x / most_x; };
  const auto at_y = [&](double y) {
    return height - bottom - (height - top - bottom) * y / most_y;
  };

  std::ofstream out(file);
  out << "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " << width << " " << height
      << "\" font-family=\"sans-serif\" font-size=\"12\">\n"
      << "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
      << text((left + width - right) / 2, 24, "middle", chart.title, " font-size=\"15\"");
  for (int tick = 0; tick <= ticks; ++tick) {
    const double y = tick * step;
    out << line(left, at_y(y), width - right, at_y(y), "#dddddd")
        << text(left - 8, at_y(y) + 4, "end", number(y));
  }
  for (const auto& [x, label] : chart.x_ticks) {
    const std::string turn =
        " transform=\"rotate(-30 " + number(at_x(x)) + " " + number(height - bottom + 16) + ")\"";
    out << line(at_x(x), height - bottom, at_x(x), height - bottom + 5, "black")
        << text(at_x(x), height - bottom + 16, "end", label, turn);
  }
  out << line(left, height - bottom, width - right, height - bottom, "black")
      << line(left, top, left, height - bottom, "black")
      << text((left + width - right) / 2, height - 8, "middle", chart.x_label)
      << text(20, (top + height - bottom) / 2, "middle", chart.y_label,
              " transform=\"rotate(-90 20 " + number((top + height - bottom) / 2) + ")\"");
  for (std::size_t i = 0; i < chart.curves.size(); ++i) {
    const Curve& curve = chart.curves[i];
    const char* colour = colours[i % colours.size()];
    out << "<polyline fill=\"none\" stroke-width=\"2\" stroke=\"" << colour << "\" points=\"";
    for (const auto& [x, y] : curve.points) out << number(at_x(x)) << "," << number(at_y(y)) << " ";
    out << "\"/>\n";
    for (const auto& [x, y] : curve.points)
      out << "<circle r=\"3\" cx=\"" << number(at_x(x)) << "\" cy=\"" << number(at_y(y))
          << "\" fill=\"" << colour << "\"/>\n";
    if (!curve.points.empty())
      out << text(width - right + 8, at_y(curve.points.back().second) + 4, "start", curve.name,
                  std::string(" fill=\"") + colour + "\"");
  }
  out << "</svg>\n";
  out.close();
  if (!out) throw Error("bench: " + file.string() + " cannot be written");
}

}  // namespace previz::bench
