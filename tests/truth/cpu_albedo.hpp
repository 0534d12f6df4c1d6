// Computes by quadrature how much of the light single-scatter GGX sends on. The tables are
// independent of the renderer's, and finer.
#pragma once

namespace previz::truth {

// Returns the share of a perfect reflector: G2 over G1, averaged over the visible normals; `nv` in
// (0, 1].
double reflected_share(double nv, double alpha);
// Returns the share of rough glass, reflected and refracted together; eta = ior behind / ior in
// front.
double scattered_share(double nv, double alpha, double eta);

}  // namespace previz::truth
