#include "daemon/tools/model/colours.hpp"

#include <fmt/ostream.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <glm/common.hpp>
#include <glm/exponential.hpp>

#include "daemon/core/pipeline/light_figure.hpp"
#include "daemon/core/scene/load.hpp"
#include "daemon/tools/calibrate/sensor/balance_fit.hpp"
#include "daemon/tools/calibrate/sensor/paper.hpp"

namespace previz::model {
namespace {

// Surfaces light each other by so little that a round leaves about a tenth of what the albedos are
// off. Rounds end when no albedo changes by more, over itself: the first ones, which only come
// near, and the last.
constexpr double nearly_settled = 5e-2, settled = 2e-3;
constexpr int most_rounds = 6;  // each time
constexpr int coarse_samples = 4, fine_samples = 64, around_samples = 4;
// Pictures are so wide, as far as the camera's are: to measure colours, and to see around tags.
constexpr calibrate::ProbeSize probe_of_colours{160, 16}, probe_around_tags{400, 2};
constexpr int probed_frames = 3;
constexpr int paper_samples = 64;
// No paint reflects less or more; the round that guesses such an albedo has a wrong light or model.
constexpr double least_albedo = 0.005, most_albedo = 0.98;

// Adds a mesh in the world, of a matt material of its name.
void add(const NamedMesh& named, const glm::dvec3& albedo, scene::Scene& scene) {
  const ShadedMesh& from = named.mesh;
  scene::Mesh mesh;
  mesh.name = named.name;
  mesh.positions = from.positions;
  mesh.normals = from.normals;
  for (std::size_t i = 0; i + 2 < from.indices.size(); i += 3)
    mesh.triangles.emplace_back(from.indices[i], from.indices[i + 1], from.indices[i + 2]);
  scene::Material matt;
  matt.name = named.name;
  matt.base_color = glm::vec3(albedo);
  matt.specular = 0;
  const auto index = static_cast<std::uint32_t>(scene.meshes.size());
  scene.instances.push_back({.name = named.name, .mesh = index, .material = index});
  scene.meshes.push_back(std::move(mesh));
  scene.materials.push_back(std::move(matt));
}

// The set's lamps and the model, grey where it has no colour.
scene::Scene scene_of(const pipeline::Take& take, const std::vector<NamedMesh>& meshes,
                      const Colours& colours) {
  set::Set lamps_only = take.set;
  lamps_only.objects.clear();
  lamps_only.surfaces.clear();
  scene::Scene scene = scene::load_scene(lamps_only);
  for (const NamedMesh& mesh : meshes) {
    const auto colour = colours.find(mesh.name);
    add(mesh, colour == colours.end() ? glm::dvec3(0.5) : colour->second, scene);
  }
  return scene;
}

// What the plates have over what is rendered, by material.
using SeenRatios = std::map<std::string, calibrate::SurfaceRatio>;

SeenRatios ratios_of(const calibrate::SurfacePixels& seen) {
  SeenRatios ratios;
  for (const calibrate::SurfaceRatio& ratio : calibrate::fit_balance(seen, {}).surfaces)
    ratios[seen.surfaces[ratio.surface].material] = ratio;
  return ratios;
}

// Multiplies albedos by the ratios, and returns the largest change.
double correct(scene::Scene& scene, const SeenRatios& ratios,
               std::map<std::string, Colour>& colours) {
  double most_change = 0;
  for (const auto& [name, ratio] : ratios) {
    const auto material = std::ranges::find(scene.materials, name, &scene::Material::name);
    const glm::dvec3 before(material->base_color);
    // The balance is that of the set, and not the one in which these guesses would be right.
    const auto estimate = calibrate::albedo_of(ratio, {name, before}, calibrate::Balance{});
    const glm::dvec3 albedo = glm::clamp(estimate.albedo, least_albedo, most_albedo);
    for (glm::length_t c = 0; c < 3; ++c)
      most_change = std::max(most_change, std::abs(albedo[c] / before[c] - 1));
    material->base_color = glm::vec3(albedo);
    colours[name] = {estimate.albedo, estimate.sigma, ratio.pixels};
  }
  return most_change;
}

// Returns the fine ratios, which were measured when the coarse ones were `then`, as they are now.
// With the same random numbers, both change alike.
SeenRatios brought_forward(SeenRatios fine, const SeenRatios& then, const SeenRatios& now) {
  for (auto& [name, ratio] : fine) {
    const auto before = then.find(name), after = now.find(name);
    ratio.ratio = before == then.end() || after == now.end()
                      ? glm::dvec3(1)
                      : ratio.ratio * after->second.ratio / before->second.ratio;
  }
  return fine;
}

double now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::vector<calibrate::ProbedShot> shots_of(const pipeline::Take& take) {
  std::vector<calibrate::ProbedShot> shots;
  calibrate::each_probed_shot(
      take, probed_frames, [&](calibrate::ProbedShot shot) { shots.push_back(std::move(shot)); });
  return shots;
}

double pixels_of(const pipeline::Take& take, std::size_t shots, const calibrate::ProbeSize& size) {
  const PinholeIntrinsics& lens = take.observer.intrinsics;
  const double scale = std::min(1.0, double(size.width) / lens.width);
  return double(shots) * scale * lens.width * scale * lens.height;
}

}  // namespace

ColourComparison::ColourComparison(pipeline::Take take, std::shared_ptr<render::Device> device,
                                   bool has_tags, std::ostream& out, bool terminal)
    : take_(std::move(take)),
      device_(std::move(device)),
      shots_(shots_of(take_)),
      rounds_work_(pixels_of(take_, shots_.size(), probe_of_colours) *
                   (probe_of_colours.identity_samples + (2 * most_rounds + 1) * coarse_samples +
                    fine_samples)),
      out_(out),
      progress_(out, terminal,
                rounds_work_ + (has_tags ? pixels_of(take_, shots_.size(), probe_around_tags) *
                                               (probe_around_tags.identity_samples + around_samples)
                                         : 0),
                now_s()) {}

void ColourComparison::worked(double pixel_samples) {
  done_ += pixel_samples;
  progress_.worked(step_, pixel_samples, now_s());
}

void ColourComparison::fit_to_paper(const scene::Scene& scene) {
  // What the set has already may take light from the tags that the new model does not take.
  const bool has_phantom = std::ranges::find(take_.set.objects, set::Presence::phantom,
                                             &set::Object::presence) != take_.set.objects.end();
  calibrate::Paper paper(take_.set, take_.observer,
                         has_phantom ? scene::load_scene(take_.set) : scene, device_,
                         paper_samples);
  for (const calibrate::ProbedShot& shot : shots_) paper.look_at(shot);
  if (paper.seen().pixels.empty()) return;
  const calibrate::Balance balance = calibrate::fit_balance(paper.seen(), {});
  calibrate::relight(shots_, balance.scale);
  const glm::dvec3& scale = balance.scale;
  const glm::dvec3 stops = glm::abs(glm::log2(scale));
  if (std::max({stops.r, stops.g, stops.b}) > pipeline::light_off_stops)
    fmt::print(
        out_,
        "by the tags' paper, the set's light is to be multiplied by {:.2f} {:.2f} {:.2f}, and "
        "colours are measured as under that light: previz calibrate balance writes it into "
        "the set\n",
        scale.r, scale.g, scale.b);
}

std::unique_ptr<calibrate::SurfaceProbe> ColourComparison::probe(const scene::Scene& scene,
                                                                 const calibrate::ProbeSize& size) {
  auto surfaces = std::make_unique<calibrate::SurfaceProbe>(
      take_, scene, device_, size, [this](double samples) { worked(samples); });
  for (const calibrate::ProbedShot& shot : shots_) surfaces->add(shot);
  return surfaces;
}

std::map<std::string, Colour> ColourComparison::measure(const std::vector<NamedMesh>& meshes) {
  scene::Scene scene = scene_of(take_, meshes, {});
  fit_to_paper(scene);
  step_ = "colours: finding which surfaces the pictures show";
  const auto surfaces = probe(scene, probe_of_colours);
  std::map<std::string, Colour> colours;
  const auto ratios = [&](int samples) { return ratios_of(surfaces->compare(scene, samples)); };
  const auto begin = [&](const char* step) {
    progress_.step_done(step_, now_s());
    step_ = step;
  };
  begin("colours: first rounds");
  for (int round = 0; round < most_rounds; ++round)
    if (correct(scene, ratios(coarse_samples), colours) < nearly_settled) break;
  begin("colours: fine round");
  const SeenRatios then = ratios(coarse_samples), fine = ratios(fine_samples);
  correct(scene, fine, colours);
  begin("colours: last rounds");
  for (int round = 0; round < most_rounds; ++round)
    if (correct(scene, brought_forward(fine, then, ratios(coarse_samples)), colours) < settled)
      break;
  worked(rounds_work_ - done_);  // the rounds that were not needed
  progress_.step_done(step_, now_s());
  return colours;
}

calibrate::SurfacePixels ColourComparison::look_around(const std::vector<NamedMesh>& meshes,
                                                       const Colours& colours) {
  step_ = "colours: looking around tags";
  const scene::Scene scene = scene_of(take_, meshes, colours);
  calibrate::SurfacePixels seen = probe(scene, probe_around_tags)->compare(scene, around_samples);
  progress_.step_done(step_, now_s(), true);
  return seen;
}

}  // namespace previz::model
