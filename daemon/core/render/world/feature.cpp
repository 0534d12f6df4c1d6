#include "daemon/core/render/world/feature.hpp"

#include <algorithm>
#include <functional>
#include <glm/gtc/packing.hpp>
#include <span>
#include <stdexcept>
#include <vector>

#include "daemon/core/render/world/gpu_lights.hpp"
#include "daemon/core/scene/material_extensions.hpp"
#include "daemon/core/set/names.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {
namespace {

using scene::Material;
using scene::Scene;

bool is_textured(std::uint32_t texture) {
  return texture != scene::no_texture;
}

bool reflects(const Material& m, const Scene&, double) {
  return m.metallic > 0 || scene::has_coat(m);
}

bool glows(const Material& m, const Scene&, double) {
  return scene::emits(m);
}

// A texture may leave lacquer and sheen off some of the material.
bool can_be_bare(const Material& m) {
  const bool lacquered = m.clearcoat > 0 && !is_textured(m.clearcoat_texture);
  return !lacquered && (!scene::has_sheen(m) || is_textured(m.sheen_color_texture));
}

bool has_tangents(const Scene& scene) {
  return std::ranges::any_of(scene.meshes,
                             [](const scene::Mesh& mesh) { return !mesh.tangents.empty(); });
}

bool has_vertex_colors(const Scene& scene) {
  return std::ranges::any_of(scene.meshes,
                             [](const scene::Mesh& mesh) { return !mesh.colors.empty(); });
}

// Returns the least alpha of the colours that a mesh of this material states.
float least_vertex_alpha(const Material& m, const Scene& scene) {
  float least = 1;
  scene::for_each_look(scene, [&](std::uint32_t mesh, std::uint32_t material) {
    if (&scene.materials[material] != &m) return;
    for (const glm::vec4& color : scene.meshes[mesh].colors) least = std::min(least, color.a);
  });
  return least;
}

// Alpha is judged as the shaders see it: texels are half floats, and a value between two texels may
// be rounded below both.
bool lets_through(const Material& m, const Scene& scene, double) {
  if (m.alpha_mode == scene::AlphaMode::opaque) return false;
  float least = m.alpha, rounding = 0;
  if (is_textured(m.base_color_texture)) {
    float least_texel = 1;
    for (const glm::vec4& texel : scene.textures[m.base_color_texture].texels)
      least_texel = std::min(least_texel, texel.a);
    least_texel = glm::unpackHalf1x16(glm::packHalf1x16(least_texel));
    if (least_texel < 1) rounding = 1e-6f;
    least *= least_texel;
  }
  if (const float least_color = least_vertex_alpha(m, scene); least_color < 1) {
    // Colours are fractions of 16 bits, and between vertices a sum of three.
    least *= std::max(least_color - 1e-5f, 0.0f);
    rounding = 1e-6f;
  }
  return least * (1 - rounding) < (m.alpha_mode == scene::AlphaMode::mask ? m.alpha_cutoff : 1.0f);
}

// No ray hits a triangle with a corner that is not finite.
bool can_be_hit(const scene::Mesh& mesh) {
  return std::ranges::any_of(mesh.triangles, [&](const glm::uvec3& triangle) {
    glm::vec3 sum(0);
    for (int i = 0; i < 3; ++i) sum += 0.0f * mesh.positions[triangle[i]];
    return sum == glm::vec3(0);  // 0 times what is not finite is NaN
  });
}

// An object that is in neither world for now, because its carrier is lost, counts too, and so does
// a tag that a button can hide: no pipeline is compiled anew for them.
bool is_not_in_both(const scene::Instance& instance) {
  return instance.presence != scene::world_both || instance.tag != scene::TagPart::none;
}

bool lamps_shine(const Scene& scene) {
  const auto shines = [](const set::Light& light) {
    const glm::dvec3& e = light.emission;
    return (light.gain_mixed > 0 || light.gain_real > 0) && std::max({e.r, e.g, e.b}) > 0;
  };
  return std::ranges::any_of(scene.lights, shines) || scene::may_glow(scene);
}

// The features that no single extension of materials brings.
constexpr Feature own_features[] = {
    {.name = "two worlds",
     .bit = gpu::FEATURE_FORKS,
     .can_be_carried = true,
     .in_frame =
         [](bool, const Demand& d) {
           return std::ranges::any_of(d.scene.instances, is_not_in_both);
         },
     .used =
         "an object is virtual, removed, or a tag that can be hidden, so light is followed with "
         "it and without it"},
    {.name = "removed objects",
     .in_frame =
         [](bool, const Demand& d) {
           return std::ranges::find(d.scene.instances, scene::world_real,
                                    &scene::Instance::presence) != d.scene.instances.end();
         },
     .used = "a real object is removed from the picture"},
    {.name = "relighting",
     .in_frame =
         [](bool, const Demand& d) {
           return d.relights_captured || std::ranges::any_of(d.scene.lights, &set::Light::is_relit);
         },
     .used = "a lamp is added, switched off, dimmed, brightened or tinted"},
    {.name = "lens",
     .bit = gpu::FEATURE_LENS,
     .can_be_carried = true,
     .in_frame = [](bool, const Demand& d) { return d.has_aperture; },
     .used = "the aperture blurs what is out of focus"},
    {.name = "deforming objects",
     .in_frame = [](bool, const Demand& d) { return !d.scene.deformations.empty(); },
     .used = "an animated object bends or changes its shape"},
    {.name = "gloss",
     .bit = gpu::FEATURE_GLOSSY,
     .can_be_carried = true,
     .in_material = reflects,
     .used = "a surface reflects: metal, or the sheen of paint or plastic"},
    {.name = "metal",
     .in_material = [](const Material& m, const Scene&, double) { return m.metallic > 0; },
     .used = "an object is metal"},
    {.name = "refraction",
     .bit = gpu::FEATURE_TRANSMISSION,
     .can_be_carried = true,
     .in_material = [](const Material& m, const Scene&, double) { return scene::transmits(m); },
     .used = "light goes through glass or another clear material"},
    {.name = "panes",
     .bit = gpu::FEATURE_PANES,
     .can_be_carried = true,
     .in_material =
         [](const Material& m, const Scene& scene, double alpha) {
           return m.thin_walled && can_be_bare(m) && scene::transmits(m) &&
                  scene::can_be_dirac(scene, m, alpha);
         },
     .used = "light goes straight through thin panes of smooth glass"},
    {.name = "coloured glass",
     .bit = gpu::FEATURE_ATTENUATION,
     .can_be_carried = true,
     .in_material = [](const Material& m, const Scene&, double) { return scene::attenuates(m); },
     .used = "glass or a liquid tints light, the more the thicker it is"},
    {.name = "photons",
     .bit = gpu::FEATURE_PHOTONS,
     .in_material = [](const Material& m, const Scene& scene,
                       double alpha) { return scene::can_be_dirac(scene, m, alpha); },
     .in_frame =
         [](bool throws_light_on, const Demand& d) {
           return throws_light_on && d.estimation.caustics == set::Caustics::photons &&
                  (d.shines_around || d.finds_lamps || d.lamps_shine);
         },
     .used = "a mirror or clear glass throws patterns of light (caustics) onto other objects"},
    {.name = "traced caustics",
     .bit = gpu::FEATURE_CAUSTICS,
     .in_frame = [](bool,
                    const Demand& d) { return d.estimation.caustics == set::Caustics::traced; },
     .used = "light via mirrors and clear glass is found by chance, as the set file asks"},
    {.name = "textures",
     .bit = gpu::FEATURE_TEXTURES,
     .can_be_carried = true,
     .in_material =
         [](const Material& m, const Scene&, double) {
           return std::ranges::any_of(scene::material_textures,
                                      [&](auto texture) { return is_textured(m.*texture); });
         },
     .used = "a surface has its colour or detail from an image"},
    {.name = "texture mappings",
     .bit = gpu::FEATURE_MAPPINGS,
     .can_be_carried = true,
     .in_material =
         [](const Material& m, const Scene&, double) {
           return std::ranges::any_of(m.mappings, [](std::uint8_t mapping) { return mapping > 0; });
         },
     .used = "the images of a surface lie on it in different ways"},
    {.name = "vertex colours",
     .bit = gpu::FEATURE_VERTEX_COLORS,
     .can_be_carried = true,
     .in_frame = [](bool, const Demand& d) { return has_vertex_colors(d.scene); },
     .used = "a mesh has a colour of its own in each of its corners"},
    {.name = "filtered textures",
     .bit = gpu::FEATURE_FILTERED_TEXTURES,
     .in_material =
         [](const Material& m, const Scene&, double) {
           return is_textured(m.base_color_texture) || is_textured(m.metallic_roughness_texture) ||
                  is_textured(m.emission_texture);
         },
     .in_frame = [](bool textured,
                    const Demand& d) { return textured && d.estimation.filter_textures; },
     .used = "textures are averaged over the area that a sample covers"},
    {.name = "normal maps",
     .bit = gpu::FEATURE_NORMAL_MAPS,
     .can_be_carried = true,
     .in_material =
         [](const Material& m, const Scene&, double) {
           return is_textured(m.normal_texture) || is_textured(m.clearcoat_normal_texture);
         },
     .used = "a surface has its bumps from an image"},
    {.name = "tangents",
     .bit = gpu::FEATURE_TANGENTS,
     .can_be_carried = true,
     .in_material = [](const Material& m, const Scene&,
                       double) { return scene::has_directions(m); },
     .in_frame = [](bool directed, const Demand& d) { return directed && has_tangents(d.scene); },
     .used = "a mesh states which way its bumps or its brushed metal lie"},
    {.name = "alpha",
     .bit = gpu::FEATURE_ALPHA,
     .can_be_carried = true,
     .in_material = lets_through,
     .used = "a surface has holes or is see-through, by its material's alpha"},
    {.name = "lamps",
     .bit = gpu::FEATURE_LIGHTS,
     .can_be_carried = true,
     .in_material = glows,
     .in_frame = [](bool glow,
                    const Demand& d) { return glow || d.finds_lamps || !d.scene.lights.empty(); },
     .used = "the set or a model has lamps, a surface glows, or lamps are found in the environment "
             "light"},
    {.name = "lamps in view",
     .bit = gpu::FEATURE_VISIBLE_LIGHTS,
     .can_be_carried = true,
     .in_frame =
         [](bool, const Demand& d) {
           return d.finds_lamps || std::ranges::any_of(d.scene.lights, can_be_seen);
         },
     .used = "a lamp has a size, so it can be seen and reflected"},
    {.name = "many lamps",
     .bit = gpu::FEATURE_MANY_LIGHTS,
     .can_be_carried = true,
     .in_frame = [](bool, const Demand& d) { return are_many(d.scene); },
     .used = "of many lamps, each point uses those that are near and face it"},
    {.name = "glowing surfaces", .in_material = glows, .used = "a surface gives off light"},
    {.name = "environment light",
     .bit = gpu::FEATURE_ENVIRONMENT_SAMPLING,
     .in_frame =
         [](bool, const Demand& d) {
           return d.light_sampling == set::LightSampling::importance &&
                  (d.shines_around || d.finds_lamps);
         },
     .used = "rays are aimed at its brightest parts"},
    {.name = "difference only",
     .bit = gpu::FEATURE_DIFFERENCE,
     // The other composites need the real world's own radiance in every pixel.
     .in_frame =
         [](bool, const Demand& d) {
           return d.estimation.estimator == set::Estimator::difference &&
                  d.estimation.composite == set::Composite::additive;
         },
     .used = "pixels that nothing virtual covers are rendered only for what changes in them"},
    {.name = "camera's light",
     .bit = gpu::FEATURE_CAMERA,
     .in_frame =
         [](bool, const Demand& d) {
           return d.has_plate && d.estimation.real_radiance == set::RealRadiance::camera;
         },
     .used = "what the camera sees of the real set lights the virtual objects"},
    {.name = "denoiser",
     .in_frame = [](bool, const Demand& d) { return d.denoises; },
     .used = "noise is removed from the picture that is shown"},
};

Feature feature_of(const scene::MaterialFeature& feature) {
  return {.name = feature.name,
          .bit = feature.bit,
          .can_be_carried = true,
          .of_extension = feature.is_asked_for,
          .used = feature.used};
}

// Returns all features in the order in which `check` names them: those of extensions of materials
// follow gloss, the newest first, which has the highest bit.
std::vector<Feature> all_features() {
  std::vector<Feature> of_extensions;
  for (const scene::MaterialExtension& extension : scene::material_extensions())
    if (extension.feature) of_extensions.push_back(feature_of(*extension.feature));
  std::ranges::sort(of_extensions, std::ranges::greater(), &Feature::bit);
  std::vector<Feature> all;
  for (const Feature& own : own_features) {
    all.push_back(own);
    if (own.bit == gpu::FEATURE_GLOSSY)
      all.insert(all.end(), of_extensions.begin(), of_extensions.end());
    if (own.bit == gpu::FEATURE_TEXTURES) all.push_back(feature_of(scene::layer_texture_feature()));
  }
  if (all.size() > max_features) throw std::logic_error("more features than max_features");
  return all;
}

bool asks_for(const Material& material, const Feature& feature, const Scene& scene,
              double specular_alpha) {
  if (feature.of_extension) return feature.of_extension(material);
  return feature.in_material && feature.in_material(material, scene, specular_alpha);
}

}  // namespace

std::span<const Feature> features() {
  static const std::vector<Feature> all = all_features();
  return all;
}

MaterialFeatures material_features(const Scene& scene, double specular_alpha) {
  MaterialFeatures result;
  std::vector<bool> seen(scene.materials.size());
  scene::for_each_look(scene, [&](std::uint32_t mesh, std::uint32_t index) {
    if (seen[index] || !can_be_hit(scene.meshes[mesh])) return;
    seen[index] = true;
    const Material& material = scene.materials[index];
    for (std::size_t row = 0; row < features().size(); ++row)
      result[row] = result[row] || asks_for(material, features()[row], scene, specular_alpha);
  });
  return result;
}

bool is_needed(const Feature& feature, const Demand& demand) {
  const bool in_material = demand.materials[static_cast<std::size_t>(&feature - features().data())];
  return feature.in_frame ? feature.in_frame(in_material, demand) : in_material;
}

std::uint32_t needed_bits(const Demand& demand) {
  std::uint32_t bits = 0;
  for (const Feature& feature : features())
    if (feature.bit != 0 && is_needed(feature, demand)) bits |= feature.bit;
  return bits;
}

Demand demand_of(const set::Set& set, const Scene& scene, const MaterialFeatures& materials) {
  const set::Lighting& lighting = set.lighting;
  const auto& observer = set.observer.calibration;
  Demand demand{.scene = scene, .materials = materials, .estimation = set.estimation};
  demand.light_sampling = lighting.sampling;
  demand.shines_around = lighting.from != set::LightFrom::set || lighting.environment.has_value();
  demand.finds_lamps = lighting.mode != set::LightMode::image || !set.captured_lamps.empty();
  demand.relights_captured = std::ranges::any_of(set.captured_lamps, [](const auto& lamp) {
    return lamp.gain_mixed != 1 || lamp.tint != glm::dvec3(1);
  });
  demand.lamps_shine = lamps_shine(scene);
  demand.has_aperture = observer && observer->lens;
  demand.has_plate = true;
  demand.denoises = set.quality.denoise;
  return demand;
}

std::vector<std::uint32_t> reachable_bits(const set::Set& set, const Scene& scene,
                                          bool has_aperture) {
  std::vector<set::Estimator> estimators = {set.estimation.estimator};
  for (const auto& [name, estimator] : set::names(set::Estimator{}))
    if (estimator != set.estimation.estimator) estimators.push_back(estimator);
  const MaterialFeatures materials = material_features(scene, set.estimation.specular_roughness);
  set::Set pressed = set;
  std::vector<std::uint32_t> reachable;
  for (const bool finds_lamps : {false, true})
    for (const set::Estimator estimator : estimators) {
      pressed.estimation.estimator = estimator;
      Demand demand = demand_of(pressed, scene, materials);
      demand.has_aperture = has_aperture;
      demand.finds_lamps |= finds_lamps && demand.shines_around;
      const std::uint32_t bits = needed_bits(demand);
      if (std::ranges::find(reachable, bits) == reachable.end()) reachable.push_back(bits);
    }
  return reachable;
}

}  // namespace previz::render
