#include "daemon/core/lighting/light_mode.hpp"

#include <fmt/format.h>
#include <cmath>
#include <numbers>
#include <utility>

#include "daemon/core/lighting/luminance.hpp"
#include "daemon/core/lighting/sources.hpp"

namespace previz::lighting {
namespace {

std::string counted(std::size_t number, const char* noun) {
  return fmt::format("{} {}{}", number, noun, number == 1 ? "" : "s");
}

}  // namespace

std::vector<std::vector<std::uint32_t>> apply_mode(Lighting& lighting,
                                                   const set::Lighting& settings,
                                                   SourceTracker& tracker,
                                                   std::int64_t timestamp_ns,
                                                   std::vector<Source> declared) {
  lighting.sources = std::move(declared);
  if (settings.mode == set::LightMode::image) return {};
  Extraction extraction = extract_sources(lighting.environment, settings.sources, tracker.known());
  std::string note =
      counted(extraction.sources.size(), "lamp") + " found in the light camera's picture";
  lighting.sources.insert(lighting.sources.end(), extraction.sources.begin(),
                          extraction.sources.end());
  tracker.follow(lighting.sources, timestamp_ns);
  if (extraction.left > 0)
    note += ", " + counted(static_cast<std::size_t>(extraction.left), "bright region") +
            " not treated as lamps (too faint, too wide or too many)";
  if (settings.mode == set::LightMode::hybrid) {
    lighting.environment = std::move(extraction.residual);
  } else if (settings.sources.residual == set::Residual::blurred) {
    lighting.environment = blurred(extraction.residual);
  } else {
    const double all = luminance(total_flux(lighting.environment));
    const double residual = luminance(total_flux(extraction.residual));
    lighting.report.dropped_share = all > 0 ? residual / all : 0;
    note += fmt::format("; the other {:.0f} % of the light is dropped",
                        100 * lighting.report.dropped_share);
    lighting.environment = {1, {glm::vec3(0)}};
  }
  lighting.report.notes.push_back(std::move(note));
  return std::move(extraction.regions);
}

std::vector<set::Light> lamps_of(const std::vector<Source>& sources, const glm::dvec3& viewpoint,
                                 const SourceDistance& distance_of) {
  std::vector<set::Light> lamps;
  for (const Source& source : sources) {
    set::Light& lamp = lamps.emplace_back();
    lamp.name = "found " + std::to_string(source.id);
    lamp.direction = -source.direction;
    lamp.gain_mixed = lamp.gain_real = 1;
    const double radius = angular_radius(source), sine = std::sin(radius);
    lamp.angular_radius_rad = radius;
    if (const auto distance = distance_of(source.direction)) {
      lamp.type = set::LightType::sphere;
      lamp.position = viewpoint + *distance * source.direction;
      lamp.radius_m = *distance * sine;
      lamp.emission = radiance(source);
    } else {
      lamp.type = set::LightType::directional;
      lamp.emission = radiance(source) * (std::numbers::pi * sine * sine);  // facing it
    }
  }
  return lamps;
}

}  // namespace previz::lighting
