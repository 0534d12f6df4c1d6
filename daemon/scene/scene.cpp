#include "daemon/scene/scene.hpp"

#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <system_error>
#include <vector>

#include "daemon/scene/gltf.hpp"
#include "drivers/error.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::scene {
namespace {

float largest(const glm::vec3& color) {
  return std::max({color.r, color.g, color.b});
}

// The smallest factor that a texture puts on the roughness.
float least_roughness_factor(const Scene& scene, std::uint32_t texture) {
  if (texture == no_texture) return 1.0f;
  float least = 1.0f;
  for (const glm::vec4& texel : scene.textures[texture].texels) least = std::min(least, texel.g);
  return least;
}

// What one material, somewhere in the scene, asks of the renderer.
void require(const Material& material, const Scene& scene, double specular_alpha,
             Requirements& required) {
  const auto has_texture = [](std::uint32_t texture) { return texture != no_texture; };
  const bool is_metal = material.metallic > 0;
  const bool is_glass = transmits(material);
  const bool reflects = is_metal || is_glass || (material.specular > 0 && material.ior > 1);
  // A texture can only lower the roughness.
  const double alpha = static_cast<double>(material.roughness) * material.roughness;
  required.caustics |= can_be_dirac(scene, material, specular_alpha);
  required.metals |= is_metal;
  required.transmission |= is_glass;
  required.rough_specular |= reflects && alpha > specular_alpha;
  required.textures |= has_texture(material.base_color_texture) ||
                       has_texture(material.metallic_roughness_texture) ||
                       has_texture(material.emission_texture) ||
                       has_texture(material.normal_texture);
  required.emissive_meshes |= largest(material.emission) > 0;

  if (material.alpha_mode == AlphaMode::opaque) return;
  float least_alpha = material.alpha;
  if (has_texture(material.base_color_texture)) {
    const Texture& texture = scene.textures[material.base_color_texture];
    float least = 1;
    for (const glm::vec4& texel : texture.texels) least = std::min(least, texel.a);
    least_alpha *= least;
  }
  required.alpha |= material.alpha_mode == AlphaMode::mask ? least_alpha < material.alpha_cutoff
                                                           : least_alpha < 1;
}

// Only real objects take the colours that the set knows better: a virtual object of the same file
// keeps the material it was made with.
void apply(const set::Surface& surface, const std::string& set_file, Scene& scene) {
  std::map<std::uint32_t, std::uint32_t>
      recoloured;  // materials: as loaded, as real objects have it
  std::string known;
  for (Instance& instance : scene.instances) {
    if ((instance.presence & world_real) == 0) continue;
    const std::string name = scene.materials[instance.material].name;
    if (known.find('"' + name + '"') == std::string::npos)
      known += (known.empty() ? "\"" : ", \"") + name + '"';
    if (name != surface.material) continue;
    const auto entry = recoloured.try_emplace(instance.material, scene.materials.size()).first;
    if (entry->second == scene.materials.size()) {
      scene.materials.push_back(scene.materials[instance.material]);
      scene.materials.back().base_color = surface.albedo;
    }
    instance.material = entry->second;
  }
  if (recoloured.empty())
    throw Error(set_file + ": surface.material: no real object has a material \"" +
                surface.material + "\"; there are " + (known.empty() ? "none" : known));
}

}  // namespace

Scene load_scene(const set::Set& set) {
  Scene scene;
  Budget budget;
  std::map<std::filesystem::path, std::unique_ptr<GltfFile>> files;
  std::vector<const GltfFile*> in_order;
  for (std::size_t i = 0; i < set.objects.size(); ++i) {
    const set::Object& object = set.objects[i];
    std::error_code not_there;
    const auto canonical = std::filesystem::weakly_canonical(object.file, not_there);
    auto& file = files[not_there ? object.file : canonical];
    if (!file) {
      file = std::make_unique<GltfFile>(object.file, scene, budget);
      in_order.push_back(file.get());
    }
    file->add(object, static_cast<std::uint32_t>(i));
    scene.light_objects.resize(scene.lights.size(), static_cast<std::uint32_t>(i));
  }
  for (const set::Surface& surface : set.surfaces) apply(surface, set.file.string(), scene);
  scene.lights.insert(scene.lights.end(), set.lights.begin(), set.lights.end());
  scene.light_objects.resize(scene.lights.size(), no_object);
  for (const GltfFile* file : in_order)
    for (std::string& note : file->notes()) scene.notes.push_back(std::move(note));
  return scene;
}

bool transmits(const Material& m) {
  return m.transmission > 0 && (m.metallic < 1 || m.metallic_roughness_texture != no_texture);
}

bool can_be_dirac(const Scene& scene, const Material& m, double specular_alpha) {
  const bool glass = transmits(m);
  if (glass && m.ior < gpu::LEAST_ROUGH_IOR) return true;
  if (!glass && !(m.metallic > 0) && !(m.specular > 0 && m.ior > 1)) return false;
  const double roughness =
      m.roughness * least_roughness_factor(scene, m.metallic_roughness_texture);
  return roughness * roughness <= specular_alpha * (1 + 1e-5);  // the shader's sum is in floats
}

Requirements requirements(const Scene& scene, const set::Set& set) {
  Requirements required;
  std::vector<bool> mesh_counted(scene.meshes.size()), material_seen(scene.materials.size());
  for (const Instance& instance : scene.instances) {
    if (instance.presence == 0) continue;
    const std::uint64_t triangles = scene.meshes[instance.mesh].triangles.size();
    if (!mesh_counted[instance.mesh]) {
      required.triangles += triangles;
      required.vertices += scene.meshes[instance.mesh].positions.size();
    }
    mesh_counted[instance.mesh] = true;
    required.instanced_triangles += triangles;
    required.differing_objects |= instance.presence != world_both;
    required.removed_objects |= instance.presence == world_real;
    if (material_seen[instance.material]) continue;
    material_seen[instance.material] = true;
    require(scene.materials[instance.material], scene, set.estimation.specular_roughness, required);
  }
  for (const Texture& texture : scene.textures) required.texels += texture.texels.size();
  for (const set::Light& light : scene.lights) {
    const bool shines = light.gain_mixed > 0 || light.gain_real > 0;
    required.lights |= shines && largest(glm::vec3(light.emission)) > 0;
  }
  required.lights |= set.lighting.mode != set::LightMode::image;
  required.thin_lens = set.observer.calibration && set.observer.calibration->lens;
  return required;
}

}  // namespace previz::scene
