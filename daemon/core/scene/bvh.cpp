#include "daemon/core/scene/bvh.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>

#include "daemon/core/scene/bvh_pairs.hpp"
#include "daemon/core/scene/bvh_wide.hpp"
#include "daemon/core/scene/transform.hpp"
#include "drivers/error.hpp"
#include "shaders/lib/shared.h"

namespace previz::scene {
namespace {

constexpr std::uint32_t records_per_block = 8;
constexpr float largest_coordinate = 1e20f;
constexpr std::size_t most_triangles = 1u << 24;  // the primitive of a hit is stored in 24 bits
// What a pixel shows is stored in 24 bits, which can also say that it is nothing
// (shaders/lib/history.glsl).
constexpr std::size_t most_instances = (1u << 24) - 1;

struct Triangles {
  std::vector<std::array<glm::vec3, 3>> corners;
  std::vector<std::uint32_t> primitives;
};

bool usable(const std::array<glm::vec3, 3>& corners) {
  for (const glm::vec3& p : corners)
    for (int axis = 0; axis < 3; ++axis)
      if (!(std::abs(p[axis]) <= largest_coordinate)) return false;
  const glm::dvec3 a(corners[0]);
  return glm::cross(glm::dvec3(corners[1]) - a, glm::dvec3(corners[2]) - a) != glm::dvec3(0);
}

bool has_vertices(const Mesh& mesh, const glm::uvec3& t) {
  return std::max({t.x, t.y, t.z}) < mesh.positions.size();
}

std::array<glm::vec3, 3> corners_of(const Mesh& mesh, const glm::uvec3& t) {
  return {mesh.positions[t.x], mesh.positions[t.y], mesh.positions[t.z]};
}

Triangles usable_triangles(const Mesh& mesh) {
  Triangles result;
  result.primitives = traced_triangles(mesh, false);
  for (const std::uint32_t i : result.primitives)
    result.corners.push_back(corners_of(mesh, mesh.triangles[i]));
  return result;
}

Aabb bounds_of(const Triangles& triangles) {
  Aabb bounds;
  for (const auto& corners : triangles.corners)
    for (const glm::vec3& p : corners) bounds = merged(bounds, {p, p});
  return bounds;
}

double extent_of(const Aabb& bounds) {
  const glm::vec3 extent = glm::max(glm::abs(bounds.low), glm::abs(bounds.high));
  return std::max({extent.x, extent.y, extent.z});
}

glm::dmat4 uniform_scale(double scale) {
  glm::dmat4 result(scale);
  result[3][3] = 1;
  return result;
}

// Returns none where no ray could be taken there.
std::optional<glm::dmat4> grid_from_world(const TopInstance& instance) {
  const glm::dmat4 result = uniform_scale(std::ldexp(1.0, instance.mesh->grid_exponent)) *
                            glm::inverse(instance.world_from_object);
  if (!is_finite(instance.world_from_object) || !is_finite(result)) return std::nullopt;
  return result;
}

Record space_record(const glm::dmat4& grid_from_world, std::uint32_t first_record,
                    std::uint32_t presence, std::uint32_t index) {
  Record record{with_fill(first_record / records_per_block), with_fill(presence), gpu::RECORD_SPACE,
                index};
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column)
      record[4 + static_cast<std::size_t>(4 * row + column)] =
          std::bit_cast<std::uint32_t>(static_cast<float>(grid_from_world[column][row]));
  return record;
}

// Pads a box by the rounding error of a ray that is transformed into an instance, a share of the
// coordinates, which may move a hit out of the box.
Aabb padded(const Aabb& box) {
  const auto margin = static_cast<float>(extent_of(box) * std::ldexp(1.0, -20));
  return {box.low - margin, box.high + margin};
}

}  // namespace

int grid_exponent_of(const Aabb& bounds) {
  return grid_exponent(extent_of(bounds));
}

std::vector<std::uint32_t> traced_triangles(const Mesh& mesh, bool deforms) {
  std::vector<std::uint32_t> result;
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    const glm::uvec3& t = mesh.triangles[i];
    if (has_vertices(mesh, t) && (deforms || usable(corners_of(mesh, t)))) result.push_back(i);
  }
  return result;
}

bool can_be_placed(const TopInstance& instance) {
  return grid_from_world(instance).has_value();
}

void check_triangles(const Mesh& mesh) {
  if (mesh.triangles.size() > most_triangles)
    throw Error("scene: mesh \"" + mesh.name + "\" has " + std::to_string(mesh.triangles.size()) +
                " triangles; at most " + std::to_string(most_triangles) + " are allowed");
}

MeshBvh build_mesh_bvh(const Mesh& mesh, BvhQuality quality) {
  check_triangles(mesh);
  MeshBvh bvh;
  Triangles triangles = usable_triangles(mesh);
  bvh.dropped_triangles =
      static_cast<std::uint32_t>(mesh.triangles.size() - triangles.primitives.size());
  if (triangles.primitives.empty()) return bvh;
  bvh.bounds = bounds_of(triangles);
  bvh.grid_exponent = grid_exponent_of(bvh.bounds);

  const float scale = std::ldexp(1.0f, bvh.grid_exponent);
  for (auto& corners : triangles.corners)
    for (glm::vec3& p : corners) p *= scale;  // exact: a power of two
  const std::vector<TrianglePair> pairs = make_pairs(triangles.corners, triangles.primitives);
  std::vector<Aabb> boxes;
  boxes.reserve(pairs.size());
  for (const TrianglePair& pair : pairs) boxes.push_back(bounds_of(pair));

  const WideTree tree = make_tree(
      boxes, quality,
      [&](std::uint32_t primitive, const Aabb& bounds, int axis, float position, Aabb& left,
          Aabb& right) { split_pair(pairs[primitive], bounds, axis, position, left, right); },
      [&](std::uint32_t primitive) { return pair_record(pairs[primitive]); }, gpu::MESH_BVH_DEPTH);
  append_texels(bvh.texels, tree.records);
  bvh.sah_cost = tree.sah_cost;
  bvh.depth = tree.depth;
  bvh.leaves = tree.leaves;
  return bvh;
}

// There is one block for the record where rays start, one for the root, and one for each node's
// children.
std::size_t top_bvh_texels(std::size_t instance_count) {
  return (instance_count + 2) * records_per_block * texels_per_record;
}

TopBvh build_top_bvh(std::span<const TopInstance> instances) {
  if (instances.size() > most_instances)
    throw Error("scene: it places " + std::to_string(instances.size()) + " meshes; at most " +
                std::to_string(most_instances) + " are allowed");
  TopBvh top;
  std::vector<Record> spaces;
  std::vector<Aabb> boxes;
  double extent = 0;
  for (std::uint32_t i = 0; i < instances.size(); ++i) {
    const TopInstance& instance = instances[i];
    if (instance.mesh == nullptr || instance.mesh->leaves == 0) continue;
    const std::optional<glm::dmat4> space = grid_from_world(instance);
    if (!space) {
      ++top.dropped_instances;
      continue;
    }
    spaces.push_back(space_record(*space, instance.first_record, instance.presence, i));
    boxes.push_back(padded(transform_bounds(instance.mesh->bounds, instance.world_from_object)));
    extent = std::max(extent, extent_of(boxes.back()));
  }

  std::vector<Record> records(records_per_block);
  if (spaces.size() == 1) {
    records[0] = spaces[0];
  } else if (!spaces.empty()) {
    const int exponent = grid_exponent(extent);
    for (Aabb& box : boxes)
      box = {box.low * std::ldexp(1.0f, exponent), box.high * std::ldexp(1.0f, exponent)};
    const WideTree tree = make_tree(
        boxes, BvhQuality::medium, {}, [&](std::uint32_t i) { return spaces[i]; },
        gpu::TOP_BVH_DEPTH);
    records[0] =
        space_record(uniform_scale(std::ldexp(1.0, exponent)), records_per_block, world_both, 0);
    records.insert(records.end(), tree.records.begin(), tree.records.end());
  }
  records.resize(top_bvh_texels(instances.size()) / texels_per_record);
  append_texels(top.texels, records);
  return top;
}

Aabb transform_bounds(const Aabb& object_bounds, const glm::dmat4& world_from_object) {
  Aabb bounds;
  if (object_bounds.low.x > object_bounds.high.x) return bounds;  // nothing is in it
  for (int corner = 0; corner < 8; ++corner) {
    const glm::dvec4 object((corner & 1 ? object_bounds.high : object_bounds.low).x,
                            (corner & 2 ? object_bounds.high : object_bounds.low).y,
                            (corner & 4 ? object_bounds.high : object_bounds.low).z, 1.0);
    const glm::vec3 world(glm::dvec3(world_from_object * object));
    bounds.low = glm::min(bounds.low, world);
    bounds.high = glm::max(bounds.high, world);
  }
  return bounds;
}

}  // namespace previz::scene
