// Writes a model as binary glTF 2.0.
#pragma once

#include <glm/vec3.hpp>
#include <map>
#include <string>
#include <vector>

#include "daemon/tools/model/scan_mesh.hpp"

namespace previz::model {

// Diffuse albedo by the name of a mesh, linear Rec. 709; grey of 0.5 for those not listed.
using Colours = std::map<std::string, glm::dvec3>;

// Returns the file's bytes: a node, a mesh and a matt material for each mesh, named as it is; a
// mesh with albedos of its vertices has them as COLOR_0. glTF is Y up: (x, y, z) of the world is
// (x, z, -y) there. Throws previz::Error naming a mesh that has a vertex without a place.
std::string glb_of(const std::vector<NamedMesh>& meshes, const Colours& colours);

}  // namespace previz::model
