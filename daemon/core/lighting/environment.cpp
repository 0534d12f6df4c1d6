#include "daemon/core/lighting/environment.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "drivers/error.hpp"
#include "shaders/lib/octahedral.h"

namespace previz::lighting {

int resolution_for(double pixel_sr) {
  int size = 1;
  while (size < max_chosen_resolution && texel_sr(size) > pixel_sr) size *= 2;
  return size;
}

int chosen_resolution(int setting, double pixel_sr) {
  if (setting == 0) return resolution_for(pixel_sr);
  const bool power_of_two = setting > 0 && (setting & (setting - 1)) == 0;
  if (!power_of_two || setting > max_resolution)
    throw Error("lighting.resolution is " + std::to_string(setting) +
                "; allowed are 0 (from the source) and powers of two up to " +
                std::to_string(max_resolution));
  return setting;
}

double texel_sr(int size) {
  return 4 * std::numbers::pi / (static_cast<double>(size) * size);
}

std::string area_words(double solid_angle_sr) {
  constexpr double degree = std::numbers::pi / 180;
  const double cosine = 1 - solid_angle_sr / (2 * std::numbers::pi);
  const double radius = std::acos(std::clamp(cosine, -1.0, 1.0));
  if (radius <= 45 * degree) return fmt::format("an area {:.1f} degrees wide", 2 * radius / degree);
  return fmt::format("an area of {:.0f} % of all directions",
                     100 * solid_angle_sr / (4 * std::numbers::pi));
}

glm::vec3 texel_direction(int size, int i, int j) {
  const float texel = 2.0f / static_cast<float>(size);
  return octahedral_direction(glm::vec2((static_cast<float>(i) + 0.5f) * texel - 1,
                                        (static_cast<float>(j) + 0.5f) * texel - 1));
}

std::size_t texel_index(int size, const glm::vec3& direction) {
  const glm::vec2 point = octahedral_point(direction);
  const auto texel = [size](float p) {
    return std::clamp(static_cast<int>((p + 1) * 0.5f * static_cast<float>(size)), 0, size - 1);
  };
  return static_cast<std::size_t>(texel(point.y)) * static_cast<std::size_t>(size) +
         static_cast<std::size_t>(texel(point.x));
}

std::size_t wrapped_texel(int size, int i, int j) {
  const int last = size - 1;
  if (i < 0 || i > last) {
    i = i < 0 ? 0 : last;
    j = last - j;
  }
  if (j < 0 || j > last) {
    j = j < 0 ? 0 : last;
    i = last - i;
  }
  return static_cast<std::size_t>(j) * static_cast<std::size_t>(size) + static_cast<std::size_t>(i);
}

glm::dvec3 total_flux(const EnvironmentMap& map) {
  glm::dvec3 sum(0);
  for (const glm::vec3& radiance : map.radiance) sum += glm::dvec3(radiance);
  return sum * texel_sr(map.size);
}

}  // namespace previz::lighting
