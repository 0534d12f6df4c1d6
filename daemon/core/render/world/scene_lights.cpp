#include "daemon/core/render/world/scene_lights.hpp"

#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <utility>

#include "daemon/core/render/world/emission_weights.hpp"

namespace previz::render {
namespace {

constexpr Purpose for_lights{"the lamps and the triangles that emit light",
                             "simplify the meshes that emit light"};

// Lights have no padding, so that equal ones have equal bytes.
static_assert(sizeof(gpu::GpuLight) == 160);

// Lights are weighed for a radius of this many steps an octave, so that they stay as they are while
// an object at the rim of the scene moves.
constexpr double radius_steps = 16;

double stepped(double radius) {
  return radius > 0 ? std::exp2(std::round(std::log2(radius) * radius_steps) / radius_steps)
                    : radius;
}

bool have_equal_bytes(const std::vector<gpu::GpuLight>& a, const std::vector<gpu::GpuLight>& b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(a[0])) == 0);
}

// Returns the sphere around a lamp that has a place.
glm::dvec4 sphere_of_lamp(const set::Light& lamp) {
  double radius = 0;
  if (lamp.type == set::LightType::sphere) radius = lamp.radius_m;
  if (lamp.type == set::LightType::rectangle)
    radius = 0.5 * std::hypot(lamp.width_m, lamp.height_m);
  return {lamp.position, radius};
}

// Returns by how much a motion makes surfaces larger, as the mean over the three faces of a cube:
// that of every surface for a rotation with a uniform scale.
double area_scale(const glm::dmat4& motion) {
  const glm::dvec3 x(motion[0]), y(motion[1]), z(motion[2]);
  return (glm::length(glm::cross(x, y)) + glm::length(glm::cross(y, z)) +
          glm::length(glm::cross(z, x))) /
         3;
}

}  // namespace

void SceneLights::set_scene(const scene::Scene& scene) {
  state_.reset();
  emitters_.clear();
  first_light_.assign(scene.instances.size(), gpu::NO_INDEX);
  for (std::uint32_t i = 0; i < scene.instances.size(); ++i) {
    const scene::Material& material = scene.materials[scene.instances[i].material];
    if (!scene::emits(material)) continue;
    Emitter emitter{i, emission_weights(scene, scene.instances[i]), {}, 0};
    shape(emitter, scene);
    emitters_.push_back(std::move(emitter));
  }
}

void SceneLights::shape(Emitter& emitter, const scene::Scene& scene) {
  scene::Instance unmoved = scene.instances[emitter.instance];
  unmoved.world_from_object = glm::dmat4(1.0);
  unmoved.presence = scene::world_both;
  PlacedLights alone;
  append_emitter(alone, scene, emitter.instance, unmoved, emitter.weights);
  emitter.shape = shape_of_emitter(alone);
  emitter.power = 0;
  for (std::size_t i = 0; i < alone.lights.size(); ++i)
    if (const double watts = power_of(alone.lights[i], 0) * alone.weights.of(i); watts > 0)
      emitter.power += watts;
}

void SceneLights::reshape(const scene::Scene& scene, std::uint32_t instance) {
  ++shapes_;
  for (Emitter& emitter : emitters_)
    if (emitter.instance == instance) shape(emitter, scene);
}

std::vector<Shining> SceneLights::shining(const scene::Scene& scene, const Spheres& spheres,
                                          const std::vector<set::Light>& lamps) const {
  std::vector<Shining> all;
  const auto add = [&](const glm::dvec4& sphere, double power) {
    if (power > 0) all.push_back({sphere, power});
  };
  PlacedLights placed;
  for (const set::Light& lamp : lamps) {
    if (lamp.type == set::LightType::directional) continue;
    append_lamp(placed, lamp);
    add(sphere_of_lamp(lamp), power_of(placed.lights.back(), 0));
  }
  for (const Emitter& emitter : emitters_) {
    const scene::Instance& instance = scene.instances[emitter.instance];
    if (instance.presence == 0 || spheres[emitter.instance].w < 0) continue;
    add(spheres[emitter.instance], emitter.power * area_scale(instance.world_from_object));
  }
  return all;
}

SceneLights::State SceneLights::state_of(const scene::Scene& scene,
                                         const std::vector<set::Light>& lamps,
                                         double lit_radius) const {
  State state{{}, {}, {}, shapes_, stepped(lit_radius)};
  for (const set::Light& lamp : lamps) append_lamp(state.lamps, lamp);
  for (const Emitter& emitter : emitters_) {
    state.places.push_back(scene.instances[emitter.instance].world_from_object);
    state.presences.push_back(scene.instances[emitter.instance].presence);
  }
  return state;
}

bool SceneLights::are_equal(const State& a, const State& b) {
  return have_equal_bytes(a.lamps.lights, b.lamps.lights) &&
         a.lamps.positions == b.lamps.positions && a.places == b.places &&
         a.presences == b.presences && a.shapes == b.shapes && a.lit_radius == b.lit_radius;
}

void SceneLights::place(const scene::Scene& scene, const std::vector<set::Light>& lamps,
                        double lit_radius, const glm::dvec3& camera_position) {
  State state = state_of(scene, lamps, lit_radius);
  const bool is_new = !state_ || !are_equal(*state_, state);
  if (is_new) {
    visible_count_ =
        static_cast<std::uint32_t>(std::count_if(lamps.begin(), lamps.end(), can_be_seen));
    distant_count_ = static_cast<std::uint32_t>(
        std::count_if(lamps.begin(), lamps.end(), [](const set::Light& lamp) {
          return can_be_seen(lamp) && lamp.type == set::LightType::directional;
        }));
    state_ = std::move(state);
    encode(scene);
  }
  if (is_new || camera_position != seen_from_) upload_positions(camera_position);
}

void SceneLights::encode(const scene::Scene& scene) {
  ++encoded_;
  PlacedLights all = state_->lamps;
  const std::size_t lamps = all.lights.size();
  std::size_t count = lamps;
  for (const Emitter& emitter : emitters_)
    count += scene.meshes[scene.instances[emitter.instance].mesh].triangles.size();
  all.lights.reserve(count);
  all.positions.reserve(count);
  std::vector<LightGroup> groups;
  for (const Emitter& emitter : emitters_) {
    const auto first = static_cast<std::uint32_t>(all.lights.size());
    first_light_[emitter.instance] = first;
    groups.push_back({first, &emitter.shape});
    append_emitter(all, scene, emitter.instance, scene.instances[emitter.instance],
                   emitter.weights);
  }
  count_ = static_cast<std::uint32_t>(all.lights.size());
  power_ = select_by_power(all.lights, state_->lit_radius, all.weights);
  spread_ = spread_of(all.lights, state_->lit_radius, all.weights);
  const bool has_tree = are_many(scene);
  if (!has_tree) groups.clear();
  const LightTree tree = build_light_tree(all, has_tree ? lamps : 0, groups);
  tree_share_ = select_by_tree(all.lights);
  tree_origin_ = tree.origin;
  upload_texels(device_, for_lights, lights_, all.lights, vk::Format::eR32G32B32A32Uint);
  upload_texels(device_, for_lights, light_tree_, tree.nodes, vk::Format::eR32G32B32A32Uint);
  positions_ = std::move(all.positions);
}

void SceneLights::upload_positions(const glm::dvec3& camera_position) {
  seen_from_ = camera_position;
  std::vector<glm::vec4> positions;
  positions.reserve(positions_.size());
  for (const glm::dvec3& position : positions_)
    positions.emplace_back(position - camera_position, 0.0);
  upload_texels(device_, for_lights, light_positions_, positions, vk::Format::eR32G32B32A32Sfloat);
}

void SceneLights::describe(gpu::GpuFrame& frame) const {
  frame.light_count = count_;
  frame.visible_light_count = visible_count_;
  frame.distant_light_count = distant_count_;
  frame.lamp_spread = static_cast<float>(spread_);
  frame.tree_share = tree_share_;
  frame.tree_offset = glm::vec3(seen_from_ - tree_origin_);
}

void SceneLights::add_to(Buffers& buffers) const {
  buffers.insert(
      {{"lights", &lights_}, {"light_positions", &light_positions_}, {"light_tree", &light_tree_}});
}

}  // namespace previz::render
