#include "daemon/tools/calibrate/lens/residual_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "daemon/core/output/page.hpp"

namespace previz::calibrate {
namespace {

constexpr double plot_width = 900, margin = 40, bar_height = 120;

constexpr auto style = R"(<style>
text { font: 13px sans-serif; fill: #222; }
.frame { fill: none; stroke: #888; }
.residual line { stroke: #1a6faf; stroke-width: 1; }
.out line, .out circle { stroke: #c8321e; fill: none; }
.bar { fill: #1a6faf; }
</style>
)";

// Returns the scale that enlarges a typical residual to a twentieth of the plot's width: 1, 2 or 5
// times a power of ten.
double enlargement(double rms_px, double picture_per_px) {
  const double wanted = plot_width / 20 / std::max(rms_px * picture_per_px, 1e-9);
  const double power = std::pow(10, std::floor(std::log10(wanted)));
  for (const double step : {5.0, 2.0})
    if (step * power <= wanted) return step * power;
  return power;
}

std::string certainty_svg(const std::vector<UncertainPixel>& picture, double scale) {
  std::string svg;
  for (const UncertainPixel& at : picture)
    svg += fmt::format(
        "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"12\" fill=\"#e8a33d\" fill-opacity=\"{:.2f}\">"
        "<title>accurate to {:.3f} px</title></circle>\n",
        at.pixel.x * scale, at.pixel.y * scale, std::min(0.9, at.sigma_px), at.sigma_px);
  return svg;
}

std::string residuals_svg(const Views& views, const BundleFit& fit, double scale, double enlarged) {
  std::string used, out;
  for (std::size_t v = 0; v < views.views.size(); ++v)
    for (std::size_t i = 0; i < views.views[v].pixels.size(); ++i) {
      const glm::dvec2 at = views.views[v].pixels[i] * scale;
      const glm::dvec2 to = at + fit.residuals[v][i] * scale * enlarged;
      // An outlier's line would cross the whole plot, so only its place is marked.
      if (fit.used[v][i])
        used += fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\"/>\n",
                            at.x, at.y, to.x, to.y);
      else
        out += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"5\"/>\n", at.x, at.y);
    }
  return "<g class=\"residual\">\n" + used + "</g>\n<g class=\"out\">\n" + out + "</g>\n";
}

std::string bars_svg(const Views& views, const BundleFit& fit, double top) {
  double largest = 1e-9;
  for (std::size_t v = 0; v < views.views.size(); ++v)
    largest = std::max(largest, view_rms_px(fit, v));
  const double step = plot_width / double(views.views.size());
  std::string svg = fmt::format(
      "<text x=\"0\" y=\"{:.0f}\">rms of each view, px (highest: {:.3f})"
      "</text>\n",
      top - 8, largest);
  for (std::size_t v = 0; v < views.views.size(); ++v) {
    const double height = bar_height * view_rms_px(fit, v) / largest;
    svg += fmt::format(
        "<rect class=\"bar\" x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" "
        "height=\"{:.1f}\"><title>{}: {:.3f} px</title></rect>\n",
        step * double(v), top + bar_height - height, 0.8 * step, height,
        output::escaped(views.views[v].name), view_rms_px(fit, v));
  }
  return svg;
}

}  // namespace

double view_rms_px(const BundleFit& fit, std::size_t view) {
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < fit.residuals[view].size(); ++i)
    if (fit.used[view][i]) {
      sum += glm::dot(fit.residuals[view][i], fit.residuals[view][i]);
      ++count;
    }
  return count > 0 ? std::sqrt(sum / count) : 0;
}

std::string residual_plot_svg(const Views& views, const BundleFit& fit,
                              const std::vector<UncertainPixel>& picture,
                              const std::string& title) {
  const double scale = plot_width / views.width, height = views.height * scale;
  const double enlarged = enlargement(fit.rms_px, scale);
  const double bars_top = height + 60;
  return fmt::format(
             "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{:.0f}\" "
             "height=\"{:.0f}\">\n{}"
             "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
             "<g transform=\"translate({} {})\">\n"
             "<text x=\"0\" y=\"-14\">{}: rms {:.3f} px, residuals {:g} times enlarged, "
             "{} of {} corners rejected (red); shades: uncertainty, dark is 1 px</text>\n",
             plot_width + 2 * margin, bars_top + bar_height + 2 * margin, style, margin, margin,
             output::escaped(title), fit.rms_px, enlarged, fit.corners - fit.corners_used,
             fit.corners) +
         certainty_svg(picture, scale) + residuals_svg(views, fit, scale, enlarged) +
         fmt::format("<rect class=\"frame\" width=\"{:.1f}\" height=\"{:.1f}\"/>\n", plot_width,
                     height) +
         bars_svg(views, fit, bars_top) + "</g>\n</svg>\n";
}

}  // namespace previz::calibrate
