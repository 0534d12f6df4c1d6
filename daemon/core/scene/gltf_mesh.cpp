#include "daemon/core/scene/gltf_mesh.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numeric>
#include <utility>

#include "daemon/core/scene/gltf_accessor.hpp"
#include "daemon/core/scene/gltf_deformation.hpp"
#include "drivers/error.hpp"

namespace previz::scene {
namespace {

// Up to this coordinate, squares and products stay finite in single precision.
constexpr float max_coordinate = 1e15f;
constexpr std::uint32_t unused = 0xffffffffu;
// Cosines of the angle up to which tangents are those that the texture coordinates give: 1 degree,
// and 10 of a mesh that cannot have its own.
constexpr double least_agreement = 0.99985, least_agreement_deformed = 0.985;

std::string count_of(std::uint64_t count, const std::string& one, const std::string& many) {
  return std::to_string(count) + " " + (count == 1 ? one : many);
}

// Returns the triangles of a list, strip or fan in the order and winding of glTF 2.0, 3.7.2.1.
std::vector<glm::uvec3> triangulate(const std::vector<std::uint32_t>& indices, int mode) {
  std::vector<glm::uvec3> triangles;
  if (indices.size() < 3) return triangles;
  if (mode == TINYGLTF_MODE_TRIANGLES) {
    triangles.reserve(indices.size() / 3);
    for (std::size_t i = 0; i + 2 < indices.size(); i += 3)
      triangles.emplace_back(indices[i], indices[i + 1], indices[i + 2]);
    return triangles;
  }
  triangles.reserve(indices.size() - 2);
  for (std::size_t i = 0; i + 2 < indices.size(); ++i) {
    const std::size_t odd = i % 2;
    if (mode == TINYGLTF_MODE_TRIANGLE_STRIP)
      triangles.emplace_back(indices[i], indices[i + 1 + odd], indices[i + 2 - odd]);
    else
      triangles.emplace_back(indices[i + 1], indices[i + 2], indices[0]);
  }
  return triangles;
}

std::vector<glm::uvec3> read_triangles(const tinygltf::Model& model, const MeshSource& source,
                                       std::uint64_t vertices, const std::string& where,
                                       const std::string& what, Notes& notes, Budget& budget) {
  const std::uint64_t count =
      source.indices < 0 ? vertices : element_count(model, source.indices, where + ", indices");
  budget.add_triangles(source.mode == TINYGLTF_MODE_TRIANGLES ? count / 3 : count, where);
  std::vector<std::uint32_t> indices;
  if (source.indices < 0) {
    indices.resize(vertices);
    std::iota(indices.begin(), indices.end(), 0u);
  } else {
    indices = read_indices(model, source.indices, where + ", indices");
  }
  for (const std::uint32_t index : indices)
    if (index >= vertices)
      throw Error(where + ": index " + std::to_string(index) + " is outside its " +
                  count_of(vertices, "vertex", "vertices"));
  if (source.mode == TINYGLTF_MODE_TRIANGLES && count % 3 != 0)
    notes.add(what + ": the last triangle is incomplete; dropped");
  return triangulate(indices, source.mode);
}

// Returns the normal on the side of counter-clockwise winding; its length is twice the area.
glm::dvec3 area_normal(const std::vector<glm::vec3>& positions, const glm::uvec3& triangle) {
  const glm::dvec3 a = positions[triangle.x];
  return glm::cross(glm::dvec3(positions[triangle.y]) - a, glm::dvec3(positions[triangle.z]) - a);
}

// Comparisons with NaN are false.
bool is_usable(const glm::vec3& p) {
  return std::abs(p.x) <= max_coordinate && std::abs(p.y) <= max_coordinate &&
         std::abs(p.z) <= max_coordinate;
}

void drop_bad_triangles(Mesh& mesh, const std::string& what, Notes& notes) {
  const auto is_finite = [&](std::uint32_t vertex) { return is_usable(mesh.positions[vertex]); };
  std::uint64_t not_finite = 0, no_area = 0;
  std::erase_if(mesh.triangles, [&](const glm::uvec3& triangle) {
    if (!is_finite(triangle.x) || !is_finite(triangle.y) || !is_finite(triangle.z))
      return ++not_finite, true;
    if (area_normal(mesh.positions, triangle) == glm::dvec3(0)) return ++no_area, true;
    return false;
  });
  if (not_finite > 0)
    notes.add(what + ": " +
              count_of(not_finite, "triangle has a position that is",
                       "triangles have positions that are") +
              " not a number or beyond 1e15; dropped");
  if (no_area > 0)
    notes.add(what + ": " + count_of(no_area, "triangle has", "triangles have") +
              " no area; dropped");
}

// Takes the elements of these vertices, `each` for every vertex; an empty array stays empty.
template <typename T>
void take(std::vector<T>& values, const std::vector<std::uint32_t>& vertices,
          std::size_t each = 1) {
  if (values.empty()) return;
  std::vector<T> taken;
  taken.reserve(vertices.size() * each);
  for (const std::uint32_t vertex : vertices)
    for (std::size_t i = 0; i < each; ++i) taken.push_back(values[vertex * each + i]);
  values = std::move(taken);
}

// Replaces the vertices by those listed, which may repeat. Triangles are left as they are.
void take_vertices(Mesh& mesh, const std::vector<std::uint32_t>& vertices) {
  take(mesh.positions, vertices);
  take(mesh.normals, vertices);
  take(mesh.uvs, vertices);
  for (std::vector<glm::vec2>& uvs : mesh.more_uvs) take(uvs, vertices);
  take(mesh.colors, vertices);
  take(mesh.tangents, vertices);
  for (MorphTarget& target : mesh.undeformed.targets) {
    take(target.positions, vertices);
    take(target.normals, vertices);
  }
  take(mesh.undeformed.influences, vertices, mesh.undeformed.influences_per_vertex);
}

// Gives every corner of a triangle a vertex of its own.
void split_corners(Mesh& mesh) {
  std::vector<std::uint32_t> vertices;
  vertices.reserve(3 * mesh.triangles.size());
  for (glm::uvec3& triangle : mesh.triangles)
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t vertex = triangle[i];
      triangle[i] = static_cast<std::uint32_t>(vertices.size());
      vertices.push_back(vertex);
    }
  take_vertices(mesh, vertices);
}

// Keeps the vertices that a triangle uses, in their order.
void drop_unused_vertices(Mesh& mesh) {
  std::vector<std::uint32_t> place(mesh.positions.size(), unused), vertices;
  for (const glm::uvec3& triangle : mesh.triangles)
    for (int i = 0; i < 3; ++i) place[triangle[i]] = 0;
  for (std::uint32_t vertex = 0; vertex < place.size(); ++vertex) {
    if (place[vertex] == unused) continue;
    place[vertex] = static_cast<std::uint32_t>(vertices.size());
    vertices.push_back(vertex);
  }
  take_vertices(mesh, vertices);
  for (glm::uvec3& triangle : mesh.triangles)
    triangle = {place[triangle.x], place[triangle.y], place[triangle.z]};
}

void set_flat_normals(Mesh& mesh) {
  split_corners(mesh);
  mesh.normals.resize(mesh.positions.size());
  for (const glm::uvec3& triangle : mesh.triangles) {
    const glm::vec3 normal = glm::normalize(area_normal(mesh.positions, triangle));
    for (int i = 0; i < 3; ++i) mesh.normals[triangle[i]] = normal;
  }
}

// Normalises the normals, and repairs those that have no direction or that point to the back of
// every adjacent triangle: the winding says which side is the front.
void repair_normals(Mesh& mesh, const std::string& what, Notes& notes) {
  struct Around {
    glm::dvec3 sum{0}, any{0};
    double area = 0;
    bool faces_one = false;
  };
  std::vector<Around> around(mesh.positions.size());
  for (const glm::uvec3& triangle : mesh.triangles) {
    const glm::dvec3 normal = area_normal(mesh.positions, triangle);
    for (int i = 0; i < 3; ++i) {
      Around& vertex = around[triangle[i]];
      vertex.sum += normal;
      vertex.any = normal;
      vertex.area += glm::length(normal);
      vertex.faces_one |= glm::dot(glm::dvec3(mesh.normals[triangle[i]]), normal) >= 0;
    }
  }
  std::uint64_t replaced = 0, turned = 0;
  for (std::size_t i = 0; i < mesh.normals.size(); ++i) {
    const auto& [sum, any, area, faces_one] = around[i];
    const glm::dvec3 given = mesh.normals[i];
    const double length = glm::length(given);
    glm::dvec3 normal = given / length;
    if (!(length > 1e-12) || !std::isfinite(length)) {
      normal = glm::normalize(glm::length(sum) > 1e-6 * area ? sum : any);
      ++replaced;
    } else if (!faces_one) {
      normal = -normal;
      if (!mesh.tangents.empty()) mesh.tangents[i].w *= -1;  // +Y stays where it is
      ++turned;
    }
    mesh.normals[i] = glm::vec3(normal);
  }
  if (replaced > 0)
    notes.add(what + ": " + count_of(replaced, "normal is", "normals are") +
              " no direction; computed from adjacent triangles");
  if (turned > 0)
    notes.add(what + ": " + count_of(turned, "normal points", "normals point") +
              " to the back of every adjacent triangle; flipped");
}

std::vector<glm::vec2> read_uvs(const tinygltf::Model& model, int accessor,
                                const UvMapping& mapping, const std::string& where,
                                const std::string& what, Notes& notes) {
  if (accessor < 0) return {};
  const auto& [a, b, c, d, e, f] = mapping.affine;
  std::vector<glm::vec2> uvs =
      read_vec2s(model, accessor, where + ", texture coordinates", Components::texture_coordinates);
  std::uint64_t not_finite = 0;
  for (glm::vec2& uv : uvs) {
    if (mapping.affine != UvMapping{}.affine) {
      const glm::dvec2 p = uv;
      uv = {static_cast<float>(a * p.x + b * p.y + c), static_cast<float>(d * p.x + e * p.y + f)};
    }
    if (std::abs(uv.x) <= max_coordinate && std::abs(uv.y) <= max_coordinate) continue;
    uv = glm::vec2(0);
    ++not_finite;
  }
  if (not_finite > 0)
    notes.add(what + ": " +
              count_of(not_finite, "texture coordinate is", "texture coordinates are") +
              " not a number or beyond 1e15; set to 0");
  return uvs;
}

// Colours are factors from 0 to 1 (glTF 2.0, 3.7.2.1); one that is not a number leaves the
// material's.
std::vector<glm::vec4> read_vertex_colors(const tinygltf::Model& model, int accessor,
                                          const std::string& where, const std::string& what,
                                          Notes& notes) {
  if (accessor < 0) return {};
  std::vector<glm::vec4> colors = read_colors(model, accessor, where + ", COLOR_0");
  std::uint64_t out_of_range = 0;
  for (glm::vec4& color : colors) {
    bool is_in_range = true;
    for (int i = 0; i < 4; ++i) {
      if (color[i] >= 0 && color[i] <= 1) continue;
      is_in_range = false;
      color[i] = std::isnan(color[i]) ? 1.0f : std::clamp(color[i], 0.0f, 1.0f);
    }
    out_of_range += is_in_range ? 0 : 1;
  }
  if (out_of_range > 0)
    notes.add(what + ": " + count_of(out_of_range, "vertex colour is", "vertex colours are") +
              " outside of 0 to 1; brought to the nearest allowed");
  return colors;
}

std::vector<glm::vec4> read_tangents(const tinygltf::Model& model, int accessor,
                                     const std::string& where, const std::string& what,
                                     Notes& notes) {
  if (accessor < 0) return {};
  std::vector<glm::vec4> tangents =
      read_vec4s(model, accessor, where + ", TANGENT", Components::tangents);
  std::uint64_t unusable = 0;
  for (glm::vec4& tangent : tangents) {
    const double length = glm::length(glm::dvec3(tangent));
    if (length > 1e-12 && std::isfinite(length) && std::abs(tangent.w) > 0) {
      tangent = glm::vec4(glm::dvec3(tangent) / length, tangent.w < 0 ? -1 : 1);
      continue;
    }
    tangent = glm::vec4(0);
    ++unusable;
  }
  if (unusable > 0)
    notes.add(what + ": " + count_of(unusable, "tangent is", "tangents are") +
              " no direction; computed from texture coordinates");
  return tangents;
}

// Returns whether the tangents are those that texture_frame() of shaders/lib/scene.glsl finds by
// these texture coordinates, up to an angle of this cosine. Only corners that give both count.
bool follows(const Mesh& mesh, const std::vector<glm::vec2>& uvs, double least_cosine) {
  const auto along_u = [&](const glm::uvec3& t, double& side) {
    const glm::dvec2 uv1 = uvs[t.y] - uvs[t.x], uv2 = uvs[t.z] - uvs[t.x];
    const glm::dvec3 edge1 = mesh.positions[t.y] - mesh.positions[t.x];
    const glm::dvec3 edge2 = mesh.positions[t.z] - mesh.positions[t.x];
    const double area = uv1.x * uv2.y - uv2.x * uv1.y;
    // v runs down, so that the texture of a positive area is mirrored.
    side = area > 0 ? -1 : area < 0 ? 1 : 0;
    return side * (edge2 * uv1.y - edge1 * uv2.y);
  };
  return std::ranges::all_of(mesh.triangles, [&](const glm::uvec3& triangle) {
    double side = 0;
    const glm::dvec3 along = along_u(triangle, side);
    for (int i = 0; i < 3; ++i) {
      const glm::dvec3 normal = mesh.normals[triangle[i]];
      const glm::dvec4 given = mesh.tangents[triangle[i]];
      const glm::dvec3 a = along - normal * glm::dot(normal, along);
      const glm::dvec3 b = glm::dvec3(given) - normal * glm::dot(normal, glm::dvec3(given));
      const double lengths = glm::length(a) * glm::length(b);
      if (!(lengths > 0)) continue;
      if (given.w != side || glm::dot(a, b) < least_cosine * lengths) return false;
    }
    return true;
  });
}

// Forgets tangents without which the picture is the same, and with a note those of a mesh that
// deforms, whose directions the renderer finds in each of its shapes.
void keep_tangents(const std::string& what, Notes& notes, Mesh& mesh) {
  const bool deforms = !mesh.undeformed.is_empty();
  const double least_cosine = deforms ? least_agreement_deformed : least_agreement;
  bool follow = !mesh.uvs.empty() && follows(mesh, mesh.uvs, least_cosine);
  for (const std::vector<glm::vec2>& uvs : mesh.more_uvs)
    follow = follow && !uvs.empty() && follows(mesh, uvs, least_cosine);
  if (!follow && !deforms) return;
  if (!follow)
    notes.add(what +
              ": deforms, so that its tangents are not used; they differ from those of its texture "
              "coordinates, which turn its bumps or its brushed metal");
  mesh.tangents.clear();
}

int attribute(const tinygltf::Primitive& primitive, const std::string& name) {
  const auto at = primitive.attributes.find(name);
  return at == primitive.attributes.end() ? -1 : at->second;
}

}  // namespace

bool keep_shape(Mesh& mesh, const std::string& what, Notes& notes) {
  mesh.undeformed = {};
  drop_bad_triangles(mesh, what, notes);
  if (mesh.triangles.empty()) {
    notes.add(what + ": is empty; skipped");
    return false;
  }
  drop_unused_vertices(mesh);
  repair_normals(mesh, what, notes);
  return true;
}

std::optional<Mesh> read_shape(const tinygltf::Model& model, const MeshSource& source,
                               const std::string& where, const std::string& what, Notes& notes,
                               Budget& budget) {
  if (source.positions < 0) {
    notes.add(what + ": has no positions; skipped");
    return {};
  }
  Mesh mesh;
  const std::uint64_t count = element_count(model, source.positions, where + ", positions");
  budget.add_vertices(count * (source.mappings.size() + (source.tangents >= 0 ? 1 : 0)), where);
  const std::uint64_t deformed = source.targets.size() + source.influences.size();
  budget.add_deformed(count * deformed, where);
  mesh.positions =
      read_vec3s(model, source.positions, where + ", positions", Components::positions);
  mesh.triangles = read_triangles(model, source, count, where, what, notes, budget);
  if (source.normals >= 0)
    mesh.normals = read_vec3s(model, source.normals, where + ", normals", Components::normals);
  for (std::size_t i = 0; i < source.mappings.size(); ++i) {
    std::vector<glm::vec2>& uvs = i == 0 ? mesh.uvs : mesh.more_uvs.emplace_back();
    uvs = read_uvs(model, source.uvs[i], source.mappings[i], where, what, notes);
  }
  mesh.colors = read_vertex_colors(model, source.colors, where, what, notes);
  mesh.tangents = read_tangents(model, source.tangents, where, what, notes);
  bool is_whole = (source.normals < 0 || mesh.normals.size() == count) &&
                  (source.tangents < 0 || mesh.tangents.size() == count) &&
                  (source.colors < 0 || mesh.colors.size() == count);
  for (std::size_t i = 0; i < source.uvs.size(); ++i)
    is_whole = is_whole && (source.uvs[i] < 0 || uvs_of(mesh, i).size() == count);
  if (!is_whole) throw Error(where + ": its attributes have different numbers of elements");
  if (std::ranges::all_of(mesh.colors, [](const glm::vec4& c) { return c == glm::vec4(1); }))
    mesh.colors.clear();  // they change nothing
  return mesh;
}

std::optional<Mesh> read_mesh(const tinygltf::Model& model, const MeshSource& source,
                              const std::string& where, const std::string& what, Notes& notes,
                              Budget& budget) {
  std::optional<Mesh> read = read_shape(model, source, where, what, notes, budget);
  if (!read) return {};
  Mesh& mesh = *read;
  const std::uint64_t count = mesh.positions.size();
  const std::uint64_t deformed = source.targets.size() + source.influences.size();
  read_undeformed(model, source, where, what, notes, mesh);

  drop_bad_triangles(mesh, what, notes);
  if (mesh.triangles.empty()) {
    notes.add(what + ": is empty; skipped");
    return {};
  }
  if (source.normals >= 0) {
    drop_unused_vertices(mesh);
    repair_normals(mesh, what, notes);
  } else {
    if (3 * mesh.triangles.size() > count) {
      const std::uint64_t more = 3 * mesh.triangles.size() - count;
      budget.add_vertices(more * source.mappings.size(), where);
      budget.add_deformed(more * deformed, where);
    }
    set_flat_normals(mesh);
  }
  if (!mesh.tangents.empty()) keep_tangents(what, notes, mesh);
  if (mesh.undeformed.is_empty()) return read;
  mesh.undeformed.positions = mesh.positions;
  mesh.undeformed.normals = mesh.normals;
  mesh.undeformed.flat = source.normals < 0;
  return read;
}

}  // namespace previz::scene
