#include "daemon/core/render/world/gpu_scene.hpp"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/packing.hpp>
#include <map>
#include <numbers>
#include <utility>

#include "daemon/core/render/world/gpu_lights.hpp"
#include "daemon/core/render/world/gpu_materials.hpp"
#include "daemon/core/render/world/mip_levels.hpp"
#include "drivers/error.hpp"

namespace previz::render {
namespace {

// Stores the three rows of an affine transform.
void set_rows(glm::vec4 (&rows)[3], const glm::dmat4& m) {
  for (int r = 0; r < 3; ++r) rows[r] = glm::vec4(m[0][r], m[1][r], m[2][r], m[3][r]);
}

glm::dmat4 relative_to(const glm::dmat4& world_from_object, const glm::dvec3& camera_position) {
  glm::dmat4 result = world_from_object;
  result[3] -= glm::dvec4(camera_position, 0.0);
  return result;
}

// Returns the probability of sampling the environment where either may be sampled: by power, but
// neither is forgotten.
double environment_share(double environment_power, double light_power) {
  if (!(light_power > 0)) return 1;
  if (!(environment_power > 0)) return 0;
  return std::clamp(environment_power / (environment_power + light_power), 0.1, 0.9);
}

// Returns how many values a vertex of the mesh has in EXTRAS (GpuInstance): its colour, and its
// texture coordinates after the first, and last its tangent.
std::uint32_t extras_per_vertex(const scene::Mesh& mesh) {
  if (mesh.colors.empty() && mesh.more_uvs.empty() && mesh.tangents.empty()) return 0;
  return static_cast<std::uint32_t>(1 + mesh.more_uvs.size() + (mesh.tangents.empty() ? 0 : 1));
}

void append_extras(const scene::Mesh& mesh, std::vector<glm::uvec2>& extras) {
  for (std::size_t i = 0; extras_per_vertex(mesh) > 0 && i < mesh.positions.size(); ++i) {
    const glm::vec4 color = mesh.colors.empty() ? glm::vec4(1) : mesh.colors[i];
    extras.emplace_back(glm::packUnorm2x16(glm::vec2(color)),
                        glm::packUnorm2x16(glm::vec2(color.z, color.w)));
    for (const std::vector<glm::vec2>& uvs : mesh.more_uvs)
      extras.emplace_back(uvs.empty() ? glm::uvec2(0)
                                      : std::bit_cast<glm::uvec2>(glm::vec2(uvs[i])));
    if (mesh.tangents.empty()) continue;
    const glm::vec4& tangent = mesh.tangents[i];
    extras.emplace_back(glm::packSnorm2x16(glm::vec2(tangent)),
                        glm::packSnorm2x16(glm::vec2(tangent.z, tangent.w)));
  }
}

// Says what lets_light_through() of shaders/lib/pane.glsl does.
bool lets_light_through(const scene::Material& m) {
  return m.alpha_mode != scene::AlphaMode::opaque || (m.thin_walled && scene::transmits(m));
}

template <typename T>
void append(std::vector<T>& to, const std::vector<T>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

}  // namespace

void GpuScene::set_scene(const scene::Scene& scene, double specular_alpha, bool filters_textures) {
  const bool has_meshes = has_scene_ && scene::have_same_geometry(scene_, scene);
  const bool has_textures =
      has_scene_ && filters_textures_ == filters_textures && scene_.textures == scene.textures;
  has_scene_ = false;  // until all of it is there
  scene_ = scene;
  shapes_.clear();
  specular_alpha_ = specular_alpha;
  filters_textures_ = filters_textures;
  material_features_ = material_features(scene_, specular_alpha);
  may_glow_ = scene::may_glow(scene_);
  may_be_dirac_.clear();
  for (const scene::Material& material : scene_.materials)
    may_be_dirac_.push_back(scene::can_be_dirac(scene_, material, specular_alpha));
  if (!has_meshes) upload_meshes();
  upload_materials(specular_alpha);
  if (!has_textures) upload_textures();
  lights_.set_scene(scene_);
  spheres_ = bounding_spheres(scene_);
  instances_as_set_ = scene_.instances;
  std::vector<scene::Shape> at_rest;
  for (const scene::Deformation& deformation : scene_.deformations)
    at_rest.push_back(scene::shape_at_rest(deformation));
  deform(at_rest);
  find_bounds(spheres_);
  has_scene_ = true;
}

void GpuScene::deform(const std::vector<scene::Shape>& shapes) {
  assert(shapes.size() == scene_.deformations.size());
  if (shapes.empty()) return;
  for (const std::size_t i : deformer_.deform(shapes, bvh_, vertices_))
    if (device_.traces_in_hardware()) structures_.reshape(scene_.deformations[i].mesh, vertices_);
  shapes_ = shapes;
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    const scene::Deformation& deformation = scene_.deformations[i];
    const scene::Instance& instance = instances_as_set_[deformation.instance];
    spheres_[deformation.instance] =
        bounding_sphere(places_[deformation.mesh].bvh.bounds, instance.world_from_object);
    if (shape_emitter(i)) lights_.reshape(scene_, deformation.instance);
  }
  find_bounds(moved_spheres(spheres_, instances_as_set_, scene_.instances));
}

// Gives the CPU's copy of a mesh that emits its shape, because light samples are taken on it.
// Returns false if it does not emit, or does not have the shape.
bool GpuScene::shape_emitter(std::size_t deformation) {
  const scene::Deformation& deforms = scene_.deformations[deformation];
  const scene::Instance& instance = scene_.instances[deforms.instance];
  if (!scene::emits(scene_.materials[instance.material]) ||
      !deformer_.has_shape(deformation, shapes_[deformation]))
    return false;
  scene::Mesh& mesh = scene_.meshes[deforms.mesh];
  mesh.positions = scene::deformed(mesh.undeformed, shapes_[deformation]).positions;
  return true;
}

void GpuScene::move(const std::vector<scene::Instance>& instances,
                    const std::vector<set::Light>& lights) {
  assert(instances.size() == scene_.instances.size());
  bool glows_otherwise = false;
  for (std::size_t i = 0; i < instances.size(); ++i) {
    const std::uint32_t before = scene_.instances[i].material, now = instances[i].material;
    glows_otherwise |= before != now && (scene::emits(scene_.materials[before]) ||
                                         scene::emits(scene_.materials[now]));
  }
  scene_.instances = instances;
  scene_.lights = lights;
  if (glows_otherwise) {
    for (std::size_t i = 0; i < shapes_.size(); ++i) shape_emitter(i);
    lights_.set_scene(scene_);
  }
  find_bounds(moved_spheres(spheres_, instances_as_set_, scene_.instances));
}

void GpuScene::stand(const Standing& standing) {
  set_sources(standing.sources);
  move(standing.instances, standing.lights);
  deform(standing.shapes);
}

void GpuScene::find_bounds(const Spheres& spheres) {
  placed_spheres_ = spheres;
  difference_bounds_ = difference_bounds(scene_, spheres);
  specular_bounds_ = specular_bounds(scene_, spheres, specular_alpha_);
}

void GpuScene::upload_tree(const std::vector<glm::uvec4>& bvh) {
  const Purpose purpose{"the triangles' tree", "simplify the meshes of the set"};
  upload_texels(device_, purpose, bvh_, bvh, vk::Format::eR32G32B32A32Uint);
}

void GpuScene::upload_meshes() {
  // The memory of another scene is free for this one.
  structures_.clear();
  for (Buffer* buffer : {&bvh_, &vertices_, &triangles_, &extras_}) *buffer = {};
  work_.trees += scene_.meshes.size();
  std::vector<glm::uvec4> bvh(scene::top_bvh_texels(scene_.instances.size()));
  std::vector<glm::vec4> vertices;
  std::vector<glm::uvec4> triangles;
  std::vector<glm::uvec2> extras;
  places_.clear();
  deformer_.clear();
  std::map<const scene::Mesh*, scene::MeshBvh> deforming;
  for (const scene::Deformation& deformation : scene_.deformations)
    deforming[&scene_.meshes[deformation.mesh]] = deformer_.add(scene_, deformation);
  for (const scene::Mesh& mesh : scene_.meshes) {
    MeshPlace place;
    const auto built = deforming.find(&mesh);
    place.bvh = built != deforming.end() ? std::move(built->second) : scene::build_mesh_bvh(mesh);
    place.first_record = static_cast<std::uint32_t>(bvh.size() / scene::texels_per_record);
    place.first_triangle = static_cast<std::uint32_t>(triangles.size());
    append(bvh, std::exchange(place.bvh.texels, {}));
    const auto first = static_cast<std::uint32_t>(vertices.size() / 2);
    place.first_vertex = first;
    place.first_extra = static_cast<std::uint32_t>(extras.size());
    append_extras(mesh, extras);
    places_.push_back(std::move(place));
    for (const glm::uvec3& t : mesh.triangles)
      triangles.emplace_back(first + t.x, first + t.y, first + t.z, 0u);
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
      const glm::vec2 uv = mesh.uvs.empty() ? glm::vec2(0) : mesh.uvs[i];
      vertices.emplace_back(mesh.positions[i], uv.x);
      vertices.emplace_back(mesh.normals[i], uv.y);
    }
  }
  upload_tree(bvh);
  const Purpose purpose{"the triangles", "simplify the meshes of the set"};
  upload_texels(device_, purpose, vertices_, vertices, vk::Format::eR32G32B32A32Sfloat);
  upload_texels(device_, purpose, triangles_, triangles, vk::Format::eR32G32B32A32Uint);
  upload_texels(device_, purpose, extras_, extras, vk::Format::eR32G32Uint);
  if (!scene_.deformations.empty()) check_deforming();
  std::vector<Deformer::Place> deformed;
  for (const scene::Deformation& deformation : scene_.deformations) {
    MeshPlace& place = places_[deformation.mesh];
    deformed.push_back({&place.bvh, place.first_record, place.first_vertex});
  }
  deformer_.upload(std::move(deformed));
  if (device_.traces_in_hardware()) build_structures();
}

void GpuScene::build_structures() {
  std::vector<RayStructures::Mesh> meshes;
  for (std::size_t i = 0; i < scene_.meshes.size(); ++i) {
    const bool deforms = std::ranges::find(scene_.deformations, i, &scene::Deformation::mesh) !=
                         scene_.deformations.end();
    meshes.push_back(RayStructures::mesh_of(scene_.meshes[i], places_[i].first_vertex, deforms));
  }
  structures_.build(meshes, vertices_);
}

// Throws if the buffers of a scene with deforming meshes are too large: the shapes are written
// through storage buffers, which may be smaller than the texel buffers from which all meshes are
// read on a device that reads texels.
void GpuScene::check_deforming() const {
  const vk::DeviceSize most = device_.limits().maxStorageBufferRange;
  for (const Buffer* buffer : {&bvh_, &vertices_})
    if (buffer->size > most)
      throw Error("Vulkan: with deforming meshes, the scene's trees and vertices are limited to " +
                  std::to_string(most) + " bytes each on " + device_.name() + ", but need " +
                  std::to_string(buffer->size) + "; reduce the scene or remove the animation");
}

void GpuScene::upload_materials(double specular_alpha) {
  ++work_.materials;
  std::vector<scene::Material> as_read;
  for (const scene::Material& material : scene_.materials)
    as_read.push_back(this->as_read(material));
  const EncodedMaterials encoded = encode_materials(as_read, specular_alpha);
  const Purpose purpose{"the materials", "use fewer materials"};
  upload_texels(device_, purpose, materials_, encoded.materials, vk::Format::eR32G32B32A32Uint);
  upload_texels(device_, purpose, albedo_, encoded.albedo, vk::Format::eR32Sfloat);
}

// Returns the material with the textures as it reads them: where they are filtered they are there
// twice, first without levels, then with them. Where a texel decides what a surface is, there or a
// hole, rough or a mirror, it is read as it is, because a mean would be neither.
scene::Material GpuScene::as_read(const scene::Material& material) const {
  scene::Material m = material;
  if (!filters_textures_) return m;
  const auto filter = [&](std::uint32_t& texture) {
    if (texture != scene::no_texture) texture += static_cast<std::uint32_t>(scene_.textures.size());
  };
  if (m.alpha_mode == scene::AlphaMode::opaque) filter(m.base_color_texture);
  if (!scene::can_be_dirac(scene_, material, specular_alpha_)) filter(m.metallic_roughness_texture);
  filter(m.emission_texture);
  return m;
}

void GpuScene::upload_textures() {
  ++work_.textures;
  texels_ = {};
  std::vector<gpu::GpuTexture> textures, levels;
  std::vector<glm::uvec2> texels;
  const auto add = [&](const std::vector<glm::vec4>& values) {
    for (const glm::vec4& texel : values)
      texels.emplace_back(glm::packHalf2x16(glm::vec2(texel.x, texel.y)),
                          glm::packHalf2x16(glm::vec2(texel.z, texel.w)));
  };
  for (const scene::Texture& t : scene_.textures) {
    textures.push_back({static_cast<std::uint32_t>(texels.size()),
                        static_cast<std::uint32_t>(t.width), static_cast<std::uint32_t>(t.height),
                        static_cast<std::uint32_t>(t.wrap_u), static_cast<std::uint32_t>(t.wrap_v),
                        t.nearest ? 1u : 0u, 0u, 0u});
    add(t.texels);
  }
  for (std::size_t i = 0; filters_textures_ && i < scene_.textures.size(); ++i) {
    gpu::GpuTexture texture = textures[i];
    texture.first_level = static_cast<std::uint32_t>(2 * scene_.textures.size() + levels.size());
    for (const MipLevel& level : mip_levels(scene_.textures[i])) {
      ++texture.levels;
      levels.push_back(
          {static_cast<std::uint32_t>(texels.size()), static_cast<std::uint32_t>(level.width),
           static_cast<std::uint32_t>(level.height), texture.wrap_u, texture.wrap_v, 0u, 0u, 0u});
      add(level.texels);
    }
    textures.push_back(texture);
  }
  append(textures, levels);
  const Purpose purpose{"the scene's textures",
                        filters_textures_
                            ? "use smaller textures, or set estimator.filter_textures to false"
                            : "use smaller textures"};
  upload_texels(device_, purpose, textures_, textures, vk::Format::eR32G32B32A32Uint);
  upload_texels(device_, purpose, texels_, texels, vk::Format::eR32G32Uint);
}

void GpuScene::set_environment(const EncodedEnvironment& encoded, set::LightSampling sampling) {
  environment_size_ = encoded.size;
  environment_levels_ = encoded.levels;
  environment_mean_ = encoded.mean;
  environment_spread_ = encoded.spread;
  sampling_ = sampling;
  const Purpose purpose{"the environment light", "use a smaller environment map"};
  upload_texels(device_, purpose, environment_, encoded.radiance, vk::Format::eR32G32B32A32Sfloat);
  upload_texels(device_, purpose, importance_, encoded.importance, vk::Format::eR32G32B32A32Sfloat);
}

void GpuScene::set_sources(std::optional<std::vector<set::Light>> sources) {
  sources_ = std::move(sources);
}

void GpuScene::place(const glm::dvec3& camera_position) {
  find_extent();
  const std::vector<set::Light> shining = lamps();
  lit_radius_ = lit_radius(scene_, placed_spheres_,
                           lights_.shining(scene_, placed_spheres_, shining), scene_radius_);
  lights_.place(scene_, shining, lit_radius_, camera_position);
  seen_from_ = camera_position;
  upload_instances(camera_position);
  upload_bounds(camera_position);
}

void GpuScene::upload_bounds(const glm::dvec3& camera_position) {
  std::vector<glm::vec4> bounds;
  for (const Bounds& part : {difference_bounds_, specular_bounds_})
    for (const glm::dvec4& bound : part)
      bounds.emplace_back(glm::dvec3(bound) - camera_position, bound.w);
  const Purpose purpose{"the bounds of virtual objects", "use fewer objects"};
  upload_texels(device_, purpose, bounds_buffer_, bounds, vk::Format::eR32G32B32A32Sfloat);
}

// The extent does not depend on the camera, to the last bit, so that lights need not be weighed
// anew when only the camera moves.
void GpuScene::find_extent() {
  glm::dvec3 low(1e300), high(-1e300);
  for (const scene::Instance& instance : scene_.instances) {
    const scene::Aabb& bounds = places_[instance.mesh].bvh.bounds;
    if (!(bounds.low.x <= bounds.high.x)) continue;  // nothing is in it
    const glm::dmat4& world = instance.world_from_object;
    const glm::dvec3 center(
        world * glm::dvec4(0.5 * (glm::dvec3(bounds.low) + glm::dvec3(bounds.high)), 1.0));
    const glm::dvec3 half = 0.5 * (glm::dvec3(bounds.high) - glm::dvec3(bounds.low));
    const glm::dvec3 reach = glm::abs(glm::dvec3(world[0])) * half.x +
                             glm::abs(glm::dvec3(world[1])) * half.y +
                             glm::abs(glm::dvec3(world[2])) * half.z;
    low = glm::min(low, center - reach);
    high = glm::max(high, center + reach);
  }
  if (!(low.x <= high.x)) return;  // there is nothing
  scene_radius_ = 0.5 * glm::length(high - low);
  scene_center_ = 0.5 * (low + high);
}

void GpuScene::upload_instances(const glm::dvec3& camera_position) {
  std::vector<scene::TopInstance> top;
  std::vector<gpu::GpuInstance> instances;
  for (std::uint32_t i = 0; i < scene_.instances.size(); ++i) {
    const scene::Instance& instance = scene_.instances[i];
    const MeshPlace& place = places_[instance.mesh];
    const glm::dmat4 world = relative_to(instance.world_from_object, camera_position);
    gpu::GpuInstance record{};
    set_rows(record.world_from_object, world);
    set_rows(record.object_from_world, glm::inverse(world));
    record.material = instance.material;
    record.first_triangle = place.first_triangle;
    record.first_light = lights_.first_light(i);
    record.presence = instance.presence;
    record.extras_per_vertex = extras_per_vertex(scene_.meshes[instance.mesh]);
    if (!scene_.meshes[instance.mesh].tangents.empty())
      record.tangent_extra = record.extras_per_vertex - 1;
    record.first_extra = place.first_extra - place.first_vertex * record.extras_per_vertex;
    instances.push_back(record);
    top.push_back({&place.bvh, place.first_record, instance.presence, world});
  }
  const scene::TopBvh top_bvh = scene::build_top_bvh(top);
  upload_bytes(device_, bvh_, std::as_bytes(std::span(top_bvh.texels)));
  const Purpose purpose{"the scene's objects", "use fewer objects"};
  upload_texels(device_, purpose, instances_, instances, vk::Format::eR32G32B32A32Uint);
  if (device_.traces_in_hardware()) place_structures(top);
}

void GpuScene::place_structures(const std::vector<scene::TopInstance>& top) {
  std::vector<RayStructures::Instance> instances;
  for (std::size_t i = 0; i < top.size(); ++i) {
    const scene::Instance& instance = scene_.instances[i];
    instances.push_back({.mesh = instance.mesh,
                         .presence = scene::can_be_placed(top[i]) ? instance.presence : 0,
                         .placed = top[i].world_from_object,
                         .is_open = lets_light_through(scene_.materials[instance.material])});
  }
  structures_.place(instances);
}

std::vector<GpuScene::Stance> GpuScene::stances() const {
  std::vector<Stance> result;
  for (const scene::Instance& instance : scene_.instances) {
    const scene::Aabb& bounds = places_[instance.mesh].bvh.bounds;
    result.push_back({instance.world_from_object,
                      bounds.low,
                      bounds.high,
                      instance.material,
                      instance.presence,
                      {},
                      may_be_dirac_[instance.material],
                      scene::emits(scene_.materials[instance.material])});
  }
  for (std::size_t i = 0; i < scene_.deformations.size(); ++i) {
    const scene::Deformation& deformation = scene_.deformations[i];
    const scene::Mesh& mesh = scene_.meshes[deformation.mesh];
    result[deformation.instance].deformed =
        Deformed{deformer_.shape(i), deformer_.reach(i), places_[deformation.mesh].first_vertex,
                 static_cast<std::uint32_t>(mesh.undeformed.positions.size())};
  }
  return result;
}

std::vector<set::Light> GpuScene::lamps() const {
  std::vector<set::Light> result = scene_.lights;
  if (sources_) append(result, *sources_);
  const auto end = std::stable_partition(result.begin(), result.end(), can_be_seen);
  std::stable_partition(result.begin(), end, [](const set::Light& lamp) {
    return lamp.type == set::LightType::directional;
  });
  return result;
}

Demand GpuScene::demand(const set::Estimation& estimation) const {
  Demand demand{.scene = scene_, .materials = material_features_, .estimation = estimation};
  demand.light_sampling = sampling_;
  demand.shines_around = environment_mean_ > 0;
  demand.finds_lamps = sources_.has_value();
  demand.lamps_shine = lights_.power() > 0 || may_glow_;
  return demand;
}

void GpuScene::describe(gpu::GpuFrame& frame, std::uint32_t features) const {
  frame.environment_size = environment_size_;
  frame.environment_levels = environment_levels_;
  lights_.describe(frame);
  frame.bound_count = static_cast<std::uint32_t>(difference_bounds_.size());
  frame.specular_bound_count = static_cast<std::uint32_t>(specular_bounds_.size());
  frame.scene_center = glm::vec3(scene_center_ - seen_from_);
  // The radius is slightly wider, so that rounding leaves no surface outside.
  frame.scene_radius = static_cast<float>(scene_radius_ * 1.001);
  // Light samples are divided by power. The power of distant light is what crosses the disc of what
  // is lit, so that a lamp in the environment is sampled as often as the same lamp taken out of it,
  // and a large room around takes no samples from a lamp beside a virtual object.
  const double disc = std::numbers::pi * lit_radius_ * lit_radius_;
  const double environment_power = 4 * std::numbers::pi * environment_mean_ * disc;
  const bool sampled = (features & gpu::FEATURE_ENVIRONMENT_SAMPLING) != 0;
  const double share = environment_share(environment_power, lights_.power());
  frame.environment_selection = sampled ? static_cast<float>(share) : 0.0f;
  frame.photon_environment = static_cast<float>(share);
  // Light that light samples do not look for counts as if it came from everywhere.
  frame.environment_spread = sampled ? static_cast<float>(environment_spread_) : 2.0f;
  const double all_power = environment_power + lights_.power();
  frame.lamp_part = all_power > 0 ? static_cast<float>(lights_.power() / all_power) : 0.0f;
}

Buffers GpuScene::buffers() const {
  Buffers buffers{{"bvh", &bvh_},
                  {"vertices", &vertices_},
                  {"triangles", &triangles_},
                  {"texels", &texels_},
                  {"environment", &environment_},
                  {"importance", &importance_},
                  {"albedo", &albedo_},
                  {"instances", &instances_},
                  {"materials", &materials_},
                  {"textures", &textures_},
                  {"bounds", &bounds_buffer_},
                  {"extras", &extras_},
                  {"ray_structure", &structures_.top()}};
  lights_.add_to(buffers);
  return buffers;
}

}  // namespace previz::render
