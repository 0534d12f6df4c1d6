// What the tests of readers of scans share.
#pragma once

#include <glm/geometric.hpp>

#include "daemon/tools/model/scan_read.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::test {

// This file is in inches, Z up, and its mesh is moved by a node.
inline constexpr const char* fbx_text = R"(; FBX 7.4.0 project file
FBXHeaderExtension:  {
  FBXHeaderVersion: 1003
  FBXVersion: 7400
}
GlobalSettings:  {
  Version: 1000
  Properties70:  {
    P: "UpAxis", "int", "Integer", "",2
    P: "UpAxisSign", "int", "Integer", "",1
    P: "FrontAxis", "int", "Integer", "",1
    P: "FrontAxisSign", "int", "Integer", "",-1
    P: "CoordAxis", "int", "Integer", "",0
    P: "CoordAxisSign", "int", "Integer", "",1
    P: "UnitScaleFactor", "double", "Number", "",2.54
  }
}
Definitions:  {
  Version: 100
  Count: 3
  ObjectType: "GlobalSettings" {
    Count: 1
  }
  ObjectType: "Model" {
    Count: 1
  }
  ObjectType: "Geometry" {
    Count: 1
  }
}
Objects:  {
  Geometry: 1000, "Geometry::", "Mesh" {
    Vertices: *12 {
      a: 0,0,0,1,0,0,1,2,0,0,2,3
    }
    PolygonVertexIndex: *4 {
      a: 0,1,2,-4
    }
    GeometryVersion: 124
  }
  Model: 2000, "Model::sheet", "Mesh" {
    Version: 232
    Properties70:  {
      P: "Lcl Translation", "Lcl Translation", "", "A",10,0,0
    }
  }
}
Connections:  {
  C: "OO",2000,0
  C: "OO",1000,2000
}
)";

class ScanRead : public testing::Test {
 protected:
  std::string refusal(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    return error_of([&] { model::read_scan(folder_ / name); });
  }

  TemporaryDirectory folder_;
};

// Returns the file's coordinates of all corners, triangle by triangle.
inline std::vector<glm::dvec3> scan_corners(const model::ScanFile& file) {
  std::vector<glm::dvec3> corners;
  for (const unsigned i : file.mesh.indices)
    corners.push_back(glm::dvec3(file.mesh.positions[i]) + file.origin);
  return corners;
}

inline double area_of(const model::ScanFile& file) {
  double area = 0;
  const std::vector<glm::dvec3> p = scan_corners(file);
  for (std::size_t i = 0; i < p.size(); i += 3)
    area += glm::length(glm::cross(p[i + 1] - p[i], p[i + 2] - p[i])) / 2;
  return area;
}

}  // namespace previz::test
