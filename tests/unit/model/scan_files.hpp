// Meshes that are known, and the files that a scanner would make of them.
#pragma once

#include <filesystem>

#include "daemon/tools/model/scan_mesh.hpp"

namespace previz::test {

// Returns a closed, welded lump about 0.2 m large, like no mirror image of itself, with
// 4 * rings * (rings - 1) triangles.
model::TriangleMesh lump(unsigned rings);

// Returns a sheet of 0.2 m with waves 4 mm high and noise of 0.1 mm; 2 * side * side triangles.
model::TriangleMesh wavy_sheet(unsigned side);

// Writes a mesh, its positions divided by unit_m.
void write_obj(const std::filesystem::path& file, const model::TriangleMesh& mesh,
               double unit_m = 1);
void write_ply(const std::filesystem::path& file, const model::TriangleMesh& mesh);  // binary
void write_stl(const std::filesystem::path& file, const model::TriangleMesh& mesh);  // binary

}  // namespace previz::test
