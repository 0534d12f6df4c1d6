// The material model of the reference tracer, in double precision. README.md states every choice.
#pragma once

#include <glm/vec3.hpp>
#include <optional>

#include "tests/truth/cpu_random.hpp"

namespace previz::truth {

// A scene::Material at one point, textures applied.
struct Bsdf {
  glm::dvec3 base_color{1};
  double metallic = 0;
  double alpha = 1;        // GGX width, roughness^2
  double alpha_along = 1;  // of the reflection, along ShadingPoint::tangent: alpha or more
  bool smooth = false;     // alpha at or below the threshold: the specular lobe is a Dirac delta
  double specular = 1;
  glm::dvec3 specular_color{1};  // times the plastic's reflectance at normal incidence
  double ior = 1.5;
  double transmission = 0;
  bool thin_walled = true;
  double clearcoat = 0;  // weight of a coat of lacquer above all else
  double clearcoat_alpha = 0;
  bool smooth_clearcoat = true;   // its reflection is a Dirac delta
  glm::dvec3 sheen_color{0};      // of fibres above the base material
  double sheen_roughness = 0.07;  // that or more

  bool smooth_glass() const { return smooth || ior < 1.001; }  // too little bent to blur
};

// Unit vectors; both normals are on the viewer's side of the surface, wo points to the viewer.
struct ShadingPoint {
  glm::dvec3 geometric_normal{0, 0, 1};
  glm::dvec3 shading_normal{0, 0, 1};
  glm::dvec3 wo{0, 0, 1};
  bool outside = true;               // the viewer is on the side the triangle's winding faces
  glm::dvec3 tangent{1, 0, 0};       // across the shading normal
  glm::dvec3 clear_normal{0, 0, 1};  // the shading normal of the clear coat
};

struct BsdfSample {
  glm::dvec3 wi{0, 0, 1};
  glm::dvec3 weight{0};  // f |cos| / pdf; for a Dirac lobe its weight over the lobe's probability
  double pdf = 0;        // per steradian; 0 for a Dirac lobe
  bool dirac = false;
};

// Exact unpolarised reflectance of a smooth dielectric; eta = ior behind / ior in front,
// cos_incident in [0, 1]. 1 at total internal reflection.
double fresnel_dielectric(double cos_incident, double eta);

// f * cos of the lobes that are not Dirac deltas.
glm::dvec3 evaluate(const Bsdf& bsdf, const ShadingPoint& point, const glm::dvec3& wi);
// Density of sample() over directions that come from the lobes that are not Dirac deltas.
double pdf(const Bsdf& bsdf, const ShadingPoint& point, const glm::dvec3& wi);
// Nothing where the path is absorbed.
std::optional<BsdfSample> sample(const Bsdf& bsdf, const ShadingPoint& point, Random& random);
// True where light arriving from behind the surface reaches the viewer by lobes that are not Dirac.
bool scatters_behind(const Bsdf& bsdf);
// True where any part of the surface reflects or refracts.
bool is_specular(const Bsdf& bsdf);
// True where evaluate() is zero everywhere.
bool only_dirac(const Bsdf& bsdf);
// Lambda of sheen (Conty Estevez and Kulla 2017).
double sheen_lambda(double cosine, double alpha);
// The share of light that goes straight through a smooth thin wall; 0 of anything else.
glm::dvec3 straight_through(const Bsdf& bsdf, const ShadingPoint& point);

}  // namespace previz::truth
