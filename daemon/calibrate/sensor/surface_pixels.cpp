#include "daemon/calibrate/sensor/surface_pixels.hpp"

#include <algorithm>
#include <cmath>

#include "daemon/lighting/response.hpp"
#include "daemon/pipeline/preview_size.hpp"
#include "daemon/pipeline/take_shots.hpp"
#include "daemon/scene/real_world.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

constexpr float diffuse_roughness = 0.5f;
constexpr int tiles_a_side = 4;
constexpr int identity_samples = 16;
constexpr std::uint32_t no_surface = 0;  // in identity pictures surfaces count from 1

bool is_diffuse(const scene::Material& m) {
  const bool coated = m.specular > 0 && m.ior > 1 && m.roughness < diffuse_roughness;
  return m.metallic == 0 && m.transmission == 0 && m.emission == glm::vec3(0) && !coated &&
         m.metallic_roughness_texture == scene::no_texture &&
         m.alpha_mode == scene::AlphaMode::opaque;
}

// Makes every surface of the real world glow with its number; surfaces that are not diffuse are
// black.
scene::Scene glowing(scene::Scene scene, std::vector<KnownSurface>& surfaces) {
  // A recoloured surface leaves its file's original material unused, under the same name.
  std::vector<bool> used(scene.materials.size());
  for (const scene::Instance& instance : scene.instances) used[instance.material] = true;
  for (std::size_t i = 0; i < scene.materials.size(); ++i) {
    scene::Material& material = scene.materials[i];
    scene::Material glow;
    glow.name = material.name;
    glow.base_color = glm::vec3(0);
    glow.specular = 0;
    if (used[i] && is_diffuse(material)) {
      auto known = std::ranges::find(surfaces, material.name, &KnownSurface::material);
      if (known == surfaces.end())
        known = surfaces.insert(surfaces.end(), {material.name, glm::dvec3(material.base_color)});
      const auto k = float(known - surfaces.begin() + 1);
      glow.emission = glm::vec3(k, k * k, 1);
    }
    material = glow;
  }
  scene.lights.clear();
  return scene;
}

lighting::EnvironmentMap darkness() {
  lighting::EnvironmentMap map;
  map.size = 1;
  map.radiance = {glm::vec3(0)};
  return map;
}

// Returns the number of the one surface that all samples of a pixel met, or no_surface.
std::uint32_t surface_of(const glm::vec3& mean) {
  constexpr float rounding = 1e-3f;
  if (std::abs(mean.b - 1) > rounding) return no_surface;
  const float k = std::round(mean.r);
  const bool is_one = std::abs(mean.r - k) <= rounding && std::abs(mean.g - k * k) <= rounding * k;
  return is_one ? std::uint32_t(k) : no_surface;
}

// Returns, for each scaled pixel, whether a sample of the plate under it is black or white.
std::vector<bool> blinded(const Plate& plate, int width, int height) {
  std::vector<bool> blind(std::size_t(width) * std::size_t(height));
  const int white = (1 << plate.bits) - 1;
  for (int y = 0; y < plate.height; ++y)
    for (int x = 0; x < plate.width; ++x) {
      const std::uint16_t* sample =
          &plate.samples[3 * (std::size_t(y) * std::size_t(plate.width) + std::size_t(x))];
      const bool ends =
          std::any_of(sample, sample + 3, [&](std::uint16_t v) { return v == 0 || v == white; });
      if (ends)
        blind[std::size_t(y * height / plate.height) * std::size_t(width) +
              std::size_t(x * width / plate.width)] = true;
    }
  return blind;
}

// Lights by the light camera's whole picture, including lamps: the comparison must depend neither
// on finding lamps nor on what the film camera sees.
set::Lighting lit_by_image(set::Lighting lighting) {
  lighting.mode = set::LightMode::image;
  if (lighting.unseen == set::UnseenRule::observer) lighting.unseen = set::UnseenRule::horizon;
  return lighting;
}

class Probe {
 public:
  Probe(const pipeline::Take& take, const scene::Scene& scene,
        const std::shared_ptr<render::Device>& device, const ProbeOptions& options)
      : take_(take),
        options_(options),
        scale_(std::min(1.0, double(options.width) / take.observer.intrinsics.width)),
        small_(pipeline::scaled(take.observer, scale_)),
        worlds_(device, paired(take.set), small_),
        identity_(device, paired(take.set), small_) {
    const scene::Scene real = scene::real_world(scene);
    worlds_.set_scene(real);
    identity_.set_scene(glowing(real, found_.surfaces));
    identity_.set_environment(darkness(), set::LightSampling::bsdf);
  }

  SurfacePixels run() {
    // The take is divided into equal shares, and the first tracked frame of each is probed.
    const std::size_t count = take_.observer_stream->records().size();
    const auto shares = std::size_t(options_.frames);
    std::size_t share = 0;
    pipeline::TakeShotsOptions options;
    options.wanted = [&](std::uint64_t frame) {
      return share < shares && frame >= share * count / shares;
    };
    options.lighting = lit_by_image(take_.set.lighting);
    options.whole_light = true;
    options.from_start = false;
    for (pipeline::Shot& shot : pipeline::TakeShots(take_, options)) {
      if (!shot.track.pose) continue;
      do ++share;
      while (share < shares && share * count / shares <= shot.index);
      if (!shot.light) continue;
      worlds_.set_environment(shot.light->lighting.environment, take_.set.lighting.sampling);
      add(shot);
      if (options_.each_shot) options_.each_shot(shot);
    }
    if (found_.world_from_cameras.empty())
      throw Error(take_.session.directory.string() +
                  ": no frame has both a pose and light: nothing to balance");
    return std::move(found_);
  }

 private:
  static set::Estimation paired(const set::Set& set) {
    set::Estimation estimation = set.estimation;
    estimation.estimator = set::Estimator::paired;
    estimation.composite = set::Composite::additive;
    return estimation;
  }

  void add(pipeline::Shot& shot) {
    const Plate& full = *plate_of(shot);
    const lighting::Response response(take_.observer.response, full.bits);
    const auto scaled_plate =
        std::make_shared<const Plate>(pipeline::scaled(full, scale_, response));
    const Plate& plate = *scaled_plate;
    const double exposure = take_.set.observer.exposure.value_or(shot.frame->exposure);
    const render::FrameInput input{scaled_plate, exposure, shot.track.pose->world_from_camera};
    identity_.begin(input);
    identity_.render(identity_samples);
    worlds_.begin(input);
    worlds_.render(options_.samples);
    const std::vector<glm::vec3> identity = identity_.layers().real;
    const std::vector<glm::vec3> real = worlds_.layers().real;
    const std::vector<bool> blind = blinded(full, plate.width, plate.height);
    const auto at = [&](int x, int y) {
      return std::size_t(y) * std::size_t(plate.width) + std::size_t(x);
    };
    const auto frame = static_cast<std::uint32_t>(found_.world_from_cameras.size());
    const glm::dvec2 pixel_size(double(full.width) / plate.width,
                                double(full.height) / plate.height);
    for (int y = 1; y + 1 < plate.height; ++y)
      for (int x = 1; x + 1 < plate.width; ++x) {
        const std::uint32_t surface = surface_of(identity[at(x, y)]);
        const bool alone = surface != no_surface && surface == surface_of(identity[at(x - 1, y)]) &&
                           surface == surface_of(identity[at(x + 1, y)]) &&
                           surface == surface_of(identity[at(x, y - 1)]) &&
                           surface == surface_of(identity[at(x, y + 1)]);
        if (!alone || blind[at(x, y)]) continue;
        SurfacePixel pixel{.surface = surface - 1,
                           .tile = tile(plate, frame, x, y),
                           .plate = {},
                           .rendered = glm::dvec3(real[at(x, y)]),
                           .frame = frame,
                           .px = (glm::dvec2(x, y) + 0.5) * pixel_size - 0.5};
        for (int c = 0; c < 3; ++c)
          pixel.plate[c] =
              response.inverse()[plate.samples[3 * at(x, y) + std::size_t(c)]] / exposure;
        found_.pixels.push_back(pixel);
      }
    found_.world_from_cameras.push_back(shot.track.pose->world_from_camera);
  }

  static std::uint32_t tile(const Plate& plate, std::uint32_t frame, int x, int y) {
    const int column = x * tiles_a_side / plate.width, row = y * tiles_a_side / plate.height;
    return (frame * tiles_a_side + std::uint32_t(row)) * tiles_a_side + std::uint32_t(column);
  }

  const pipeline::Take& take_;
  const ProbeOptions options_;
  const double scale_;
  const ObserverCalibration small_;
  render::Renderer worlds_, identity_;
  SurfacePixels found_;
};

}  // namespace

void append(const SurfacePixels& more, SurfacePixels& to) {
  const auto surfaces = std::uint32_t(to.surfaces.size());
  std::uint32_t tiles = 0;
  for (const SurfacePixel& pixel : to.pixels) tiles = std::max(tiles, pixel.tile + 1);
  to.surfaces.insert(to.surfaces.end(), more.surfaces.begin(), more.surfaces.end());
  for (SurfacePixel pixel : more.pixels) {
    pixel.surface += surfaces;
    pixel.tile += tiles;
    to.pixels.push_back(pixel);
  }
}

SurfacePixels probe_surfaces(const pipeline::Take& take, const scene::Scene& scene,
                             const std::shared_ptr<render::Device>& device,
                             const ProbeOptions& options) {
  return Probe(take, scene, device, options).run();
}

}  // namespace previz::calibrate
