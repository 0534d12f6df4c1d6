// Reads the file of a scan.
#pragma once

#include <filesystem>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "daemon/model/scan_colours.hpp"
#include "daemon/model/scan_mesh.hpp"

namespace previz::model {

struct ScanFile {
  TriangleMesh mesh;             // in the file's unit; its coordinates less `origin`
  glm::dvec3 origin{0};          // not 0 where single precision would not do
  double step = 0;               // of coordinates, by how the file stores them; 0: none is known
  std::optional<double> unit_m;  // metres for 1 of the file, if the file gives it
  std::optional<glm::dvec3> up;  // unit vector, likewise
  ScanColours colours;           // if they are read
  std::vector<std::string> notes = {};  // about what was left out, in plain words
};

enum class Colouring { ignored, read };

// Reads OBJ, PLY, STL, FBX or glTF; all its meshes, placed by its nodes. glTF is in metres, Y up;
// FBX gives its unit and axis. Throws previz::Error naming the file: it is of another kind, it
// cannot be read, it has no triangles, or a coordinate in it is not a number; or the texture that
// cannot be read, if colours are.
ScanFile read_scan(const std::filesystem::path& file, Colouring colouring = Colouring::ignored);

}  // namespace previz::model
