#include "daemon/core/session/light_json.hpp"
#include "daemon/core/session/json_numbers.hpp"

#include <cmath>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "drivers/error.hpp"

namespace previz::session {
namespace {

using Json = nlohmann::ordered_json;

constexpr int largest_ambient = 64;  // texels a side

template <class Number>
void add(Json& list, Number value, const char* what) {
  if (!std::isfinite(value))
    throw Error(std::string("a light's ") + what + " must be finite to be recorded");
  list.push_back(value);
}

template <class Vector>
Json components_of(const Vector& v, const char* what) {
  Json list = Json::array();
  for (int i = 0; i < 3; ++i) add(list, v[i], what);
  return list;
}

double number(const Json& json) {
  const auto value = number_of<double>(json);
  if (!std::isfinite(value)) throw std::invalid_argument("not finite");
  return value;
}

double not_negative(const Json& json) {
  const double value = number(json);
  if (value < 0) throw std::invalid_argument("negative light");
  return value;
}

const Json& three(const Json& json) {
  if (!json.is_array() || json.size() != 3) throw std::invalid_argument("not three numbers");
  return json;
}

CapturedSource source_of(const Json& json) {
  CapturedSource source;
  source.id = number_at<int>(json, "id");
  source.solid_angle_sr = number(json.at("solid_angle_sr"));
  constexpr double sphere_sr = 12.566370614359173;
  if (!(source.solid_angle_sr > 0 && source.solid_angle_sr <= sphere_sr))
    throw std::invalid_argument("not a solid angle");
  for (int i = 0; i < 3; ++i) {
    source.direction[i] = number(three(json.at("direction"))[static_cast<std::size_t>(i)]);
    source.flux[i] = not_negative(three(json.at("flux"))[static_cast<std::size_t>(i)]);
  }
  if (std::abs(glm::length(source.direction) - 1) > 1e-6)
    throw std::invalid_argument("not a unit direction");
  return source;
}

}  // namespace

Json to_json(const CapturedLight& light) {
  Json sources = Json::array();
  for (const CapturedSource& source : light.sources) {
    Json angle = Json::array();
    add(angle, source.solid_angle_sr, "solid angle");
    sources.push_back({{"id", source.id},
                       {"direction", components_of(source.direction, "direction")},
                       {"solid_angle_sr", angle[0]},
                       {"flux", components_of(source.flux, "flux")}});
  }
  Json radiance = Json::array();
  for (const glm::vec3& texel : light.ambient)
    for (int i = 0; i < 3; ++i) add(radiance, texel[i], "radiance");
  return {{"sources", sources},
          {"ambient", {{"size", light.ambient_size}, {"radiance", radiance}}}};
}

CapturedLight captured_light_of(const Json& json) {
  CapturedLight light;
  if (!json.at("sources").is_array()) throw std::invalid_argument("not a list of sources");
  for (const Json& source : json.at("sources")) light.sources.push_back(source_of(source));
  const Json& ambient = json.at("ambient");
  light.ambient_size = number_at<int>(ambient, "size");
  const int size = light.ambient_size;
  if (size < 1 || size > largest_ambient || (size & (size - 1)) != 0)
    throw std::invalid_argument("not a power of two up to 64");
  const Json& radiance = ambient.at("radiance");
  if (!radiance.is_array() || radiance.size() != 3u * static_cast<std::size_t>(size * size))
    throw std::invalid_argument("wrong number of texels for the size");
  for (std::size_t i = 0; i < radiance.size(); i += 3)
    light.ambient.emplace_back(not_negative(radiance[i]), not_negative(radiance[i + 1]),
                               not_negative(radiance[i + 2]));
  return light;
}

}  // namespace previz::session
