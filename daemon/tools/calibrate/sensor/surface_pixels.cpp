#include "daemon/tools/calibrate/sensor/surface_pixels.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "daemon/core/lighting/response.hpp"
#include "daemon/core/pipeline/preview_size.hpp"
#include "daemon/core/pipeline/take_shots.hpp"
#include "daemon/core/scene/real_world.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

constexpr float diffuse_roughness = 0.5f;
constexpr int tiles_a_side = 4;
// About as many are rendered in half a second by a slow machine, and the progress then goes on.
constexpr double pixel_samples_a_piece = 200'000;
constexpr std::uint32_t no_surface = 0;  // in identity pictures surfaces count from 1

bool is_diffuse(const scene::Material& m) {
  const bool coated = m.specular > 0 && m.ior > 1 && m.roughness < diffuse_roughness;
  return m.metallic == 0 && m.transmission == 0 && m.emission == glm::vec3(0) && !coated &&
         m.metallic_roughness_texture == scene::no_texture &&
         m.alpha_mode == scene::AlphaMode::opaque;
}

// Calls `visit` with each diffuse material that is in use. A recoloured surface leaves its file's
// original material unused, under the same name.
template <typename Visit>
void each_diffuse(const scene::Scene& scene, Visit visit) {
  std::vector<bool> used(scene.materials.size());
  for (const scene::Instance& instance : scene.instances) used[instance.material] = true;
  for (std::size_t i = 0; i < scene.materials.size(); ++i)
    if (used[i] && is_diffuse(scene.materials[i])) visit(i);
}

std::vector<KnownSurface> surfaces_of(const scene::Scene& scene) {
  std::vector<KnownSurface> surfaces;
  each_diffuse(scene, [&](std::size_t i) {
    const scene::Material& material = scene.materials[i];
    if (std::ranges::find(surfaces, material.name, &KnownSurface::material) == surfaces.end())
      surfaces.push_back({material.name, glm::dvec3(material.base_color)});
  });
  return surfaces;
}

// Makes every surface of the real world glow with its number; surfaces that are not diffuse are
// black.
scene::Scene glowing(scene::Scene scene, const std::vector<KnownSurface>& surfaces) {
  std::vector<scene::Material> glows(scene.materials.size());
  for (std::size_t i = 0; i < glows.size(); ++i) {
    glows[i].name = scene.materials[i].name;
    glows[i].base_color = glm::vec3(0);
    glows[i].specular = 0;
  }
  each_diffuse(scene, [&](std::size_t i) {
    const auto known = std::ranges::find(surfaces, glows[i].name, &KnownSurface::material);
    const auto k = float(known - surfaces.begin() + 1);
    glows[i].emission = glm::vec3(k, k * k, 1);
  });
  scene.materials = std::move(glows);
  scene.lights.clear();
  return scene;
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

std::uint32_t tile_of(const Plate& plate, std::uint32_t frame, int x, int y) {
  const int column = x * tiles_a_side / plate.width, row = y * tiles_a_side / plate.height;
  return (frame * tiles_a_side + std::uint32_t(row)) * tiles_a_side + std::uint32_t(column);
}

}  // namespace

lighting::EnvironmentMap darkness() {
  lighting::EnvironmentMap map;
  map.size = 1;
  map.radiance = {glm::vec3(0)};
  return map;
}

set::Estimation paired(const set::Set& set) {
  set::Estimation estimation = set.estimation;
  estimation.estimator = set::Estimator::paired;
  estimation.composite = set::Composite::additive;
  return estimation;
}

void each_probed_shot(const pipeline::Take& take, int count,
                      const std::function<void(ProbedShot)>& visit) {
  const std::size_t frames = take.observer_stream->records().size();
  const auto shares = std::size_t(count);
  std::size_t share = 0;
  pipeline::TakeShotsOptions options;
  options.wanted = [&](std::uint64_t frame) {
    return share < shares && frame >= share * frames / shares;
  };
  options.lighting = lit_by_image(take.set.lighting);
  options.whole_light = true;
  options.from_start = false;
  bool found = false;
  for (pipeline::Shot& shot : pipeline::TakeShots(take, options)) {
    if (!shot.track.pose) continue;
    do ++share;
    while (share < shares && share * frames / shares <= shot.index);
    if (!shot.light) continue;
    found = true;
    visit({plate_of(shot), take.set.observer.exposure.value_or(shot.frame->exposure),
           shot.track.pose->world_from_camera, shot.light});
  }
  if (!found)
    throw Error(take.session.directory.string() +
                ": no frame has both a pose and light: nothing to balance");
}

void relight(std::vector<ProbedShot>& shots, const glm::dvec3& factors) {
  std::map<pipeline::LightPtr, pipeline::LightPtr> relit;  // frames may share theirs
  for (ProbedShot& shot : shots) {
    pipeline::LightPtr& of_shot = relit[shot.light];
    if (!of_shot) {
      pipeline::Light light = *shot.light;
      for (glm::vec3& radiance : light.lighting.environment.radiance) radiance *= factors;
      of_shot = std::make_shared<const pipeline::Light>(std::move(light));
    }
    shot.light = of_shot;
  }
}

SurfaceProbe::SurfaceProbe(const pipeline::Take& take, const scene::Scene& scene,
                           const std::shared_ptr<render::Device>& device, const ProbeSize& size,
                           PixelSamplesDone done)
    : take_(take),
      scale_(std::min(1.0, double(size.width) / take.observer.intrinsics.width)),
      small_(pipeline::scaled(take.observer, scale_)),
      identity_samples_(size.identity_samples),
      done_(std::move(done)),
      identity_(device, paired(take.set), small_),
      worlds_(device, paired(take.set), small_) {
  const scene::Scene real = scene::real_world(scene);
  seen_.surfaces = surfaces_of(real);
  identity_.set_scene(glowing(real, seen_.surfaces));
  identity_.set_environment(darkness(), set::LightSampling::bsdf);
}

void SurfaceProbe::add(const ProbedShot& shot) {
  const lighting::Response response(take_.observer.response, shot.plate->bits);
  ProbedShot small = shot;
  small.plate = std::make_shared<const Plate>(pipeline::scaled(*shot.plate, scale_, response));
  render(identity_, small, identity_samples_);
  add_pixels(*shot.plate, small, identity_.layers().real);
  shots_.push_back(std::move(small));
}

void SurfaceProbe::light_by(const pipeline::LightPtr& light) {
  for (ProbedShot& shot : shots_) shot.light = light;
}

void SurfaceProbe::render(render::Renderer& renderer, const ProbedShot& shot, int samples) {
  renderer.begin({shot.plate, shot.exposure, shot.world_from_camera});
  const double pixels = double(shot.plate->width) * shot.plate->height;
  const int piece = std::max(1, int(pixel_samples_a_piece / pixels));
  for (int at = 0; at < samples; at += piece) {
    const int count = std::min(piece, samples - at);
    renderer.render(count);
    if (!done_) continue;
    renderer.wait();
    done_(pixels * count);
  }
}

void SurfaceProbe::add_pixels(const Plate& full, const ProbedShot& small,
                              const render::Sheet<glm::vec3>& identity) {
  const Plate& plate = *small.plate;
  const lighting::Response response(take_.observer.response, plate.bits);
  const std::vector<bool> blind = blinded(full, plate.width, plate.height);
  const auto at = [&](int x, int y) {
    return std::size_t(y) * std::size_t(plate.width) + std::size_t(x);
  };
  const auto frame = static_cast<std::uint32_t>(seen_.world_from_cameras.size());
  const glm::dvec2 pixel_size(double(full.width) / plate.width, double(full.height) / plate.height);
  for (int y = 1; y + 1 < plate.height; ++y)
    for (int x = 1; x + 1 < plate.width; ++x) {
      const std::uint32_t surface = surface_of(identity[at(x, y)]);
      const bool alone = surface != no_surface && surface == surface_of(identity[at(x - 1, y)]) &&
                         surface == surface_of(identity[at(x + 1, y)]) &&
                         surface == surface_of(identity[at(x, y - 1)]) &&
                         surface == surface_of(identity[at(x, y + 1)]);
      if (!alone || blind[at(x, y)]) continue;
      SurfacePixel pixel{.surface = surface - 1,
                         .tile = tile_of(plate, frame, x, y),
                         .plate = {},
                         .rendered = {},
                         .frame = frame,
                         .px = (glm::dvec2(x, y) + 0.5) * pixel_size - 0.5};
      for (int c = 0; c < 3; ++c)
        pixel.plate[c] =
            response.inverse()[plate.samples[3 * at(x, y) + std::size_t(c)]] / small.exposure;
      seen_.pixels.push_back(pixel);
      places_.push_back(at(x, y));
    }
  seen_.world_from_cameras.push_back(small.world_from_camera);
}

SurfacePixels SurfaceProbe::compare(const scene::Scene& scene, int samples) {
  const scene::Scene real = scene::real_world(scene);
  SurfacePixels seen = seen_;
  seen.surfaces = surfaces_of(real);
  worlds_.set_scene(real);
  std::size_t next = 0;
  for (std::size_t i = 0; i < shots_.size(); ++i) {
    worlds_.set_environment(shots_[i].light->lighting.environment, take_.set.lighting.sampling);
    render(worlds_, shots_[i], samples);
    const render::Sheet<glm::vec3> rendered = worlds_.layers().real;
    for (; next < places_.size() && seen.pixels[next].frame == i; ++next)
      seen.pixels[next].rendered = glm::dvec3(rendered[places_[next]]);
  }
  return seen;
}

void append(const SurfacePixels& more, SurfacePixels& to) {
  const auto surfaces = std::uint32_t(to.surfaces.size());
  std::uint32_t free_tile = 0;
  for (const SurfacePixel& pixel : to.pixels) free_tile = std::max(free_tile, pixel.tile + 1);
  to.surfaces.insert(to.surfaces.end(), more.surfaces.begin(), more.surfaces.end());
  for (SurfacePixel pixel : more.pixels) {
    pixel.surface += surfaces;
    pixel.tile += free_tile;
    to.pixels.push_back(pixel);
  }
}

}  // namespace previz::calibrate
