// Reads one glTF primitive as a mesh: triangulated, cleaned, with normals (glTF 2.0, 3.7.2).
#pragma once

#include <tiny_gltf.h>

#include <array>
#include <compare>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/core/scene/gltf_mesh_source.hpp"
#include "daemon/core/scene/load_log.hpp"
#include "daemon/core/scene/scene.hpp"

namespace previz::scene {

// Takes the shape that the mesh has in its place for good: what deformed it is forgotten. False if
// no triangle is left; what was dropped is in the notes.
bool keep_shape(Mesh& mesh, const std::string& what, Notes& notes);

// Returns whether every position is a number of at most 1e15, below which nothing overflows.
bool has_usable_positions(const Mesh& mesh);

// Returns what the file has, with texture coordinates as they are mapped: triangles without area
// and positions that are no numbers are in it, unused vertices too. Returns nothing if there are no
// positions. It throws and notes as read_mesh() does.
std::optional<Mesh> read_shape(const tinygltf::Model& model, const MeshSource& source,
                               const std::string& where, const std::string& what, Notes& notes,
                               Budget& budget);

// Returns nothing if no triangle is left; what was dropped is in the notes. `where` names file,
// mesh and primitive and begins the message of the previz::Error thrown for indices and accessors
// out of range; `what` names mesh and primitive for the notes.
std::optional<Mesh> read_mesh(const tinygltf::Model& model, const MeshSource& source,
                              const std::string& where, const std::string& what, Notes& notes,
                              Budget& budget);

}  // namespace previz::scene
