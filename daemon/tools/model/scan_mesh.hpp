// The surface of a scan as triangles: welds it, finds what is wrong with it, mends what can be
// mended, and shades it.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

namespace previz::model {

struct TriangleMesh {
  std::vector<glm::vec3> positions;
  std::vector<unsigned> indices;  // three for each triangle, counter-clockwise seen from outside

  std::size_t triangles() const { return indices.size() / 3; }
};

// Lengths are in the unit of the positions.
struct MeshFaults {
  std::size_t without_area = 0;    // triangles with two corners in one place; are removed
  std::size_t open_borders = 0;    // connected pieces of edges that only one triangle has
  double longest_border = 0;       // the sum of its edges
  std::size_t opposite_edges = 0;  // that two triangles traverse in the same direction
  std::size_t turned = 0;          // triangles that were turned to agree with their neighbours
  std::size_t opposite_left = 0;   // edges of surfaces with one side only, which cannot be mended
  std::size_t crowded_edges = 0;   // that more than two triangles have
  bool was_inside_out = false;     // closed, and all of it faced inwards; it is turned
};

// Makes one vertex of all that are in exactly the same place.
void weld(TriangleMesh& mesh);

// Removes triangles with fewer than three different corners and turns those that face the other way
// than their neighbours: of each connected piece the side with less area; and all of a closed mesh
// that faces inwards. The mesh must be welded.
MeshFaults mend(TriangleMesh& mesh);

// Returns the mesh with those triangles turned that `mend` would turn. It need not be welded; its
// vertices and the order of its triangles stay.
TriangleMesh with_faces_turned(TriangleMesh mesh);

struct ShadedMesh {
  std::vector<glm::vec3> positions, normals;  // of a vertex
  std::vector<unsigned> indices;
};

// A mesh in the world, metres.
struct NamedMesh {
  std::string name;
  ShadedMesh mesh;
  std::vector<glm::vec3> albedos = {};  // of its vertices; empty: it has one of its own
};

// Gives each corner of a triangle the mean normal, by area, of the triangles around the vertex that
// meet this one at less than 60 degrees. Vertices are split where the normals differ. Triangles
// keep their order. The mesh must be welded.
ShadedMesh shaded(const TriangleMesh& mesh);

}  // namespace previz::model
