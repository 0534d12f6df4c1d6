#include "daemon/core/scene/lamp_strength.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <map>
#include <numbers>
#include <span>

#include "daemon/core/set/problems.hpp"

namespace previz::scene {
namespace {

constexpr double most_times_white = 30;
constexpr double nearest_m = 1;          // where a sheet is compared; a lamp's housing is nearer
constexpr double lumens_per_watt = 683;  // glTF-Blender-IO, PBR_WATTS_TO_LUMENS

// What a lamp's emission is, and what of it is compared with white.
struct Unit {
  const char* in_file;
  const char* in_set;
  const char* what_is_compared;
  double radiance;  // of that for an emission of 1, at 1 m
  bool falls_off;   // with the square of the distance
};

Unit unit_of(set::LightType type) {
  constexpr double of_white = 1 / std::numbers::pi;
  switch (type) {
    case set::LightType::point:
    case set::LightType::spot:
      return {"cd", "W/sr", "a white sheet at 1 m", of_white, true};
    case set::LightType::directional:
      return {"lux", "W/m^2", "a white sheet that faces it", of_white, false};
    case set::LightType::rectangle:
    case set::LightType::sphere:
      break;
  }
  return {"", "W/sr/m^2", "the lamp itself", 1, false};
}

std::string figure(double value) {
  return value >= 1e4 && value < 1e9 ? fmt::format("{:.0f}", value) : fmt::format("{:.4g}", value);
}

double brightest_channel(const set::Light& light) {
  return std::max({light.emission.r, light.emission.g, light.emission.b});
}

// Returns the radiance of what is compared, if a sheet is at this distance.
double radiance_of(const set::Light& light, double distance_m) {
  const Unit unit = unit_of(light.type);
  return brightest_channel(light) * unit.radiance / (unit.falls_off ? distance_m * distance_m : 1);
}

std::string given_words(const Scene& scene, std::size_t light) {
  const set::Light& lamp = scene.lights[light];
  const Unit unit = unit_of(lamp.type);
  if (scene.light_objects[light] == no_object)
    return figure(brightest_channel(lamp)) + ' ' + unit.in_set;
  return figure(scene.file_intensities[light]) + ' ' + unit.in_file;
}

const char* assumption(const std::optional<double>& exposure) {
  return exposure ? "" : " at exposure 1";
}

struct Box {
  glm::dvec3 low{1e300}, high{-1e300};
  void include(const glm::dvec3& point) {
    low = glm::min(low, point);
    high = glm::max(high, point);
  }
};

// The boxes around the scene's instances, by what carries them.
class Surroundings {
 public:
  Surroundings(const Scene& scene, const set::Set& set) : set_(set) {
    std::vector<std::optional<Box>> of_meshes(scene.meshes.size());
    for (const Instance& instance : scene.instances) {
      std::optional<Box>& of_mesh = of_meshes[instance.mesh];
      if (!of_mesh) {
        of_mesh.emplace();
        for (const glm::vec3& position : scene.meshes[instance.mesh].positions)
          of_mesh->include(position);
      }
      Box& box = boxes_[carrier_of(instance.object)].emplace_back();
      for (int corner = 0; corner < 8; ++corner) {
        const glm::dvec3 at((corner & 1) != 0 ? of_mesh->high.x : of_mesh->low.x,
                            (corner & 2) != 0 ? of_mesh->high.y : of_mesh->low.y,
                            (corner & 4) != 0 ? of_mesh->high.z : of_mesh->low.z);
        box.include(glm::dvec3(instance.world_from_object * glm::dvec4(at, 1)));
      }
    }
  }

  // Returns how far the nearest thing is from a lamp of an object, `nearest_m` or more; nearest_m
  // where nothing is farther away.
  double distance_m(const set::Light& light, std::uint32_t object) const {
    double nearest = std::numeric_limits<double>::infinity();
    const auto boxes = boxes_.find(carrier_of(object));
    for (const Box& box :
         boxes == boxes_.end() ? std::span<const Box>() : std::span(boxes->second)) {
      const double far =
          glm::distance(light.position, glm::clamp(light.position, box.low, box.high));
      if (far >= nearest_m) nearest = std::min(nearest, far);
    }
    return std::isfinite(nearest) ? nearest : nearest_m;
  }

 private:
  const std::string& carrier_of(std::uint32_t object) const { return set_.objects[object].carrier; }

  const set::Set& set_;
  std::map<std::string, std::vector<Box>> boxes_;
};

// The lamp of an object that shines brightest on what is near it.
struct Bright {
  std::size_t light = 0;
  double distance_m = nearest_m;
  double times_white = 0;
  std::size_t count = 0;  // of the object's lamps that are too bright
};

std::string remark(const Scene& scene, const set::Object& object, const Bright& found,
                   const std::optional<double>& exposure) {
  const set::Light& light = scene.lights[found.light];
  const Unit unit = unit_of(light.type);
  const std::string others =
      found.count > 1 ? fmt::format(" (the worst of {})", found.count) : std::string();
  const std::string where =
      unit.falls_off ? fmt::format("at {} m", figure(found.distance_m)) : "that faces it";
  const double in_watts = found.times_white / lumens_per_watt;
  const std::string gains =
      object.lamp_gain == 1 && in_watts <= most_times_white
          ? fmt::format("lamp_gain = {:.4g} (1 / {:g})", 1 / lumens_per_watt, lumens_per_watt)
          : fmt::format("lamp_gain = {:.3g} (just white)", object.lamp_gain / found.times_white);
  return fmt::format(
      "object \"{}\": with its lamp \"{}\" of {}{} a white sheet {} is {} times white{}: 1 {} is "
      "used as 1 {}, which Blender's \"standard\" mode writes as {:g}; set the object's {}",
      set::one_line(object.name), set::one_line(light.name), given_words(scene, found.light),
      others, where, figure(found.times_white), assumption(exposure), unit.in_file, unit.in_set,
      lumens_per_watt, gains);
}

}  // namespace

std::string strength_words(const Scene& scene, std::size_t light,
                           const std::optional<double>& exposure) {
  const set::Light& lamp = scene.lights[light];
  const double times = radiance_of(lamp, nearest_m) * exposure.value_or(1);
  return fmt::format("{}{}: {} is {} times white{}", given_words(scene, light),
                     scene.light_objects[light] == no_object ? "" : " in its file",
                     unit_of(lamp.type).what_is_compared, figure(times), assumption(exposure));
}

std::vector<std::string> remarks_on_bright_lamps(const Scene& scene, const set::Set& set,
                                                 const std::optional<double>& exposure) {
  std::map<std::uint32_t, Bright> found;  // by object
  std::optional<Surroundings> surroundings;
  for (std::size_t i = 0; i < scene.lights.size(); ++i) {
    const std::uint32_t object = scene.light_objects[i];
    const set::Light& light = scene.lights[i];
    const double white = 1 / exposure.value_or(1);
    if (object == no_object || !(radiance_of(light, nearest_m) > most_times_white * white))
      continue;
    double distance_m = nearest_m;
    if (unit_of(light.type).falls_off) {
      if (!surroundings) surroundings.emplace(scene, set);
      distance_m = surroundings->distance_m(light, object);
    }
    const double times = radiance_of(light, distance_m) / white;
    if (!(times > most_times_white)) continue;
    Bright& bright = found[object];
    const std::size_t count = bright.count + 1;
    if (times > bright.times_white) bright = {i, distance_m, times, count};
    bright.count = count;
  }
  std::vector<std::string> remarks;
  for (const auto& [object, bright] : found)
    remarks.push_back(remark(scene, set.objects[object], bright, exposure));
  return remarks;
}

}  // namespace previz::scene
