// How much of the light single-scatter GGX sends on: by quadrature, remembered at nodes finer than
// the renderer's, of which it knows nothing.
#pragma once

namespace previz::truth {

// Of a perfect reflector: G2 over G1, averaged over the visible normals; `nv` in (0, 1].
double reflected_share(double nv, double alpha);
// Of rough glass, reflected and refracted together; eta = ior behind / ior in front.
double scattered_share(double nv, double alpha, double eta);

}  // namespace previz::truth
