// Computes by quadrature how much of the light single-scatter GGX sends on. The tables are
// independent of the renderer's, and finer.
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

namespace previz::truth {

// Returns the share of a perfect reflector: G2 over G1, averaged over the visible normals; `nv` in
// (0, 1].
double reflected_share(double nv, double alpha);
// Returns the share of rough glass, reflected and refracted together; eta = ior behind / ior in
// front.
double scattered_share(double nv, double alpha, double eta);
// Returns the share of a perfect reflector whose facets are spread by alpha.x along x and by
// alpha.y along y; `o` is the viewer's direction, z the normal. The second form keeps what it has
// computed, and interpolates.
double anisotropic_share(const glm::dvec3& o, const glm::dvec2& alpha);
double anisotropic_share_kept(const glm::dvec3& o, const glm::dvec2& alpha);
// Returns the share that white sheen sends back by KHR_materials_sheen's formula, D V; it may be
// above 1.
double sheen_share(double nv, double roughness);

}  // namespace previz::truth
