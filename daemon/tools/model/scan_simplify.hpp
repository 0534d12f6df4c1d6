// Simplifies the surface of a scan by no more than a given deviation.
#pragma once

#include "daemon/tools/model/scan_mesh.hpp"

namespace previz::model {

struct Simplified {
  TriangleMesh mesh;
  double error = 0;  // the largest distance of an original vertex from the simplified surface
};

// Collapses edges while no vertex of the welded mesh is farther than `most` from the surface, in
// the unit of its positions (Garland and Heckbert 1997, as meshoptimizer does it). The distances
// are measured, because the error that guides the collapses is a mean. Positions stay as they are.
// Where nothing can be removed, or for `most` = 0, the mesh is returned as it is.
Simplified simplified(TriangleMesh mesh, double most);

// Returns the largest distance of the mesh's used vertices from the surface that these indices make
// of the same positions; infinity beyond `limit`.
double largest_distance(const TriangleMesh& mesh, const std::vector<unsigned>& surface,
                        double limit);

}  // namespace previz::model
