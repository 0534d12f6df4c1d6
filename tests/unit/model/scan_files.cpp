#include "tests/unit/model/scan_files.hpp"

#include <fmt/format.h>

#include "tests/support/test.hpp"

namespace previz::test {
namespace {

template <class T>
void put(std::ostream& out, const T& value) {
  out.write(reinterpret_cast<const char*>(&value), sizeof(T));
}

}  // namespace

model::TriangleMesh lump(unsigned rings) {
  model::TriangleMesh mesh;
  const unsigned around = 2 * rings;
  const auto at = [](double polar, double azimuth) {
    const double x = std::sin(polar) * std::cos(azimuth), y = std::sin(polar) * std::sin(azimuth),
                 z = std::cos(polar);
    return glm::vec3(0.1 * (1 + 0.3 * x + 0.2 * y * z + 0.15 * z * z * z) * glm::dvec3(x, y, z));
  };
  mesh.positions.push_back(at(0, 0));
  for (unsigned r = 1; r < rings; ++r)
    for (unsigned a = 0; a < around; ++a)
      mesh.positions.push_back(at(std::numbers::pi * r / rings, 2 * std::numbers::pi * a / around));
  mesh.positions.push_back(at(std::numbers::pi, 0));
  const auto index = [&](unsigned r, unsigned a) { return 1 + (r - 1) * around + a % around; };
  const auto last = static_cast<unsigned>(mesh.positions.size() - 1);
  for (unsigned a = 0; a < around; ++a) {
    mesh.indices.insert(mesh.indices.end(), {0, index(1, a), index(1, a + 1)});
    for (unsigned r = 1; r + 1 < rings; ++r)
      mesh.indices.insert(mesh.indices.end(), {index(r, a), index(r + 1, a), index(r + 1, a + 1),
                                               index(r, a), index(r + 1, a + 1), index(r, a + 1)});
    mesh.indices.insert(mesh.indices.end(), {index(rings - 1, a), last, index(rings - 1, a + 1)});
  }
  return mesh;
}

model::TriangleMesh wavy_sheet(unsigned side) {
  model::TriangleMesh mesh;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> noise(-1e-4, 1e-4);
  for (unsigned y = 0; y <= side; ++y)
    for (unsigned x = 0; x <= side; ++x) {
      const double u = 0.2 * x / side, v = 0.2 * y / side;
      mesh.positions.emplace_back(u, v,
                                  0.002 * std::sin(60 * u) * std::cos(45 * v) + noise(random));
    }
  for (unsigned y = 0; y < side; ++y)
    for (unsigned x = 0; x < side; ++x) {
      const unsigned a = y * (side + 1) + x, b = a + 1, c = a + side + 1, d = c + 1;
      mesh.indices.insert(mesh.indices.end(), {a, b, d, a, d, c});
    }
  return mesh;
}

void write_obj(const std::filesystem::path& file, const model::TriangleMesh& mesh, double unit_m) {
  std::ofstream out(file);
  for (const glm::vec3& p : mesh.positions) {
    const glm::dvec3 in_unit = glm::dvec3(p) / unit_m;
    out << fmt::format("v {:.9g} {:.9g} {:.9g}\n", in_unit.x, in_unit.y, in_unit.z);
  }
  for (std::size_t i = 0; i < mesh.indices.size(); i += 3)
    out << fmt::format("f {} {} {}\n", mesh.indices[i] + 1, mesh.indices[i + 1] + 1,
                       mesh.indices[i + 2] + 1);
}

void write_ply(const std::filesystem::path& file, const model::TriangleMesh& mesh) {
  std::ofstream out(file, std::ios::binary);
  out << "ply\nformat binary_little_endian 1.0\nelement vertex " << mesh.positions.size()
      << "\nproperty float x\nproperty float y\nproperty float z\nelement face " << mesh.triangles()
      << "\nproperty list uchar int vertex_indices\nend_header\n";
  for (const glm::vec3& p : mesh.positions) put(out, p);
  for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
    put(out, std::uint8_t{3});
    for (std::size_t k = 0; k < 3; ++k) put(out, mesh.indices[i + k]);
  }
}

void write_stl(const std::filesystem::path& file, const model::TriangleMesh& mesh) {
  std::ofstream out(file, std::ios::binary);
  put(out, std::array<char, 80>{});
  put(out, static_cast<std::uint32_t>(mesh.triangles()));
  for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
    put(out, glm::vec3(0));
    for (std::size_t k = 0; k < 3; ++k) put(out, mesh.positions[mesh.indices[i + k]]);
    put(out, std::uint16_t{0});
  }
}

}  // namespace previz::test
