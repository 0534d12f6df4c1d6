// What the builder writes: every triangle, in boxes that hold it, in a tree of good cost.
#include "daemon/bench/shapes.hpp"
#include "daemon/core/scene/bvh.hpp"
#include "shaders/lib/shared.h"
#include "tests/support/bvh_decode.hpp"
#include "tests/support/test.hpp"

namespace previz::scene::bvh_build_test {

using test::DecodedRecord;

const BvhQuality qualities[] = {BvhQuality::low, BvhQuality::medium, BvhQuality::high};

// Exact: the grid is object space times a power of two, and boxes are rounded outwards. With
// spatial splits a box holds only its part of the triangle.
void expect_sound(const Mesh& mesh, const MeshBvh& bvh, bool split, std::uint32_t expected) {
  const float scale = std::ldexp(1.0f, bvh.grid_exponent);
  std::map<std::uint32_t, int> found;
  std::uint32_t levels = 0, leaves = 0, outside = 0, moved = 0, escaped = 0;
  const std::uint32_t not_inverted = test::visit(bvh, [&](const DecodedRecord& record) {
    if (record.triangles.empty()) levels = std::max(levels, record.level);
    if (!record.triangles.empty()) ++leaves;
    for (const auto& triangle : record.triangles) {
      ++found[triangle.primitive];
      for (int i = 0; i < 3; ++i) {
        const glm::vec3& p = triangle.corners[static_cast<std::size_t>(i)];
        moved += p != scale * mesh.positions[mesh.triangles[triangle.primitive][i]];
        if (!split)
          outside += glm::any(glm::lessThan(p, record.bounds.low)) ||
                     glm::any(glm::greaterThan(p, record.bounds.high));
      }
    }
    if (record.level == 1) return;
    // Children may stand out of their parent's box by the parent's and their own rounding only.
    const glm::vec3 size = record.bounds.high - record.bounds.low;
    for (const Aabb& child : record.children)
      escaped += glm::any(glm::lessThan(child.low, record.bounds.low - 0.02f * size - 2.0f)) ||
                 glm::any(glm::greaterThan(child.high, record.bounds.high + 0.02f * size + 2.0f));
  });
  EXPECT_EQ(found.size(), expected);
  if (!split) {
    for (const auto& [primitive, times] : found) EXPECT_EQ(times, 1) << primitive;
  }
  EXPECT_EQ(moved, 0u);
  EXPECT_EQ(outside, 0u);
  EXPECT_EQ(escaped, 0u);
  EXPECT_EQ(not_inverted, 0u);
  EXPECT_EQ(levels, bvh.depth);
  EXPECT_EQ(leaves, bvh.leaves);
  EXPECT_LE(bvh.depth, gpu::MESH_BVH_DEPTH);
}

TEST(BvhBuild, HoldsEveryTriangleOnceInBoxesThatContainIt) {
  for (const BvhQuality quality : {BvhQuality::low, BvhQuality::medium}) {
    for (const Mesh& mesh :
         {bench::bumpy_sphere(3, 1.0, 0.2, 1), bench::random_triangles(500, 5, 1, 2),
          bench::random_triangles(500, 3000, 1e-3f, 3)}) {
      const MeshBvh bvh = build_mesh_bvh(mesh, quality);
      expect_sound(mesh, bvh, false, static_cast<std::uint32_t>(mesh.triangles.size()));
      EXPECT_EQ(bvh.dropped_triangles, 0u);
    }
  }
}

TEST(BvhBuild, SplitsKeepEveryTriangle) {
  const Mesh mesh = bench::random_triangles(2000, 1, 1, 5);
  const MeshBvh bvh = build_mesh_bvh(mesh, BvhQuality::high);
  expect_sound(mesh, bvh, true, 2000);
  EXPECT_GT(bvh.leaves, 2000u) << "no triangle was split, so this tests nothing";
}

TEST(BvhBuild, SameInputSameBytes) {
  // Large enough for Embree's parallel paths (above 4096 boxes).
  const Mesh mesh = bench::sphere_field(20'000);
  for (const BvhQuality quality : qualities) {
    const MeshBvh first = build_mesh_bvh(mesh, quality);
    for (int i = 0; i < 4; ++i)
      EXPECT_EQ(build_mesh_bvh(mesh, quality).texels, first.texels) << static_cast<int>(quality);
  }
}

TEST(BvhBuild, JoinsTheTrianglesOfAGridByTwos) {
  const Mesh mesh = bench::grid(10.0f, 32);
  EXPECT_EQ(build_mesh_bvh(mesh).leaves, mesh.triangles.size() / 2);
}

TEST(BvhBuild, DropsAndCountsWhatCannotBeTraced) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  Mesh mesh;
  mesh.positions = {{0, 0, 0},   {1, 0, 0},   {0, 1, 0},    {2, 0, 0},
                    {nan, 0, 0}, {0, inf, 0}, {1e30f, 0, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 1, 3}, {0, 0, 1}, {0, 1, 4}, {0, 1, 5}, {0, 1, 6}, {0, 1, 99}};
  const MeshBvh bvh = build_mesh_bvh(mesh);
  EXPECT_EQ(bvh.dropped_triangles, 6u);
  expect_sound(mesh, bvh, false, 1);
  EXPECT_EQ(bvh.bounds.high, glm::vec3(1, 1, 0));
}

TEST(BvhBuild, AnEmptyMeshHasNoRecords) {
  const MeshBvh bvh = build_mesh_bvh(Mesh{});
  EXPECT_TRUE(bvh.texels.empty());
  EXPECT_GT(bvh.bounds.low.x, bvh.bounds.high.x);
}

TEST(BvhBuild, StaysShallowWhateverTheGeometry) {
  // Each triangle half the size of the one before, all at one corner: SAH peels them off one by
  // one.
  Mesh nested;
  for (int i = 0; i < 3000; ++i) {
    const float size = std::ldexp(1.0f, -(i % 100));
    const auto first = static_cast<std::uint32_t>(nested.positions.size());
    nested.positions.insert(
        nested.positions.end(),
        {{size, 0, 0}, {0, size, 0}, {0, 0, size + 1e-7f * static_cast<float>(i)}});
    nested.triangles.emplace_back(first, first + 1, first + 2);
  }
  // All in one place.
  Mesh same;
  same.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  same.triangles.assign(5000, {0, 1, 2});
  for (const BvhQuality quality : qualities) {
    expect_sound(nested, build_mesh_bvh(nested, quality), quality == BvhQuality::high, 3000);
    expect_sound(same, build_mesh_bvh(same, quality), quality == BvhQuality::high, 5000);
  }
}

// The expected number of records a random ray visits, from the boxes as they were encoded.
double decoded_cost(const MeshBvh& bvh) {
  double sum = 0, root = 0;
  test::visit(bvh, [&](const DecodedRecord& record) {
    if (record.level > 1) sum += half_area(record.bounds);
    if (record.level > 1) return;
    Aabb bounds;
    for (const Aabb& child : record.children) bounds = merged(bounds, child);
    root = half_area(bounds);
    sum += root;
  });
  return sum / root;
}

struct Costed {
  Mesh mesh;
  double reference;
};

// The references are the costs of the simplest good builder's trees: splits by the surface area
// heuristic, swept over every place of each axis, one triangle a leaf, and eight wide by opening
// the widest child again and again.
TEST(BvhBuild, CostIsThatOfAGoodTree) {
  for (const auto& [mesh, reference] :
       {Costed{bench::bumpy_sphere(4, 1.0, 0.2, 1), 12.895898},
        Costed{bench::sphere_field(8000), 8.088385},
        Costed{bench::random_triangles(4000, 10, 0.5f, 4), 16.659942}}) {
    const MeshBvh medium = build_mesh_bvh(mesh, BvhQuality::medium);
    const MeshBvh high = build_mesh_bvh(mesh, BvhQuality::high);
    // Binned instead of swept splits cost a few percent, optimal collapsing and pairs save more.
    EXPECT_LT(medium.sah_cost, 1.03 * reference);
    EXPECT_LT(high.sah_cost, 1.03 * medium.sah_cost);
    // The cost reported is the cost encoded: rounding to 1/255 of the parent grows a box of a
    // quarter of its parent's edge by 2/64 an axis at most, thus its area by 7 %.
    EXPECT_GT(decoded_cost(medium), 0.999 * medium.sah_cost);
    EXPECT_LT(decoded_cost(medium), 1.10 * medium.sah_cost);
  }
}

TEST(BvhTop, TakesTheSameRoomWhereverInstancesAre) {
  const MeshBvh mesh = build_mesh_bvh(bench::bumpy_sphere(1, 1.0, 0.2, 1));
  for (const std::size_t count : {0, 1, 2, 3, 9, 100}) {
    std::vector<TopInstance> instances(count);
    for (std::size_t i = 0; i < count; ++i) {
      instances[i].mesh = &mesh;
      instances[i].world_from_object[3] = glm::dvec4(static_cast<double>(i * i), 0, 0, 1);
    }
    const TopBvh top = build_top_bvh(instances);
    EXPECT_EQ(top.texels.size(), top_bvh_texels(count));
    EXPECT_EQ(top.texels, build_top_bvh(instances).texels);
    EXPECT_EQ(top.dropped_instances, 0u);
  }
}

TEST(BvhTop, DropsAndCountsInstancesWithoutInverse) {
  const MeshBvh mesh = build_mesh_bvh(bench::bumpy_sphere(1, 1.0, 0.2, 1));
  const MeshBvh empty = build_mesh_bvh(Mesh{});
  std::vector<TopInstance> instances(4);
  for (TopInstance& instance : instances) instance.mesh = &mesh;
  instances[1].world_from_object[0] = glm::dvec4(0);
  instances[2].world_from_object[3].x = std::numeric_limits<double>::infinity();
  instances[3].mesh = &empty;
  EXPECT_EQ(build_top_bvh(instances).dropped_instances, 2u);
}

TEST(BvhTop, BoundsOfATurnedBoxHoldItsCorners) {
  glm::dmat4 turn(1.0);
  turn[0] = {0.6, 0.8, 0, 0};
  turn[1] = {-0.8, 0.6, 0, 0};
  turn[3] = {10, 20, 30, 1};
  const Aabb box = transform_bounds({{-1, -1, -1}, {1, 1, 1}}, turn);
  // Edge lengths of the turned square: 2 (0.6 + 0.8).
  EXPECT_NEAR(box.low.x, 10 - 1.4, 1e-5);
  EXPECT_NEAR(box.high.y, 20 + 1.4, 1e-5);
  EXPECT_NEAR(box.high.z, 31, 1e-5);
}

}  // namespace previz::scene::bvh_build_test
