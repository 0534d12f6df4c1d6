// The directional albedo of single-scatter GGX: the share of light that a rough white surface
// reflects or transmits. It is below 1, because the microfacet model loses light that bounces
// between facets; dividing by it gives that light back (Turquin 2019, "Practical multiple
// scattering compensation"; shaders/README.md, "Materials"). Also that of sheen, which says how
// much light sheen leaves for what is below it.
#pragma once

#include <vector>

namespace previz::render {

// A table has ALBEDO_SIDE^2 values in (0, 1] but for sheen: rows by GGX roughness (the root of
// alpha) from 0 to 1, columns by the root of the cosine to the normal from 0 to 1; both ends are
// nodes.
using AlbedoTable = std::vector<float>;

// The albedo of reflection alone, with a Fresnel term of 1. It also holds for a thin pane, which
// transmits light in the mirrored direction. The table is computed once.
const AlbedoTable& reflection_albedo();
// The albedo of reflection and refraction together. `eta` is the index of refraction behind the
// surface over the one in front of it, and must not be 1.
AlbedoTable refraction_albedo(double eta);
// The tables of a reflection that KHR_materials_anisotropy widens along one direction with this
// strength, one after the other: ANISOTROPIC_TABLES, with the root of the cosine between the
// viewer's azimuth and that direction going from 0 to 1. Rows are by the roughness across that
// direction; those that no roughness between `least` and `most` needs are left at 1.
AlbedoTable anisotropic_albedo(double strength, double least, double most);
// The albedo of white sheen by its formula, which may be above 1 (KHR_materials_sheen, D V). Rows
// are by the root of the roughness above LEAST_SHEEN_ROUGHNESS, over its range. The table is
// computed once.
const AlbedoTable& sheen_albedo();

}  // namespace previz::render
