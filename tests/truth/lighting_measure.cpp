#include "tests/truth/lighting_measure.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>
#include <numbers>
#include <regex>

#include "daemon/core/lighting/exr_picture.hpp"
#include "daemon/core/lighting/resampling.hpp"
#include "daemon/core/scene/load.hpp"
#include "daemon/core/scene/scene.hpp"
#include "drivers/error.hpp"
#include "tests/truth/cpu_geometry.hpp"
#include "tests/truth/truth_take.hpp"

namespace previz::truth {
namespace {

using lighting::EnvironmentMap;
using std::numbers::pi;

constexpr double degree = pi / 180;

FramePtr read_light_frame(const LightFrame& file) {
  Frame frame = frame_from_png(file.file, "light");
  frame.timestamp_ns = file.timestamp_ns;
  frame.exposure = file.exposure;
  return std::make_shared<Frame>(std::move(frame));
}

// Per texel: whether the camera sees the environment there.
std::vector<bool> comparable(const TruthSet& set, int size) {
  set::Set phantom = set_of(set);
  phantom.objects.pop_back();
  const scene::Scene scene = scene::load_scene(phantom);
  Geometry geometry(scene);
  const glm::dmat4& pose = set.light_camera->world_from_camera;
  geometry.place(glm::dvec3(pose[3]));
  std::vector<bool> seen;
  for (int j = 0; j < size; ++j) {
    for (int i = 0; i < size; ++i) {
      const Ray ray{glm::dvec3(0),
                    glm::normalize(glm::dvec3(lighting::texel_direction(size, i, j)))};
      seen.push_back(glm::dot(ray.direction, glm::dvec3(pose[2])) > std::cos(100 * degree) &&
                     !geometry.blocked(ray, 1e6, scene::world_both));
    }
  }
  return seen;
}

EnvironmentMap masked(EnvironmentMap map, const std::vector<bool>& keep) {
  for (std::size_t t = 0; t < keep.size(); ++t)
    if (!keep[t]) map.radiance[t] = glm::vec3(0);
  return map;
}

constexpr int planes = 64;

// Of planes whose normals are a spherical Fibonacci lattice on the upper hemisphere.
std::array<glm::dvec3, planes> irradiances(const EnvironmentMap& map) {
  std::array<glm::dvec3, planes> normals{}, sums{};
  for (std::size_t n = 0; n < planes; ++n) {
    const double z = (static_cast<double>(n) + 0.5) / planes, r = std::sqrt(1 - z * z);
    const double azimuth = 2 * pi * static_cast<double>(n) / std::numbers::phi;
    normals[n] = {r * std::cos(azimuth), r * std::sin(azimuth), z};
  }
  for (int j = 0; j < map.size; ++j) {
    for (int i = 0; i < map.size; ++i) {
      const glm::dvec3 direction(lighting::texel_direction(map.size, i, j));
      const glm::dvec3 radiance(map.radiance[static_cast<std::size_t>(j * map.size + i)]);
      for (std::size_t n = 0; n < planes; ++n)
        sums[n] += std::max(0.0, glm::dot(direction, normals[n])) * radiance;
    }
  }
  return sums;  // but for the texels' solid angle, the same for all
}

IrradianceError compare_irradiance(const EnvironmentMap& map, const EnvironmentMap& truth) {
  const auto measured = irradiances(map), expected = irradiances(truth);
  IrradianceError error;
  for (std::size_t n = 0; n < planes; ++n) {
    const glm::dvec3 relative = glm::abs(measured[n] / expected[n] - 1.0);
    for (int c = 0; c < 3; ++c) {
      error.mean += relative[c] / (3 * planes);
      error.worst = std::max(error.worst, relative[c]);
    }
  }
  return error;
}

std::vector<Lamp> stated_lamps(const TruthSet& set) {
  nlohmann::json json;
  std::ifstream(set.directory / "set.json") >> json;
  const std::string text = json.at("env").at("source");
  static const std::regex lamp(
      R"(lamp (\w+) azimuth ([-\d.]+) deg elevation ([-\d.]+) deg radius ([\d.]+) deg)");
  std::vector<Lamp> lamps;
  for (std::sregex_iterator match(text.begin(), text.end(), lamp), end; match != end; ++match) {
    const double azimuth = std::stod((*match)[2]) * degree;
    const double elevation = std::stod((*match)[3]) * degree;
    lamps.push_back({(*match)[1],
                     {std::cos(elevation) * std::cos(azimuth),
                      std::cos(elevation) * std::sin(azimuth), std::sin(elevation)},
                     std::stod((*match)[4]) * degree});
  }
  return lamps;
}

struct MeasuredLamp {
  glm::dvec3 flux{0};       // above the ring around it
  glm::dvec3 direction{0};  // centre of gravity, unit
};

// The lamp reaches to a degree beyond its stated radius, the ring two degrees further.
MeasuredLamp measure_lamp(const EnvironmentMap& map, const Lamp& lamp) {
  const double inner = std::cos(lamp.radius_rad + degree);
  const double outer = std::cos(lamp.radius_rad + 3 * degree);
  glm::dvec3 inside(0), ring(0), moment(0);
  int inside_texels = 0, ring_texels = 0;
  for (int j = 0; j < map.size; ++j) {
    for (int i = 0; i < map.size; ++i) {
      const glm::dvec3 direction(lighting::texel_direction(map.size, i, j));
      const double cosine = glm::dot(direction, lamp.direction);
      if (cosine < outer) continue;
      const glm::dvec3 radiance(map.radiance[static_cast<std::size_t>(j * map.size + i)]);
      if (cosine < inner) {
        ring += radiance;
        ++ring_texels;
      } else {
        inside += radiance;
        moment += (radiance.r + radiance.g + radiance.b) * direction;
        ++inside_texels;
      }
    }
  }
  const double background = static_cast<double>(inside_texels) / std::max(ring_texels, 1);
  return {(inside - background * ring) * lighting::texel_sr(map.size), glm::normalize(moment)};
}

SourceError nearest_source(const Lamp& lamp, const glm::dvec3& true_flux,
                           const std::vector<lighting::Source>& sources) {
  const lighting::Source& source = *std::ranges::max_element(
      sources, {}, [&](const auto& s) { return glm::dot(s.direction, lamp.direction); });
  return {lamp, std::acos(std::min(glm::dot(source.direction, lamp.direction), 1.0)),
          lighting::angular_radius(source) / lamp.radius_rad, source.flux / true_flux};
}

std::optional<IrradianceError> measure_resampling(const TruthSet& set, const EnvironmentMap& truth,
                                                  const std::vector<bool>& keep) {
  const std::filesystem::path file = set.directory / "light" / "fisheye_true.exr";
  if (!std::filesystem::exists(file)) return std::nullopt;
  std::vector<std::string> notes;
  lighting::LinearPicture picture = lighting::read_exr_picture(file, notes);
  lighting::HdrPicture hdr{picture.width, picture.height, std::move(picture.radiance), {}};
  hdr.flags.resize(hdr.radiance.size());
  const LightCameraCalibration& camera = *set.light_camera;
  const Fisheye lens(camera.intrinsics);
  lighting::Resampled map = lighting::resample(
      lighting::make_resampling(lens, lighting::Viewpoint(glm::dmat3(camera.world_from_camera)),
                                truth.size),
      hdr);
  return compare_irradiance(masked({truth.size, std::move(map.radiance)}, keep), truth);
}

}  // namespace

std::vector<FramePtr> load_light_frames(const TruthSet& set) {
  std::vector<FramePtr> frames;
  for (const LightFrame& file : set.light_frames) frames.push_back(read_light_frame(file));
  return frames;
}

LightingMeasure measure_lighting(const TruthSet& set, const std::vector<FramePtr>& frames,
                                 const set::Lighting& settings) {
  if (!set.light_camera) throw Error(set.directory.string() + ": the set has no light camera");
  LightingMeasure measure;
  measure.captured = lighting::estimate(frames, *set.light_camera, settings);
  const EnvironmentMap& map = measure.captured.environment;

  set::Lighting environment;
  environment.environment = set.environment;
  environment.resolution = map.size;
  measure.truth = lighting::load_environment(environment).environment;

  const std::vector<bool> keep = comparable(set, map.size);
  measure.compared_sr = static_cast<double>(std::count(keep.begin(), keep.end(), true)) *
                        lighting::texel_sr(map.size);
  const EnvironmentMap masked_truth = masked(measure.truth, keep);
  measure.irradiance = compare_irradiance(masked(map, keep), masked_truth);
  measure.sphere = compare_irradiance(map, measure.truth);
  measure.resampling = measure_resampling(set, masked_truth, keep);
  measure.extraction = lighting::extract_sources(map, settings.sources);
  for (const Lamp& lamp : stated_lamps(set)) {
    const MeasuredLamp measured = measure_lamp(map, lamp);
    const MeasuredLamp truth = measure_lamp(measure.truth, lamp);
    const double cosine = glm::dot(measured.direction, lamp.direction);
    measure.lamps.push_back({lamp, std::acos(std::min(cosine, 1.0)), measured.flux / truth.flux});
    if (!measure.extraction.sources.empty())
      measure.sources.push_back(nearest_source(lamp, truth.flux, measure.extraction.sources));
  }
  return measure;
}

}  // namespace previz::truth
