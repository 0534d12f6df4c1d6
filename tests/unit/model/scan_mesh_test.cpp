// The surface of a scan: welded, mended, shaded and simplified.
#include "daemon/tools/model/scan_mesh.hpp"

#include "daemon/tools/model/scan_simplify.hpp"
#include "tests/support/test.hpp"
#include "tests/unit/model/scan_files.hpp"

namespace previz::test {
namespace {

// Each triangle has corners of its own, as in STL.
model::TriangleMesh torn(const model::TriangleMesh& mesh) {
  model::TriangleMesh result;
  for (const unsigned v : mesh.indices) {
    result.indices.push_back(static_cast<unsigned>(result.positions.size()));
    result.positions.push_back(mesh.positions[v]);
  }
  return result;
}

model::TriangleMesh cube() {
  model::TriangleMesh mesh;
  for (unsigned i = 0; i < 8; ++i) mesh.positions.emplace_back(i & 1, i >> 1 & 1, i >> 2 & 1);
  for (const auto& [a, b, c, d] : std::initializer_list<std::array<unsigned, 4>>{
           {0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}})
    mesh.indices.insert(mesh.indices.end(), {a, b, c, a, c, d});
  return mesh;
}

TEST(ScanMesh, OneVertexIsMadeOfThoseInOnePlace) {
  const model::TriangleMesh whole = lump(8);
  model::TriangleMesh mesh = torn(whole);
  mesh.positions[0] *= glm::vec3(1, -1, 1);  // its y is 0, and now -0
  model::weld(mesh);
  EXPECT_EQ(mesh.positions.size(), whole.positions.size());
  const model::MeshFaults faults = model::mend(mesh);
  EXPECT_EQ(faults.open_borders, 0u);
  EXPECT_EQ(faults.opposite_edges, 0u);
  EXPECT_EQ(faults.without_area, 0u);
}

TEST(ScanMesh, HolesAreCountedAndMeasured) {
  model::TriangleMesh mesh = cube();
  mesh.indices.erase(mesh.indices.begin(), mesh.indices.begin() + 6);  // z = 0
  mesh.indices.erase(mesh.indices.begin(), mesh.indices.begin() + 3);  // half of z = 1
  const model::MeshFaults faults = model::mend(mesh);
  EXPECT_EQ(faults.open_borders, 2u);
  EXPECT_NEAR(faults.longest_border, 4, 1e-6);
}

TEST(ScanMesh, FacesThatFaceTheOtherWayAreTurned) {
  const model::TriangleMesh whole = lump(8);
  model::TriangleMesh mesh = whole;
  for (const std::size_t t : {3u, 20u, 21u, 100u})
    std::swap(mesh.indices[3 * t + 1], mesh.indices[3 * t + 2]);
  const model::MeshFaults faults = model::mend(mesh);
  EXPECT_GT(faults.opposite_edges, 0u);
  EXPECT_EQ(faults.turned, 4u);
  EXPECT_EQ(faults.opposite_left, 0u);
  EXPECT_EQ(mesh.indices, whole.indices);
}

TEST(ScanMesh, ABandWithOneSideIsLeftAsItIs) {
  model::TriangleMesh mesh;
  const unsigned steps = 12;
  for (unsigned i = 0; i < steps; ++i) {
    const double angle = 2 * std::numbers::pi * i / steps;
    for (const double side : {-0.3, 0.3})
      mesh.positions.emplace_back((1 + side * std::cos(angle / 2)) * std::cos(angle),
                                  (1 + side * std::cos(angle / 2)) * std::sin(angle),
                                  side * std::sin(angle / 2));
  }
  for (unsigned i = 0; i < steps; ++i) {
    const bool is_last = i + 1 == steps;
    const unsigned a = 2 * i, b = a + 1, c = is_last ? 1 : a + 2, d = is_last ? 0 : a + 3;
    mesh.indices.insert(mesh.indices.end(), {a, b, c, b, d, c});
  }
  const model::MeshFaults faults = model::mend(mesh);
  EXPECT_EQ(faults.turned, 0u);
  EXPECT_EQ(faults.opposite_left, faults.opposite_edges);
  EXPECT_GT(faults.opposite_left, 0u);
}

TEST(ScanMesh, NormalsAreSplitAtEdgesOnly) {
  const model::ShadedMesh box = model::shaded(cube());
  EXPECT_EQ(box.positions.size(), 24u);
  for (std::size_t i = 0; i < box.positions.size(); ++i) {
    const glm::vec3 out = box.positions[i] - 0.5f;
    EXPECT_FLOAT_EQ(glm::length(box.normals[i]), 1);
    EXPECT_FLOAT_EQ(glm::dot(out, box.normals[i]), 0.5f);
  }
  const model::TriangleMesh whole = lump(24);
  const model::ShadedMesh smooth = model::shaded(whole);
  EXPECT_EQ(smooth.positions.size(), whole.positions.size());
  EXPECT_EQ(smooth.indices.size(), whole.indices.size());
}

double distance_of_segment(const glm::dvec3& p, const glm::dvec3& a, const glm::dvec3& b) {
  const double t = std::clamp(glm::dot(p - a, b - a) / glm::dot(b - a, b - a), 0.0, 1.0);
  return glm::distance(p, a + t * (b - a));
}

double distance_of_triangle(const glm::dvec3& p, const glm::dvec3& a, const glm::dvec3& b,
                            const glm::dvec3& c) {
  const glm::dvec3 n = glm::normalize(glm::cross(b - a, c - a));
  const auto is_inside = [&](const glm::dvec3& from, const glm::dvec3& to) {
    return glm::dot(glm::cross(to - from, p - from), n) >= 0;
  };
  if (is_inside(a, b) && is_inside(b, c) && is_inside(c, a)) return std::abs(glm::dot(p - a, n));
  return std::min(
      {distance_of_segment(p, a, b), distance_of_segment(p, b, c), distance_of_segment(p, c, a)});
}

// By every triangle for each vertex.
double largest_distance(const model::TriangleMesh& from, const model::TriangleMesh& to) {
  double most = 0;
  for (const glm::vec3& p : from.positions) {
    double least = 1e9;
    for (std::size_t i = 0; i < to.indices.size(); i += 3)
      least = std::min(least, distance_of_triangle(p, to.positions[to.indices[i]],
                                                   to.positions[to.indices[i + 1]],
                                                   to.positions[to.indices[i + 2]]));
    most = std::max(most, least);
  }
  return most;
}

TEST(ScanSimplify, NoVertexIsFartherOffThanIsAllowed) {
  for (const model::TriangleMesh& mesh : {wavy_sheet(50), lump(32)}) {
    std::size_t triangles = mesh.triangles();
    for (const double most_m : {2e-4, 5e-4, 2e-3}) {
      const model::Simplified simple = model::simplified(mesh, most_m);
      const double off_m = largest_distance(mesh, simple.mesh);
      EXPECT_LE(off_m, most_m);
      // Embree's search is in single precision: 1e-7 of the distance's own 0.2 m.
      EXPECT_NEAR(simple.error, off_m, 5e-8);
      EXPECT_LT(simple.mesh.triangles(), triangles) << most_m;
      triangles = simple.mesh.triangles();
    }
    EXPECT_LT(triangles, mesh.triangles() / 4);
  }
}

TEST(ScanSimplify, NothingIsRemovedWithoutAnError) {
  const model::TriangleMesh mesh = lump(8);
  const model::Simplified same = model::simplified(mesh, 0);
  EXPECT_EQ(same.mesh.indices, mesh.indices);
  EXPECT_EQ(same.error, 0);
}

TEST(ScanSimplify, AThingSmallerThanTheErrorIsKept) {
  EXPECT_GT(model::simplified(lump(8), 10).mesh.triangles(), 0u);
}

}  // namespace
}  // namespace previz::test
