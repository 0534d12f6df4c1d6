// A scan as its file has it.
#pragma once

#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "daemon/tools/model/scan_colours.hpp"
#include "daemon/tools/model/scan_mesh.hpp"

namespace previz::model {

struct ScanFile {
  TriangleMesh mesh;             // in the file's unit; its coordinates less `origin`
  glm::dvec3 origin{0};          // not 0 where single precision would not do
  double step = 0;               // of coordinates, by how the file stores them; 0: none is known
  bool is_step_of_text = false;  // the coordinates have few digits; else single precision
  std::optional<double> unit_m;  // metres for 1 of the file, if the file gives it
  std::optional<glm::dvec3> up;  // unit vector, likewise
  ScanColours colours;           // if they are read
  std::vector<std::string> notes = {};  // about what was left out, in plain words
};

enum class Colouring { ignored, read };

}  // namespace previz::model
