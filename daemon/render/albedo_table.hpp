// Directional albedo of single-scatter GGX: what a rough white surface reflects or lets through of
// what it should, because the microfacet model loses light that bounces between facets. Its inverse
// gives that light back (Turquin 2019, "Practical multiple scattering compensation").
#pragma once

#include <vector>

namespace previz::render {

// ALBEDO_SIDE^2 values, rows by GGX roughness (the root of alpha) from 0 to 1, columns by the root
// of the cosine to the normal from 0 to 1; both ends are nodes. Values are in (0, 1].
using AlbedoTable = std::vector<float>;

// Made once. Of reflection alone, Fresnel term 1; also of a thin pane, whose light goes through
// mirrored.
const AlbedoTable& reflection_albedo();
// Of reflection and refraction together; `eta`, not 1, is the ior behind the surface over the one
// before it.
AlbedoTable refraction_albedo(double eta);

}  // namespace previz::render
