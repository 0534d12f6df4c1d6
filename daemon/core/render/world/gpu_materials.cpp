#include "daemon/core/render/world/gpu_materials.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <map>
#include <tuple>
#include <variant>

#include "daemon/core/render/world/albedo_table.hpp"
#include "daemon/core/scene/material_extensions.hpp"
#include "drivers/error.hpp"

namespace previz::render {
namespace {

// Returns in how many steps of its strength an anisotropy needs albedo tables; 0: it has one
// strength.
std::uint32_t anisotropy_steps(const scene::Material& m) {
  return m.anisotropy_texture != scene::no_texture ? gpu::ANISOTROPIC_STEPS : 0;
}

// Concatenates the albedo tables: reflection's first, if anything is rough or has sheen, then that
// of sheen, then those of each glass and of each anisotropic metal.
struct AlbedoTables {
  std::vector<float> values{1};  // a placeholder that no shader reads
  std::map<float, std::uint32_t> of_ior;
  // Keys: strength, roughness, whether a texture makes it smoother, and whether one changes the
  // strength.
  std::map<std::tuple<float, float, bool, bool>, std::uint32_t> of_anisotropy;

  explicit AlbedoTables(bool has_sheen) {
    if (!has_sheen) return;
    values = reflection_albedo();
    add(sheen_albedo());
  }

  std::uint32_t first_of(const scene::Material& m, double specular_alpha) {
    const bool glass = scene::transmits(m);
    // The shader's sum is in floats.
    const bool is_mirror = scene::widest_alpha(m, m.roughness) <= specular_alpha * (1 - 1e-5);
    if (is_mirror || !(glass || m.metallic > 0)) return 0;
    if (values.size() == 1) values = reflection_albedo();
    if (scene::is_anisotropic(m)) return first_of_anisotropy(m);
    if (!glass || m.thin_walled || m.ior < gpu::LEAST_ROUGH_IOR) return 0;
    const auto [at, is_new] = of_ior.try_emplace(m.ior, next());
    if (is_new)
      for (const double eta : {1.0 * m.ior, 1.0 / m.ior}) add(refraction_albedo(eta));
    return at->second;
  }

 private:
  std::uint32_t first_of_anisotropy(const scene::Material& m) {
    const bool varies = m.metallic_roughness_texture != scene::no_texture;
    const bool has_steps = anisotropy_steps(m) > 0;
    const auto [at, is_new] =
        of_anisotropy.try_emplace({m.anisotropy, m.roughness, varies, has_steps}, next());
    const std::uint32_t steps = has_steps ? gpu::ANISOTROPIC_STEPS : 1;
    for (std::uint32_t step = 1; is_new && step <= steps; ++step)
      add(anisotropic_albedo(m.anisotropy * step / steps, varies ? 0.0 : m.roughness, m.roughness));
    return at->second;
  }

  std::uint32_t next() const {
    constexpr std::size_t table_size = std::size_t{gpu::ALBEDO_SIDE} * gpu::ALBEDO_SIDE;
    return static_cast<std::uint32_t>(values.size() / table_size);
  }
  void add(const AlbedoTable& tables) { values.insert(values.end(), tables.begin(), tables.end()); }
};

// Returns the direction of an anisotropy times its strength, as the shaders want it.
glm::vec2 anisotropy_of(const scene::Material& m) {
  if (!scene::is_anisotropic(m)) return glm::vec2(0);
  return m.anisotropy *
         glm::vec2(std::cos(m.anisotropy_rotation_rad), std::sin(m.anisotropy_rotation_rad));
}

// Returns the mappings of all textures, packed for mapping_of() of the shaders.
std::array<std::uint32_t, 2> packed_mappings(const scene::Material& m) {
  static_assert(scene::max_mappings <= 16);
  std::array<std::uint32_t, 2> packed{};
  for (std::size_t i = 0; i < m.mappings.size(); ++i)
    packed[i / 8] |= static_cast<std::uint32_t>(m.mappings[i]) << 4 * (i % 8);
  return packed;
}

// Sets the factors that the table of extensions packs.
void set_factors(const scene::Material& m, gpu::GpuMaterial& to) {
  for (const scene::MaterialExtension& extension : scene::material_extensions())
    for (const scene::Factor& factor : extension.factors)
      std::visit(
          [&](const auto& value) {
            if (value.packed) to.*value.packed = glm::max(m.*value.member, factor.supported);
          },
          factor.value);
}

// Adds the textures of extensions.
void set_layers(const scene::Material& m, gpu::GpuMaterial& to) {
  for (std::uint32_t i = 0; i < gpu::LAYERS; ++i) {
    to.layer_textures[i] = m.*scene::material_textures[scene::first_layer_texture + i];
    if (to.layer_textures[i] != scene::no_texture) to.layers |= 1u << i;
  }
  const auto mappings = packed_mappings(m);
  std::ranges::copy(mappings, to.mappings);
}

// A path has so many bits to say which medium it is in.
void check_medium(const scene::Material& material, std::size_t index) {
  if (index >= gpu::MAX_MEDIUM && scene::attenuates(material))
    throw Error("scene: material \"" + material.name +
                "\" has an attenuation colour but is number " + std::to_string(index + 1) +
                "; only the first " + std::to_string(gpu::MAX_MEDIUM) + " can have one");
}

}  // namespace

EncodedMaterials encode_materials(std::span<const scene::Material> materials,
                                  double specular_alpha) {
  EncodedMaterials result;
  AlbedoTables albedo(std::ranges::any_of(materials, scene::has_sheen));
  for (const scene::Material& m : materials) {
    check_medium(m, result.materials.size());
    gpu::GpuMaterial& to = result.materials.emplace_back();
    to.base_color = m.base_color;
    to.metallic = m.metallic;
    to.emission = m.emission;
    to.roughness = m.roughness;
    to.thin_walled = m.thin_walled ? 1u : 0u;
    to.base_color_texture = m.base_color_texture;
    to.metallic_roughness_texture = m.metallic_roughness_texture;
    to.emission_texture = m.emission_texture;
    to.normal_texture = m.normal_texture;
    to.normal_scale = m.normal_scale;
    to.alpha_mode = static_cast<std::uint32_t>(m.alpha_mode);
    to.alpha = m.alpha;
    to.alpha_cutoff = m.alpha_cutoff;
    to.albedo_table = albedo.first_of(m, specular_alpha);
    to.attenuation = scene::attenuation_per_m(m);
    to.anisotropy = anisotropy_of(m);
    to.clearcoat_normal_scale = m.clearcoat_normal_scale;
    to.anisotropy_steps = anisotropy_steps(m);
    set_factors(m, to);
    set_layers(m, to);
  }
  result.albedo = std::move(albedo.values);
  return result;
}

}  // namespace previz::render
