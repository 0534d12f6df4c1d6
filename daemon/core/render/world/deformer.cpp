#include "daemon/core/render/world/deformer.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "shaders/deform.spv.h"
#include "shaders/refit_leaves.spv.h"
#include "shaders/refit_nodes.spv.h"

namespace previz::render {
namespace {

constexpr Purpose for_deformation{"the meshes that deform", "simplify the meshes that deform"};

// A tree is built anew once a ray is expected to visit this many times the records that it visited
// when the tree was built. Building costs about as much as a frame of a small picture.
constexpr double most_growth = 1.5;

// A tree built for another shape may need more nodes; this much room is left for it.
constexpr double spare_room = 1.5;

constexpr std::uint32_t records_per_block = 8;

std::uint32_t record_count(const scene::MeshBvh& bvh) {
  return static_cast<std::uint32_t>(bvh.texels.size() / scene::texels_per_record);
}

gpu::GpuInfluence encoded(const scene::Influence& influence) {
  const auto& j = influence.joints;
  const auto both = [](std::uint16_t low, std::uint16_t high) {
    return static_cast<std::uint32_t>(low) | static_cast<std::uint32_t>(high) << 16;
  };
  return {both(j[0], j[1]), both(j[2], j[3]), influence.weights};
}

double half_area(const glm::vec3& low, const glm::vec3& high) {
  const glm::dvec3 size = glm::dvec3(high) - glm::dvec3(low);
  return size.x * size.y + size.y * size.z + size.z * size.x;
}

// Returns the cost with which later shapes of a tree are compared: 0 where the shape that it was
// built for has no surface, by which a cost is measured.
double cost_of(const scene::MeshBvh& bvh) {
  return half_area(bvh.bounds.low, bvh.bounds.high) > 0 ? bvh.sah_cost : 0;
}

// Positions that no ray could hit (daemon/core/scene/bvh.cpp) are not put into a tree.
bool can_be_traced(const scene::Aabb& bounds) {
  for (int axis = 0; axis < 3; ++axis)
    if (!(std::abs(bounds.low[axis]) <= 1e20f && std::abs(bounds.high[axis]) <= 1e20f))
      return false;
  return true;
}

}  // namespace

void Deformer::clear() {
  meshes_.clear();  // waits for the trees that are being built
  refitted_.clear();
  rebuilt_ = 0;
}

scene::MeshBvh Deformer::add(const scene::Scene& scene, const scene::Deformation& deformation) {
  const scene::Mesh& from = scene.meshes[deformation.mesh];
  Mesh mesh;
  mesh.undeformed = std::make_shared<const scene::Undeformed>(from.undeformed);
  mesh.pairs = scene::deforming_pairs(from);
  mesh.reach = std::make_shared<const scene::DeformationReach>(
      scene::reach_of(from, deformation.joints.size()));
  scene::RefittableBvh built = scene::build_refittable_bvh(mesh.pairs, from.positions);
  mesh.plan = std::move(built.plan);
  mesh.built_cost = cost_of(built.bvh);
  const auto blocks = static_cast<std::uint32_t>(
      std::ceil(spare_room * record_count(built.bvh) / records_per_block));
  mesh.room = blocks * records_per_block;
  built.bvh.texels.resize(std::size_t{mesh.room} * scene::texels_per_record);
  meshes_.push_back(std::move(mesh));
  return std::move(built.bvh);
}

void Deformer::upload(std::vector<Place> places) {
  if (meshes_.empty()) return;
  if (!has_kernels_) {
    deform_ = Kernel(device_, Pass{"deform", deform_spv}, 0);
    refit_leaves_ = Kernel(device_, Pass{"refit_leaves", refit_leaves_spv}, 0);
    refit_nodes_ = Kernel(device_, Pass{"refit_nodes", refit_nodes_spv}, 0);
    has_kernels_ = true;
  }
  std::uint32_t boxes = 0;
  for (std::size_t i = 0; i < meshes_.size(); ++i) {
    meshes_[i].place = places[i];
    meshes_[i].first_box = boxes;
    boxes += meshes_[i].room;
  }
  boxes_ = create_storage_buffer(device_, for_deformation, boxes * sizeof(gpu::GpuRefitBox));
  roots_ =
      create_storage_buffer(device_, for_deformation, meshes_.size() * sizeof(gpu::GpuRefitBox));
  upload_undeformed();
  upload_plans();
}

void Deformer::upload_undeformed() {
  std::vector<glm::vec4> undeformed;
  std::vector<gpu::GpuInfluence> influences;
  std::vector<gpu::GpuMorphOffset> offsets;
  for (Mesh& mesh : meshes_) {
    const scene::Undeformed& from = *mesh.undeformed;
    mesh.push = {.vertices = static_cast<std::uint32_t>(from.positions.size()),
                 .first_vertex = mesh.place.first_vertex,
                 .first_undeformed = static_cast<std::uint32_t>(undeformed.size() / 2),
                 .influences_per_vertex = from.influences_per_vertex,
                 .first_influence = static_cast<std::uint32_t>(influences.size()),
                 .first_joint = 0,  // see upload_shapes()
                 .first_offset = static_cast<std::uint32_t>(offsets.size()),
                 .first_weight = 0,
                 .weights = 0,
                 .flat_normals = from.flat ? 1u : 0u};
    for (std::size_t v = 0; v < from.positions.size(); ++v) {
      undeformed.emplace_back(from.positions[v], 0);
      undeformed.emplace_back(from.normals[v], 0);
    }
    for (const scene::Influence& influence : from.influences)
      influences.push_back(encoded(influence));
    for (const scene::MorphTarget& target : from.targets)
      for (std::size_t v = 0; v < from.positions.size(); ++v)
        offsets.push_back(
            {target.positions[v], target.normals.empty() ? glm::vec3(0) : target.normals[v]});
  }
  upload_storage(device_, for_deformation, undeformed_, undeformed);
  upload_storage(device_, for_deformation, influences_, influences);
  upload_storage(device_, for_deformation, offsets_, offsets);
}

void Deformer::upload_plans() {
  std::vector<gpu::GpuRefitLeaf> leaves;
  std::vector<std::uint32_t> nodes;
  for (Mesh& mesh : meshes_) {
    mesh.first_leaf = static_cast<std::uint32_t>(leaves.size());
    mesh.first_node = static_cast<std::uint32_t>(nodes.size());
    leaves.insert(leaves.end(), mesh.plan.leaves.begin(), mesh.plan.leaves.end());
    nodes.insert(nodes.end(), mesh.plan.nodes.begin(), mesh.plan.nodes.end());
  }
  upload_storage(device_, for_deformation, leaves_, leaves);
  upload_storage(device_, for_deformation, nodes_, nodes);
}

// Uploads the joints and the weights of all meshes that have a shape yet. Targets of no weight are
// left out.
void Deformer::upload_shapes() {
  std::vector<glm::vec4> rows;
  std::vector<gpu::GpuMorphWeight> weights;
  for (Mesh& mesh : meshes_) {
    if (!mesh.shape) continue;
    mesh.push.first_joint = static_cast<std::uint32_t>(rows.size() / 3);
    for (const glm::dmat4& m : mesh.shape->joints)
      for (int row = 0; row < 3; ++row)
        rows.emplace_back(m[0][row], m[1][row], m[2][row], m[3][row]);
    mesh.push.first_weight = static_cast<std::uint32_t>(weights.size());
    mesh.push.weights = 0;
    for (std::uint32_t i = 0; i < mesh.shape->weights.size(); ++i) {
      if (mesh.shape->weights[i] == 0) continue;
      weights.push_back({i, static_cast<float>(mesh.shape->weights[i])});
      ++mesh.push.weights;
    }
  }
  upload_storage(device_, for_deformation, joints_, rows);
  upload_storage(device_, for_deformation, weights_, weights);
}

void Deformer::record(const vk::raii::CommandBuffer& commands, Mesh& mesh, const Buffers& buffers) {
  deform_.dispatch({commands, mesh.push, buffers}, mesh.push.vertices);
  gpu::GpuRefit refit{.count = static_cast<std::uint32_t>(mesh.plan.leaves.size()),
                      .first = mesh.first_leaf,
                      .first_record = mesh.place.first_record,
                      .first_box = mesh.first_box,
                      .first_vertex = mesh.place.first_vertex,
                      .scale = std::ldexp(1.0f, mesh.place.bvh->grid_exponent)};
  refit_leaves_.dispatch({commands, refit, buffers}, refit.count);
  refit.first = mesh.first_node;
  for (const std::uint32_t nodes : mesh.plan.levels) {
    refit.count = nodes;
    refit_nodes_.dispatch({commands, refit, buffers}, nodes);
    refit.first += nodes;
  }
}

std::vector<std::size_t> Deformer::deform(std::span<const scene::Shape> shapes, Buffer& bvh,
                                          const Buffer& vertices) {
  watch_last();
  std::vector<Mesh*> changed;
  std::vector<std::size_t> refitted;
  for (std::size_t i = 0; i < meshes_.size(); ++i) {
    Mesh& mesh = meshes_[i];
    if (mesh.shape == shapes[i] || mesh.plan.leaves.empty()) continue;
    const scene::Aabb bounds = scene::deformed_bounds(*mesh.reach, shapes[i]);
    if (!can_be_traced(bounds)) continue;
    mesh.shape = shapes[i];
    mesh.place.bvh->bounds = bounds;
    mesh.place.bvh->grid_exponent = scene::grid_exponent_of(bounds);
    changed.push_back(&mesh);
    refitted.push_back(i);
  }
  if (changed.empty()) return {};
  take_better_trees(changed, bvh);
  upload_shapes();
  const Buffers buffers = {
      {"undeformed", &undeformed_},   {"influences", &influences_}, {"joint_rows", &joints_},
      {"morph_offsets", &offsets_},   {"morph_weights", &weights_}, {"vertices", &vertices},
      {"shaped_vertices", &vertices}, {"bvh_texels", &bvh},         {"refit_leaves", &leaves_},
      {"refit_nodes", &nodes_},       {"refit_boxes", &boxes_}};
  constexpr vk::DeviceSize box_bytes = sizeof(gpu::GpuRefitBox);
  device_.record([&](const vk::raii::CommandBuffer& commands) {
    for (std::size_t i = 0; i < changed.size(); ++i) {
      record(commands, *changed[i], buffers);
      commands.copyBuffer(
          boxes_.buffer, roots_.buffer,
          vk::BufferCopy(changed[i]->first_box * box_bytes, i * box_bytes, box_bytes));
    }
    device_.submissions().barrier(commands);
  });
  if (!costs_down_.are_here()) return refitted;
  refitted_ = refitted;
  costs_.resize(changed.size());
  costs_down_.add(device_, roots_, std::as_writable_bytes(std::span(costs_)));
  if (costs_down_.are_here()) watch_last();
  return refitted;
}

// Looks at what the trees that were refitted last have come to cost.
void Deformer::watch_last() {
  if (costs_down_.are_under_way()) return;  // the next frame has come before them
  costs_down_.finish();
  for (std::size_t i = 0; i < refitted_.size(); ++i) watch(meshes_[refitted_[i]], costs_[i]);
  refitted_.clear();
}

// Begins to build a better tree for the shape of now, if the one that there is has become too bad.
void Deformer::watch(Mesh& mesh, const gpu::GpuRefitBox& root) {
  const double area = half_area(root.low, root.high);
  const double cost = area > 0 ? static_cast<double>(root.cost) / area : 0;
  if (mesh.better.valid() || !(cost > most_growth * mesh.built_cost)) return;
  mesh.better = std::async(
      std::launch::async, [undeformed = mesh.undeformed, pairs = mesh.pairs, shape = *mesh.shape] {
        return scene::build_refittable_bvh(pairs, scene::deformed(*undeformed, shape).positions);
      });
}

// Only trees of meshes that are refitted now are taken, because a tree has the boxes of the shape
// that it was built for.
void Deformer::take_better_trees(std::span<Mesh* const> meshes, Buffer& bvh) {
  bool is_taken = false;
  for (Mesh* mesh : meshes) {
    if (!mesh->better.valid() ||
        mesh->better.wait_for(std::chrono::seconds(0)) != std::future_status::ready)
      continue;
    scene::RefittableBvh better = mesh->better.get();
    if (record_count(better.bvh) > mesh->room) {
      // The next one is not tried before it is worse still.
      mesh->built_cost = most_growth * std::max(mesh->built_cost, cost_of(better.bvh));
      continue;
    }
    upload_bytes(
        device_, bvh, std::as_bytes(std::span(better.bvh.texels)),
        std::size_t{mesh->place.first_record} * scene::texels_per_record * sizeof(glm::uvec4));
    mesh->plan = std::move(better.plan);
    mesh->built_cost = cost_of(better.bvh);
    is_taken = true;
    ++rebuilt_;
  }
  if (is_taken) upload_plans();
}

}  // namespace previz::render
