#include "daemon/model/colours.hpp"

#include <algorithm>
#include <glm/common.hpp>

#include "daemon/calibrate/sensor/balance_fit.hpp"
#include "daemon/calibrate/sensor/surface_pixels.hpp"
#include "daemon/scene/load.hpp"

namespace previz::model {
namespace {

constexpr int most_rounds = 6;
// An albedo that changes by less, over itself, is the last.
constexpr double settled_change = 2e-3;
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

}  // namespace

std::map<std::string, Colour> measure_colours(const pipeline::Take& take,
                                              const std::vector<NamedMesh>& meshes,
                                              const std::shared_ptr<render::Device>& device) {
  scene::Scene scene = scene_of(take, meshes, {});
  std::map<std::string, Colour> colours;
  for (int round = 0; round < most_rounds; ++round) {
    const calibrate::SurfacePixels seen = calibrate::probe_surfaces(take, scene, device, {});
    const calibrate::Balance balance = calibrate::fit_balance(seen, {});
    double most_change = 0;
    for (const calibrate::SurfaceRatio& ratio : balance.surfaces) {
      const calibrate::KnownSurface& known = seen.surfaces[ratio.surface];
      const auto material =
          std::ranges::find(scene.materials, known.material, &scene::Material::name);
      // The balance is that of the set, and not the one in which these guesses would be right.
      const auto estimate = calibrate::albedo_of(ratio, known, calibrate::Balance{});
      const glm::dvec3 albedo = glm::clamp(estimate.albedo, least_albedo, most_albedo);
      for (glm::length_t c = 0; c < 3; ++c)
        most_change = std::max(most_change, std::abs(albedo[c] / known.albedo[c] - 1));
      material->base_color = glm::vec3(albedo);
      colours[known.material] = {estimate.albedo, estimate.sigma, ratio.pixels};
    }
    if (most_change < settled_change) break;
  }
  return colours;
}

calibrate::SurfacePixels compare_surfaces(const pipeline::Take& take,
                                          const std::vector<NamedMesh>& meshes,
                                          const Colours& colours, int width,
                                          const std::shared_ptr<render::Device>& device) {
  calibrate::ProbeOptions options;
  options.width = width;
  return calibrate::probe_surfaces(take, scene_of(take, meshes, colours), device, options);
}

}  // namespace previz::model
