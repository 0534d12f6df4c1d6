#include "daemon/tools/model/scan_mesh.hpp"

#include <meshoptimizer.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/geometric.hpp>
#include <limits>
#include <numeric>
#include <utility>

namespace previz::model {
namespace {

constexpr unsigned no_neighbour = std::numeric_limits<unsigned>::max();
constexpr float cos_crease = 0.5f;  // of 60 degrees

// The side of a triangle from its corner number `corner` % 3 to the next one.
struct Side {
  std::uint64_t edge = 0;  // both vertices, the lower one in the upper half
  unsigned corner = 0;     // index into TriangleMesh::indices
  bool rises = false;      // from the lower vertex to the higher one
};

unsigned next_corner(unsigned corner) {
  return corner % 3 == 2 ? corner - 2 : corner + 1;
}

std::vector<Side> sides_by_edge(const TriangleMesh& mesh) {
  std::vector<Side> sides(mesh.indices.size());
  for (unsigned c = 0; c < sides.size(); ++c) {
    const unsigned from = mesh.indices[c], to = mesh.indices[next_corner(c)];
    sides[c] = {std::uint64_t{std::min(from, to)} << 32 | std::max(from, to), c, from < to};
  }
  std::ranges::sort(sides, [](const Side& a, const Side& b) {
    return std::pair(a.edge, a.corner) < std::pair(b.edge, b.corner);
  });
  return sides;
}

glm::vec3 double_area(const TriangleMesh& mesh, std::size_t triangle) {
  const glm::vec3 &a = mesh.positions[mesh.indices[3 * triangle]],
                  &b = mesh.positions[mesh.indices[3 * triangle + 1]],
                  &c = mesh.positions[mesh.indices[3 * triangle + 2]];
  return glm::cross(b - a, c - a);
}

// Sets of vertices that are joined, two at a time (union-find).
class Joined {
 public:
  explicit Joined(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), 0u);
  }
  unsigned root(unsigned v) {
    while (parent_[v] != v) v = parent_[v] = parent_[parent_[v]];
    return v;
  }
  void join(unsigned a, unsigned b) { parent_[root(a)] = root(b); }

 private:
  std::vector<unsigned> parent_;
};

void measure_borders(const TriangleMesh& mesh, const std::vector<Side>& border,
                     MeshFaults& faults) {
  const auto ends = [&](const Side& side) {
    return std::pair(mesh.indices[side.corner], mesh.indices[next_corner(side.corner)]);
  };
  Joined joined(mesh.positions.size());
  for (const Side& side : border) joined.join(ends(side).first, ends(side).second);
  std::vector<std::pair<unsigned, double>> pieces;  // root and length
  for (const Side& side : border) {
    const auto [a, b] = ends(side);
    pieces.emplace_back(joined.root(a), glm::distance(glm::dvec3(mesh.positions[a]),
                                                      glm::dvec3(mesh.positions[b])));
  }
  std::ranges::sort(pieces);
  for (std::size_t i = 0; i < pieces.size();) {
    double around = 0;
    const unsigned root = pieces[i].first;
    for (; i < pieces.size() && pieces[i].first == root; ++i) around += pieces[i].second;
    ++faults.open_borders;
    faults.longest_border = std::max(faults.longest_border, around);
  }
}

// The triangle beyond each corner's side.
struct Neighbour {
  unsigned triangle = no_neighbour;
  bool is_opposite = false;  // traverses the edge in the same direction
};

// Looks at each edge, and returns who is beyond it where it has two triangles.
std::vector<Neighbour> find_neighbours(const TriangleMesh& mesh, MeshFaults& faults) {
  const std::vector<Side> sides = sides_by_edge(mesh);
  std::vector<Neighbour> neighbours(mesh.indices.size());
  std::vector<Side> border;
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t end = i + 1;
    while (end < sides.size() && sides[end].edge == sides[i].edge) ++end;
    if (end == i + 1) {
      border.push_back(sides[i]);
    } else if (end == i + 2) {
      const Side &a = sides[i], &b = sides[i + 1];
      const bool is_opposite = a.rises == b.rises;
      faults.opposite_edges += is_opposite;
      neighbours[a.corner] = {b.corner / 3, is_opposite};
      neighbours[b.corner] = {a.corner / 3, is_opposite};
    } else {
      ++faults.crowded_edges;
    }
    i = end;
  }
  measure_borders(mesh, border, faults);
  return neighbours;
}

void turn(TriangleMesh& mesh, std::size_t triangle) {
  std::swap(mesh.indices[3 * triangle + 1], mesh.indices[3 * triangle + 2]);
}

void turn_what_disagrees(TriangleMesh& mesh, const std::vector<Neighbour>& neighbours,
                         MeshFaults& faults) {
  enum : std::uint8_t { as_first, other, unknown };
  std::vector<std::uint8_t> facing(mesh.triangles(), unknown);
  std::vector<unsigned> piece;  // the triangles of a connected piece
  for (unsigned first = 0; first < facing.size(); ++first) {
    if (facing[first] != unknown) continue;
    piece.assign(1, first);
    facing[first] = as_first;
    std::array<double, 2> area{};
    std::array<std::size_t, 2> count{};
    std::size_t opposite = 0;  // sides, two for each edge
    bool has_two_sides = true;
    for (std::size_t i = 0; i < piece.size(); ++i) {
      const unsigned t = piece[i];
      area[facing[t]] += glm::length(double_area(mesh, t));
      ++count[facing[t]];
      for (unsigned c = 3 * t; c < 3 * t + 3; ++c) {
        const auto [beyond, is_opposite] = neighbours[c];
        if (beyond == no_neighbour) continue;
        opposite += is_opposite;
        const auto wanted = static_cast<std::uint8_t>(facing[t] ^ (is_opposite ? 1 : 0));
        if (facing[beyond] == unknown) {
          facing[beyond] = wanted;
          piece.push_back(beyond);
        } else if (facing[beyond] != wanted) {
          has_two_sides = false;
        }
      }
    }
    if (!has_two_sides) {
      faults.opposite_left += opposite / 2;
      continue;
    }
    const std::uint8_t wrong = area[0] < area[1] ? as_first : other;
    if (count[wrong] == 0) continue;
    for (const unsigned t : piece)
      if (facing[t] == wrong) turn(mesh, t);
    faults.turned += count[wrong];
  }
}

bool has_three_corners(const unsigned* triangle) {
  return triangle[0] != triangle[1] && triangle[1] != triangle[2] && triangle[2] != triangle[0];
}

// Six times the volume inside a closed mesh; below 0 if it faces inwards.
double volume_6(const TriangleMesh& mesh) {
  double sum = 0;
  for (std::size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
    const glm::dvec3 a(mesh.positions[mesh.indices[i]]), b(mesh.positions[mesh.indices[i + 1]]);
    sum += glm::dot(a, glm::cross(b, glm::dvec3(mesh.positions[mesh.indices[i + 2]])));
  }
  return sum;
}

}  // namespace

void weld(TriangleMesh& mesh) {
  for (glm::vec3& p : mesh.positions) p += 0.0f;  // -0 is the place of 0
  std::vector<unsigned> remap(mesh.positions.size());
  const std::size_t count =
      meshopt_generateVertexRemap(remap.data(), mesh.indices.data(), mesh.indices.size(),
                                  mesh.positions.data(), mesh.positions.size(), sizeof(glm::vec3));
  std::vector<glm::vec3> welded(count);
  meshopt_remapVertexBuffer(welded.data(), mesh.positions.data(), mesh.positions.size(),
                            sizeof(glm::vec3), remap.data());
  for (unsigned& index : mesh.indices) index = remap[index];
  mesh.positions = std::move(welded);
}

MeshFaults mend(TriangleMesh& mesh) {
  MeshFaults faults;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
    if (!has_three_corners(&mesh.indices[i])) continue;
    for (std::size_t k = i; k < i + 3; ++k) mesh.indices[kept++] = mesh.indices[k];
  }
  faults.without_area = (mesh.indices.size() - kept) / 3;
  mesh.indices.resize(kept);
  const std::vector<Neighbour> neighbours = find_neighbours(mesh, faults);
  if (faults.opposite_edges > 0) turn_what_disagrees(mesh, neighbours, faults);
  const bool is_closed =
      faults.open_borders == 0 && faults.opposite_left == 0 && faults.crowded_edges == 0;
  faults.was_inside_out = is_closed && volume_6(mesh) < 0;
  for (std::size_t t = 0; faults.was_inside_out && t < mesh.triangles(); ++t) turn(mesh, t);
  return faults;
}

TriangleMesh with_faces_turned(TriangleMesh mesh) {
  TriangleMesh welded = mesh;
  weld(welded);
  const std::vector<unsigned> before = welded.indices;
  mend(welded);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < before.size(); i += 3) {
    if (!has_three_corners(&before[i])) continue;
    if (welded.indices[kept + 1] != before[i + 1]) turn(mesh, i / 3);
    kept += 3;
  }
  return mesh;
}

ShadedMesh shaded(const TriangleMesh& mesh) {
  // The triangles around each vertex: those of v are around[first[v]] to around[first[v + 1]].
  std::vector<unsigned> first(mesh.positions.size() + 1, 0), around(mesh.indices.size());
  for (const unsigned v : mesh.indices) ++first[v + 1];
  std::partial_sum(first.begin(), first.end(), first.begin());
  std::vector<unsigned> filled(first.begin(), first.end() - 1);
  for (unsigned c = 0; c < mesh.indices.size(); ++c) around[filled[mesh.indices[c]]++] = c / 3;

  std::vector<glm::vec3> areas(mesh.triangles()), normals(mesh.triangles());
  for (std::size_t t = 0; t < areas.size(); ++t) {
    areas[t] = double_area(mesh, t);
    const float size = glm::length(areas[t]);
    normals[t] = size > 0 ? areas[t] / size : glm::vec3(0);
  }
  struct Vertex {
    glm::vec3 position, normal;
  };
  std::vector<Vertex> corners(mesh.indices.size());
  for (unsigned c = 0; c < corners.size(); ++c) {
    const unsigned v = mesh.indices[c];
    glm::vec3 sum(0);
    for (unsigned i = first[v]; i < first[v + 1]; ++i)
      if (glm::dot(normals[around[i]], normals[c / 3]) > cos_crease) sum += areas[around[i]];
    const float size = glm::length(sum);
    corners[c] = {mesh.positions[v], size > 0 ? sum / size : glm::vec3(0, 0, 1)};
  }
  std::vector<unsigned> remap(corners.size());
  const std::size_t count = meshopt_generateVertexRemap(
      remap.data(), nullptr, corners.size(), corners.data(), corners.size(), sizeof(Vertex));
  ShadedMesh result;
  result.positions.resize(count);
  result.normals.resize(count);
  for (std::size_t c = 0; c < corners.size(); ++c) {
    result.positions[remap[c]] = corners[c].position;
    result.normals[remap[c]] = corners[c].normal;
  }
  result.indices = std::move(remap);
  return result;
}

}  // namespace previz::model
