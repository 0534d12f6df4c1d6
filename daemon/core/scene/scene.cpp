#include "daemon/core/scene/scene.hpp"

#include <algorithm>
#include <cmath>
#include <regex>
#include <string>
#include <vector>

#include "shaders/lib/render_shared.h"

namespace previz::scene {
namespace {

// Returns the smallest factor that one channel of a texture applies.
double least_factor(const Scene& scene, std::uint32_t texture, int channel) {
  if (texture == no_texture) return 1;
  float least = 1;
  for (const glm::vec4& texel : scene.textures[texture].texels)
    least = std::min(least, texel[channel]);
  return least;
}

// The shape at rest of a mesh that deforms follows from what it is before, and from its
// deformation.
bool are_same_mesh(const Mesh& a, const Mesh& b) {
  if (a.triangles != b.triangles || a.uvs != b.uvs || a.more_uvs != b.more_uvs ||
      a.colors != b.colors || a.tangents != b.tangents || a.undeformed != b.undeformed)
    return false;
  return !a.undeformed.is_empty() || (a.positions == b.positions && a.normals == b.normals);
}

bool deform_alike(const Deformation& a, const Deformation& b) {
  return a.mesh == b.mesh && a.instance == b.instance && a.weights == b.weights &&
         a.joints == b.joints && a.extent == b.extent;
}

}  // namespace

NamedTag named_tag(const std::string& node) {
  // Families have at most some ten thousand tags.
  static const std::regex pattern(
      "(under[ _])?tag[ _]?([0-9]{1,5})([ _](paper|print))?([._][0-9]+)?", std::regex::icase);
  constexpr std::size_t longest = 200;  // of a name that a person gives
  std::smatch match;
  if (node.size() > longest || !std::regex_match(node, match, pattern)) return {};
  return {match[1].matched ? TagPart::under : TagPart::printed, std::stoi(match[2])};
}

void hide_tags(std::vector<Instance>& instances, bool hidden) {
  for (Instance& instance : instances)
    if (instance.tag == TagPart::printed)
      instance.presence = hidden ? world_real : world_both;
    else if (instance.tag == TagPart::under)
      instance.presence = hidden ? world_mixed : 0;
}

const Variants* variants_of(const Scene& scene, std::size_t object) {
  const auto found = std::ranges::find(scene.variants, object, &Variants::object);
  return found == scene.variants.end() ? nullptr : &*found;
}

bool show_variant(const Variants& variants, const std::string& name,
                  std::vector<Instance>& instances) {
  std::size_t look = 0;
  if (!name.empty()) {
    const auto found = std::ranges::find(variants.names, name);
    if (found == variants.names.end()) return false;
    look = 1 + static_cast<std::size_t>(found - variants.names.begin());
  }
  for (const Variants::Part& part : variants.parts) {
    instances[part.instance].mesh = part.looks[look].mesh;
    instances[part.instance].material = part.looks[look].material;
  }
  return true;
}

std::size_t mapping_of(const Material& material, std::uint32_t Material::*texture) {
  const auto role = std::ranges::find(material_textures, texture) - material_textures.begin();
  return material.mappings[static_cast<std::size_t>(role)];
}

const std::vector<glm::vec2>& uvs_of(const Mesh& mesh, std::size_t mapping) {
  static const std::vector<glm::vec2> none;
  if (mapping == 0) return mesh.uvs;
  return mapping <= mesh.more_uvs.size() ? mesh.more_uvs[mapping - 1] : none;
}

bool emits(const Material& m) {
  return m.emission.r > 0 || m.emission.g > 0 || m.emission.b > 0;
}

bool may_glow(const Scene& scene) {
  bool glows = false;
  for_each_look(scene, [&](std::uint32_t, std::uint32_t material) {
    glows = glows || emits(scene.materials[material]);
  });
  return glows;
}

bool transmits(const Material& m) {
  return m.transmission > 0 && (m.metallic < 1 || m.metallic_roughness_texture != no_texture);
}

bool attenuates(const Material& m) {
  return attenuation_per_m(m) != glm::vec3(0);
}

glm::vec3 attenuation_per_m(const Material& m) {
  if (m.thin_walled || !transmits(m) || !std::isfinite(m.attenuation_distance_m))
    return glm::vec3(0);
  glm::vec3 result;
  for (int i = 0; i < 3; ++i) {
    // Black takes away all but what no picture shows, and stays finite.
    const double color = std::clamp(static_cast<double>(m.attenuation_color[i]), 1e-30, 1.0);
    result[i] = static_cast<float>(
        std::min(-std::log(color) / static_cast<double>(m.attenuation_distance_m), 1e30));
  }
  return result;
}

bool has_sheen(const Material& m) {
  return m.sheen_color.r > 0 || m.sheen_color.g > 0 || m.sheen_color.b > 0;
}

bool has_specular_color(const Material& m) {
  return m.specular_color != glm::vec3(1) || m.specular_color_texture != no_texture;
}

bool is_anisotropic(const Material& m) {
  return m.anisotropy > 0 && m.transmission <= 0;
}

bool has_directions(const Material& m) {
  return m.normal_texture != no_texture || m.clearcoat_normal_texture != no_texture ||
         is_anisotropic(m);
}

bool has_opaque_part(const Material& m) {
  return (m.metallic < 1 || m.metallic_roughness_texture != no_texture) &&
         (m.transmission < 1 || m.transmission_texture != no_texture);
}

bool has_coat(const Material& m) {
  return has_opaque_part(m) && m.specular > 0 && m.ior > 1;
}

double widest_alpha(const Material& m, double roughness, double strength_factor) {
  const double alpha = roughness * roughness;
  if (!is_anisotropic(m)) return alpha;
  const double strength = m.anisotropy * strength_factor;
  return std::max<double>(std::lerp(alpha, 1.0, strength * strength), gpu::LEAST_ANISOTROPIC_ALPHA);
}

bool can_be_dirac(const Scene& scene, const Material& m, double specular_alpha) {
  const bool glass = transmits(m);
  if (glass && m.ior < gpu::LEAST_ROUGH_IOR) return true;
  const double lacquer =
      m.clearcoat_roughness * least_factor(scene, m.clearcoat_roughness_texture, 1);
  if (m.clearcoat > 0 && lacquer * lacquer <= specular_alpha * (1 + 1e-5)) return true;
  if (!glass && !(m.metallic > 0) && !(m.specular > 0 && m.ior > 1)) return false;
  const double roughness = m.roughness * least_factor(scene, m.metallic_roughness_texture, 1);
  const double strength_factor = least_factor(scene, m.anisotropy_texture, 2);
  // The shader's sum is in floats.
  return widest_alpha(m, roughness, strength_factor) <= specular_alpha * (1 + 1e-5);
}

bool have_same_geometry(const Scene& a, const Scene& b) {
  return a.instances.size() == b.instances.size() &&
         std::ranges::equal(a.meshes, b.meshes, are_same_mesh) &&
         std::ranges::equal(a.deformations, b.deformations, deform_alike);
}

Size size_of(const Scene& scene) {
  Size size;
  std::vector<bool> is_counted(scene.meshes.size());
  for (const Instance& instance : scene.instances) {
    if (instance.presence == 0) continue;
    const Mesh& mesh = scene.meshes[instance.mesh];
    size.instanced_triangles += mesh.triangles.size();
    if (is_counted[instance.mesh]) continue;
    is_counted[instance.mesh] = true;
    size.triangles += mesh.triangles.size();
    size.vertices += mesh.positions.size();
  }
  for (const Texture& texture : scene.textures) size.texels += texture.texels.size();
  return size;
}

}  // namespace previz::scene
