#include "tests/truth/cpu_bsdf.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numbers>

#include "tests/truth/cpu_albedo.hpp"

namespace previz::truth {
namespace {

using std::numbers::pi;

double mean(const glm::dvec3& c) {
  return (c.x + c.y + c.z) / 3;
}

glm::dvec3 schlick(const glm::dvec3& f0, double cosine) {
  return f0 + (1.0 - f0) * std::pow(1 - std::clamp(cosine, 0.0, 1.0), 5);
}

double strongest(const glm::dvec3& c) {
  return std::max({c.x, c.y, c.z});
}

// Orthonormal frame around n (Duff et al. 2017).
struct Frame {
  glm::dvec3 x, y, z;
  explicit Frame(const glm::dvec3& n) : z(n) {
    const double sign = std::copysign(1.0, n.z);
    const double a = -1 / (sign + n.z);
    const double b = n.x * n.y * a;
    x = {1 + sign * n.x * n.x * a, sign * b, -sign * n.x};
    y = {b, sign + n.y * n.y * a, -n.y};
  }
  Frame(const glm::dvec3& n, const glm::dvec3& tangent)
      : x(tangent), y(glm::cross(n, tangent)), z(n) {}
  glm::dvec3 local(const glm::dvec3& v) const {
    return {glm::dot(v, x), glm::dot(v, y), glm::dot(v, z)};
  }
  glm::dvec3 world(const glm::dvec3& v) const { return v.x * x + v.y * y + v.z * z; }
};

// GGX (Walter et al. 2007) with the height-correlated Smith term (Heitz 2014).
double ggx_distribution(double nh, double alpha) {
  const double a2 = alpha * alpha;
  const double d = nh * nh * (a2 - 1) + 1;
  return a2 / (pi * d * d);
}
double smith_lambda_root(double cosine, double alpha) {
  const double a2 = alpha * alpha;
  return std::sqrt(a2 + (1 - a2) * cosine * cosine);
}
// D G2 / (4 nl nv)
double ggx_brdf(double nl, double nv, double nh, double alpha) {
  return ggx_distribution(nh, alpha) * 0.5 /
         (nl * smith_lambda_root(nv, alpha) + nv * smith_lambda_root(nl, alpha));
}
// Density of wi when the half vector is drawn from the visible normals (Heitz 2018).
double ggx_pdf(double nv, double nh, double alpha) {
  return ggx_distribution(nh, alpha) * 0.5 / (nv + smith_lambda_root(nv, alpha));
}
glm::dvec3 sample_visible_normal(const glm::dvec3& v, const glm::dvec2& alpha, glm::dvec2 random) {
  const glm::dvec3 stretched = glm::normalize(glm::dvec3(alpha.x * v.x, alpha.y * v.y, v.z));
  const Frame frame(stretched);
  const double r = std::sqrt(random.x);
  const double phi = 2 * pi * random.y;
  const double t1 = r * std::cos(phi);
  const double s = 0.5 * (1 + stretched.z);
  // The frame's axes must be those of the projected hemisphere: x horizontal.
  const glm::dvec3 horizontal =
      stretched.z < 0.9999999 ? glm::normalize(glm::dvec3(-stretched.y, stretched.x, 0)) : frame.x;
  const glm::dvec3 vertical = glm::cross(stretched, horizontal);
  const double t2 = (1 - s) * std::sqrt(1 - t1 * t1) + s * r * std::sin(phi);
  const glm::dvec3 n =
      t1 * horizontal + t2 * vertical + std::sqrt(std::max(0.0, 1 - t1 * t1 - t2 * t2)) * stretched;
  return glm::normalize(glm::dvec3(alpha.x * n.x, alpha.y * n.y, std::max(0.0, n.z)));
}

// The reflection of plastic and metal, whose facets may be spread more along one direction.
struct Reflection {
  Frame frame;
  glm::dvec2 alpha;  // along x, along y
  glm::dvec3 wo;     // in the frame

  Reflection(const Bsdf& bsdf, const ShadingPoint& point)
      : frame(is_isotropic(bsdf) ? Frame(point.shading_normal)
                                 : Frame(point.shading_normal, point.tangent)),
        alpha(bsdf.alpha_along, bsdf.alpha),
        wo(frame.local(point.wo)) {}

  static bool is_isotropic(const Bsdf& bsdf) { return bsdf.alpha_along <= bsdf.alpha; }
  double root(const glm::dvec3& w) const {
    return glm::length(glm::dvec3(alpha.x * w.x, alpha.y * w.y, w.z));
  }
  double distribution(const glm::dvec3& wi) const {
    const glm::dvec3 h = glm::normalize(wo + wi);
    const double d = std::pow(h.x / alpha.x, 2) + std::pow(h.y / alpha.y, 2) + h.z * h.z;
    return 1 / (pi * alpha.x * alpha.y * d * d);
  }
  // D G2 / (4 nl nv), and the density of the visible normals; wi is in the world.
  double brdf(const glm::dvec3& direction) const {
    const glm::dvec3 wi = frame.local(direction);
    return distribution(wi) * 0.5 / (wi.z * root(wo) + wo.z * root(wi));
  }
  double pdf(const glm::dvec3& direction) const {
    return distribution(frame.local(direction)) * 0.5 / (wo.z + root(wo));
  }
  glm::dvec3 sample(Random& random) const {
    const glm::dvec3 h = sample_visible_normal(wo, alpha, random.uniform2());
    return frame.world(2 * glm::dot(wo, h) * h - wo);
  }
};

double index_behind(const Bsdf& bsdf, const ShadingPoint& point) {
  return bsdf.thin_walled || point.outside ? bsdf.ior : 1 / bsdf.ior;
}

double glass_reflectance(const Bsdf& bsdf, const ShadingPoint& point, double cosine) {
  const double once = fresnel_dielectric(std::clamp(cosine, 0.0, 1.0), index_behind(bsdf, point));
  return bsdf.thin_walled ? 2 * once / (1 + once) : once;
}

// A white conductor gets back all that single scattering loses, a coloured one its share.
glm::dvec3 conductor_gain(const Bsdf& bsdf, const ShadingPoint& point) {
  if (bsdf.smooth || bsdf.metallic <= 0) return glm::dvec3(1);
  const double share =
      Reflection::is_isotropic(bsdf)
          ? reflected_share(glm::dot(point.shading_normal, point.wo), bsdf.alpha)
          : anisotropic_share_kept(Reflection(bsdf, point).wo, {bsdf.alpha_along, bsdf.alpha});
  return 1.0 + bsdf.base_color * (1 / share - 1);
}

// Returns the reflectance of plastic: a colour at normal incidence, which fades as Fresnel's
// reflectance departs from that at normal incidence.
glm::dvec3 plastic_reflectance(const Bsdf& bsdf, double cosine) {
  const double white = fresnel_dielectric(std::clamp(cosine, 0.0, 1.0), bsdf.ior);
  if (bsdf.specular_color == glm::dvec3(1)) return glm::dvec3(bsdf.specular * white);
  const double f0 = std::pow((bsdf.ior - 1) / (bsdf.ior + 1), 2);
  const double fading = std::max(0.0, (white - f0) / (1 - f0));
  const glm::dvec3 start = glm::min(f0 * bsdf.specular_color, glm::dvec3(1));
  return bsdf.specular * (start + fading * (1.0 - start));
}

bool has_sheen(const Bsdf& bsdf) {
  return strongest(bsdf.sheen_color) > 0;
}

// Solid glass has fibres on its outside only.
bool has_sheen_towards(const Bsdf& bsdf, const ShadingPoint& point, const glm::dvec3& w) {
  const bool solid = bsdf.transmission > 0 && !bsdf.thin_walled;
  const bool viewers_side = glm::dot(w, point.geometric_normal) >= 0;
  return has_sheen(bsdf) && (!solid || viewers_side == point.outside);
}

// Returns the share of light in one direction that fibres leave for what is below them.
double left_by_sheen(const Bsdf& bsdf, const ShadingPoint& point, const glm::dvec3& w) {
  if (!has_sheen_towards(bsdf, point, w)) return 1;
  const double cosine = std::abs(glm::dot(w, point.shading_normal));
  return 1 - strongest(bsdf.sheen_color) * std::min(1.0, sheen_share(cosine, bsdf.sheen_roughness));
}

// Returns the share that is left of light from wi to wo: that of the direction which leaves less.
double under_sheen(const Bsdf& bsdf, const ShadingPoint& point, const glm::dvec3& wi) {
  return std::min(left_by_sheen(bsdf, point, point.wo), left_by_sheen(bsdf, point, wi));
}

// f cos of sheen, scaled down where it would send back more than it gets.
glm::dvec3 sheen_value(const Bsdf& bsdf, const ShadingPoint& point, const glm::dvec3& wi) {
  const glm::dvec3& n = point.shading_normal;
  const double nv = glm::dot(n, point.wo), nl = glm::dot(n, wi);
  if (nv <= 0 || nl <= 0 || !has_sheen_towards(bsdf, point, point.wo)) return glm::dvec3(0);
  const double alpha = bsdf.sheen_roughness * bsdf.sheen_roughness;
  const double sine = glm::length(glm::cross(n, glm::normalize(point.wo + wi)));
  const double d = (2 + 1 / alpha) / (2 * pi) * std::pow(sine, 1 / alpha);
  const double v = 1 / ((1 + sheen_lambda(nv, alpha) + sheen_lambda(nl, alpha)) * 4 * nv * nl);
  const auto scale = [&](double cosine) {
    return std::max(1.0, sheen_share(cosine, bsdf.sheen_roughness));
  };
  return bsdf.sheen_color * (d * v * nl / (scale(nv) * scale(nl)));
}

double glass_gain(const Bsdf& bsdf, const ShadingPoint& point, double nv) {
  return 1 / (bsdf.thin_walled ? reflected_share(nv, bsdf.alpha)
                               : scattered_share(nv, bsdf.alpha, index_behind(bsdf, point)));
}

// Rough glass: f cos of one white lobe and its density, for a direction on either side.
struct GlassValue {
  double value = 0;
  double pdf = 0;
};

GlassValue rough_glass(const Bsdf& bsdf, const ShadingPoint& point, const glm::dvec3& wi) {
  const glm::dvec3& n = point.shading_normal;
  const double nv = glm::dot(n, point.wo);
  if (nv <= 0) return {};
  const double nl = glm::dot(n, wi);
  const bool through = nl < 0;
  if ((glm::dot(point.geometric_normal, wi) < 0) != through) return {};
  // A thin pane's transmitted light is its reflection, mirrored.
  const bool as_reflection = !through || bsdf.thin_walled;
  const glm::dvec3 seen = through && bsdf.thin_walled ? wi - 2 * nl * n : wi;
  const double eta = as_reflection ? 1 : index_behind(bsdf, point);
  glm::dvec3 h = glm::normalize(point.wo + eta * seen);
  if (glm::dot(h, n) < 0) h = -h;
  const double oh = glm::dot(point.wo, h), ih = glm::dot(seen, h);
  if (oh <= 0 || (!as_reflection && ih >= 0)) return {};
  const double reflectance = glass_reflectance(bsdf, point, oh);
  const double jacobian = as_reflection ? 1 / (4 * oh) : -ih * std::pow(eta / (oh + eta * ih), 2);
  const double d = ggx_distribution(glm::dot(n, h), bsdf.alpha);
  const double masked_o = smith_lambda_root(nv, bsdf.alpha) / nv;
  const double masked_i = smith_lambda_root(std::abs(nl), bsdf.alpha) / std::abs(nl);
  const double share = (through ? 1 - reflectance : reflectance) * d * oh * jacobian / nv;
  return {share * 2 / (masked_o + masked_i) * glass_gain(bsdf, point, nv),
          share * 2 / (1 + masked_o)};
}

glm::dvec3 glass_tint(const Bsdf& bsdf, const ShadingPoint& point, bool through) {
  const bool tinted = through && (bsdf.thin_walled || point.outside);
  return tinted ? bsdf.base_color : glm::dvec3(1);
}

std::optional<glm::dvec3> sample_rough_glass(const Bsdf& bsdf, const ShadingPoint& point,
                                             Random& random) {
  const Frame frame(point.shading_normal);
  const glm::dvec3 wo = frame.local(point.wo);
  const glm::dvec3 h = sample_visible_normal(wo, glm::dvec2(bsdf.alpha), random.uniform2());
  const double oh = glm::dot(wo, h);
  glm::dvec3 wi = 2 * oh * h - wo;
  const bool reflected = random.uniform() < glass_reflectance(bsdf, point, oh);
  if (!reflected) {
    const double eta = index_behind(bsdf, point);
    const double behind = std::sqrt(std::max(0.0, 1 - (1 - oh * oh) / (eta * eta)));
    wi = bsdf.thin_walled ? glm::dvec3(wi.x, wi.y, -wi.z) : (oh / eta - behind) * h - wo / eta;
  }
  if (reflected != (wi.z > 0)) return std::nullopt;  // into another facet
  return glm::normalize(frame.world(wi));
}

// What each lobe reflects, and how likely sample() takes it.
struct Lobes {
  double nv = 0;
  double clear_nv = 0;    // by the clear coat's normal
  glm::dvec3 plastic{0};  // s Fr(N.V)
  double lacquer = 0;     // what the clear coat reflects; the rest is left for what is below it
  // Probabilities, sum 1 unless nothing reflects.
  double diffuse = 0, specular = 0, glass = 0, sheen = 0, clearcoat = 0;
};

Lobes lobes_of(const Bsdf& bsdf, const ShadingPoint& point) {
  Lobes lobes;
  lobes.nv = glm::dot(point.shading_normal, point.wo);
  lobes.clear_nv = glm::dot(point.clear_normal, point.wo);
  lobes.plastic = plastic_reflectance(bsdf, lobes.nv);
  const double opaque = (1 - bsdf.metallic) * (1 - bsdf.transmission);
  lobes.diffuse = opaque * (1 - strongest(lobes.plastic)) * mean(bsdf.base_color);
  lobes.glass = (1 - bsdf.metallic) * bsdf.transmission;
  if (lobes.nv > 0) {
    lobes.specular =
        opaque * mean(lobes.plastic) + bsdf.metallic * mean(schlick(bsdf.base_color, lobes.nv));
  }
  // On the outside of solid glass; from inside, too, the direction outside counts.
  double outside = std::clamp(lobes.clear_nv, 0.0, 1.0);
  if (bsdf.transmission > 0 && !bsdf.thin_walled && !point.outside)
    outside = std::sqrt(std::max(0.0, 1 - (1 - outside * outside) * bsdf.ior * bsdf.ior));
  lobes.lacquer = bsdf.clearcoat * fresnel_dielectric(outside, 1.5);
  if (lobes.nv > 0 && has_sheen_towards(bsdf, point, point.wo))
    lobes.sheen = (1 - lobes.lacquer) * mean(bsdf.sheen_color) *
                  std::min(1.0, sheen_share(lobes.nv, bsdf.sheen_roughness));
  const double below = (1 - lobes.lacquer) * left_by_sheen(bsdf, point, point.wo);
  lobes.diffuse *= below;
  lobes.specular *= below;
  lobes.glass *= below;
  lobes.clearcoat = lobes.clear_nv > 0 ? lobes.lacquer : 0;
  const double sum = lobes.diffuse + lobes.specular + lobes.glass + lobes.sheen + lobes.clearcoat;
  if (sum > 0) {
    lobes.sheen /= sum;
    lobes.diffuse /= sum;
    lobes.specular /= sum;
    lobes.glass /= sum;
    lobes.clearcoat /= sum;
  }
  return lobes;
}

std::optional<BsdfSample> sample_glass(const Bsdf& bsdf, const ShadingPoint& point,
                                       const Lobes& lobes, Random& random) {
  const double nv = lobes.nv;
  if (nv <= 0) return std::nullopt;
  const glm::dvec3& n = point.shading_normal;
  const double eta = index_behind(bsdf, point);
  const glm::dvec3 weight((1 - lobes.lacquer) * (1 - bsdf.metallic) * bsdf.transmission /
                          lobes.glass);
  if (random.uniform() < glass_reflectance(bsdf, point, nv)) {
    const glm::dvec3 wi = 2 * nv * n - point.wo;
    if (glm::dot(wi, point.geometric_normal) <= 0) return std::nullopt;
    return BsdfSample{wi, weight * under_sheen(bsdf, point, wi), 0, true};
  }
  glm::dvec3 wi = -point.wo;
  if (!bsdf.thin_walled) {
    const double cos_behind = std::sqrt(std::max(0.0, 1 - (1 - nv * nv) / (eta * eta)));
    wi = glm::normalize((nv / eta - cos_behind) * n - point.wo / eta);
  }
  if (glm::dot(wi, point.geometric_normal) >= 0) return std::nullopt;
  return BsdfSample{wi, weight * glass_tint(bsdf, point, true) * under_sheen(bsdf, point, wi), 0,
                    true};
}

// f * cos of the clear coat, which has a normal of its own.
double clearcoat_value(const Bsdf& bsdf, const ShadingPoint& point, const Lobes& lobes,
                       const glm::dvec3& wi) {
  const double nl = glm::dot(point.clear_normal, wi);
  if (bsdf.smooth_clearcoat || lobes.clear_nv <= 0 || nl <= 0) return 0;
  const glm::dvec3 h = glm::normalize(point.wo + wi);
  return nl * lobes.lacquer *
         ggx_brdf(nl, lobes.clear_nv, glm::dot(point.clear_normal, h), bsdf.clearcoat_alpha);
}

}  // namespace

double fresnel_dielectric(double cos_incident, double eta) {
  const double sin2_behind = (1 - cos_incident * cos_incident) / (eta * eta);
  if (sin2_behind >= 1) return 1;
  const double cos_behind = std::sqrt(1 - sin2_behind);
  const double parallel = (eta * cos_incident - cos_behind) / (eta * cos_incident + cos_behind);
  const double perpendicular =
      (cos_incident - eta * cos_behind) / (cos_incident + eta * cos_behind);
  return 0.5 * (parallel * parallel + perpendicular * perpendicular);
}

bool is_specular(const Bsdf& bsdf) {
  return bsdf.metallic > 0 || bsdf.transmission > 0 || bsdf.clearcoat > 0 ||
         (bsdf.specular > 0 && bsdf.ior > 1);
}

bool only_dirac(const Bsdf& bsdf) {
  const bool diffuse = bsdf.metallic < 1 && bsdf.transmission < 1;
  const bool rough = !bsdf.smooth && (diffuse || bsdf.metallic > 0);
  const bool glass = bsdf.metallic < 1 && bsdf.transmission > 0 && !bsdf.smooth_glass();
  const bool lacquer = bsdf.clearcoat > 0 && !bsdf.smooth_clearcoat;
  return !diffuse && !rough && !glass && !lacquer && !has_sheen(bsdf);
}

glm::dvec3 straight_through(const Bsdf& bsdf, const ShadingPoint& point) {
  const double nv = glm::dot(point.shading_normal, point.wo);
  const bool is_pane =
      bsdf.thin_walled && bsdf.smooth_glass() && bsdf.clearcoat <= 0 && !has_sheen(bsdf);
  if (!is_pane || nv <= 0) return glm::dvec3(0);
  return (1 - bsdf.metallic) * bsdf.transmission * (1 - glass_reflectance(bsdf, point, nv)) *
         bsdf.base_color;
}

double sheen_lambda(double cosine, double alpha) {
  const double p = (1 - alpha) * (1 - alpha);
  const auto l = [p](double x) {
    const double a = p * 25.3245 + (1 - p) * 21.5473, b = p * 3.32435 + (1 - p) * 3.82987;
    const double c = p * 0.16801 + (1 - p) * 0.19823, d = p * -1.27393 + (1 - p) * -1.97760;
    const double e = p * -4.85967 + (1 - p) * -4.32054;
    return a / (1 + b * std::pow(x, c)) + d * x + e;
  };
  return std::exp(cosine < 0.5 ? l(cosine) : 2 * l(0.5) - l(std::max(0.0, 1 - cosine)));
}

bool scatters_behind(const Bsdf& bsdf) {
  return bsdf.metallic < 1 && bsdf.transmission > 0 && !bsdf.smooth_glass();
}

glm::dvec3 evaluate(const Bsdf& bsdf, const ShadingPoint& point, const glm::dvec3& wi) {
  const double nl = glm::dot(point.shading_normal, wi);
  const Lobes lobes = lobes_of(bsdf, point);
  glm::dvec3 glass(0);
  if (scatters_behind(bsdf)) {
    glass = (1 - bsdf.metallic) * bsdf.transmission * rough_glass(bsdf, point, wi).value *
            glass_tint(bsdf, point, nl < 0) * (1 - lobes.lacquer) * under_sheen(bsdf, point, wi);
  }
  if (glm::dot(point.geometric_normal, wi) <= 0) return glass;
  glass += clearcoat_value(bsdf, point, lobes, wi);
  if (nl <= 0) return glass;
  const double opaque = (1 - bsdf.metallic) * (1 - bsdf.transmission);
  glm::dvec3 f = opaque * (1 - strongest(lobes.plastic)) / pi * bsdf.base_color;
  if (!bsdf.smooth && lobes.nv > 0) {
    const glm::dvec3 h = glm::normalize(point.wo + wi);
    f += Reflection(bsdf, point).brdf(wi) *
         (opaque * lobes.plastic + bsdf.metallic * conductor_gain(bsdf, point) *
                                       schlick(bsdf.base_color, glm::dot(point.wo, h)));
  }
  f = f * under_sheen(bsdf, point, wi) + sheen_value(bsdf, point, wi) / nl;
  f *= 1 - lobes.lacquer;
  return f * nl + glass;
}

double pdf(const Bsdf& bsdf, const ShadingPoint& point, const glm::dvec3& wi) {
  const double nl = glm::dot(point.shading_normal, wi);
  const Lobes lobes = lobes_of(bsdf, point);
  double sum = scatters_behind(bsdf) ? lobes.glass * rough_glass(bsdf, point, wi).pdf : 0;
  if (glm::dot(point.geometric_normal, wi) <= 0) return sum;
  if (!bsdf.smooth_clearcoat && lobes.clearcoat > 0 && glm::dot(point.clear_normal, wi) > 0) {
    const glm::dvec3 h = glm::normalize(point.wo + wi);
    sum += lobes.clearcoat *
           ggx_pdf(lobes.clear_nv, glm::dot(point.clear_normal, h), bsdf.clearcoat_alpha);
  }
  if (nl <= 0) return sum;
  sum += (lobes.diffuse + lobes.sheen) * nl / pi;  // sheen is sampled by the cosine, too
  if (!bsdf.smooth && lobes.specular > 0) sum += lobes.specular * Reflection(bsdf, point).pdf(wi);
  return sum;
}

std::optional<BsdfSample> sample(const Bsdf& bsdf, const ShadingPoint& point, Random& random) {
  const Lobes lobes = lobes_of(bsdf, point);
  const double choice = random.uniform();
  if (choice < lobes.glass && bsdf.smooth_glass()) {
    return sample_glass(bsdf, point, lobes, random);
  }
  const glm::dvec3& n = point.shading_normal;
  const Frame frame(n);
  glm::dvec3 wi;
  if (choice < lobes.glass) {
    if (lobes.nv <= 0) return std::nullopt;
    const auto direction = sample_rough_glass(bsdf, point, random);
    if (!direction) return std::nullopt;
    wi = *direction;
  } else if (choice < lobes.glass + lobes.specular) {
    if (bsdf.smooth) {
      wi = 2 * lobes.nv * n - point.wo;
      if (glm::dot(wi, point.geometric_normal) <= 0) return std::nullopt;
      const double opaque = (1 - bsdf.metallic) * (1 - bsdf.transmission);
      const glm::dvec3 weight =
          opaque * lobes.plastic + bsdf.metallic * schlick(bsdf.base_color, lobes.nv);
      const double left = (1 - lobes.lacquer) * under_sheen(bsdf, point, wi);
      return BsdfSample{wi, left * weight / lobes.specular, 0, true};
    }
    wi = Reflection(bsdf, point).sample(random);
  } else if (choice < lobes.glass + lobes.specular + lobes.clearcoat) {
    if (bsdf.smooth_clearcoat) {
      wi = 2 * lobes.clear_nv * point.clear_normal - point.wo;
      if (glm::dot(wi, point.geometric_normal) <= 0) return std::nullopt;
      return BsdfSample{wi, glm::dvec3(lobes.lacquer / lobes.clearcoat), 0, true};
    }
    const Frame of_coat(point.clear_normal);
    const glm::dvec3 wo = of_coat.local(point.wo);
    const glm::dvec3 h =
        sample_visible_normal(wo, glm::dvec2(bsdf.clearcoat_alpha), random.uniform2());
    wi = of_coat.world(2 * glm::dot(wo, h) * h - wo);
  } else if (lobes.diffuse + lobes.sheen > 0) {
    const glm::dvec2 u = random.uniform2();
    const double r = std::sqrt(u.x);
    wi = frame.world({r * std::cos(2 * pi * u.y), r * std::sin(2 * pi * u.y), std::sqrt(1 - u.x)});
  } else {
    return std::nullopt;
  }
  const double density = pdf(bsdf, point, wi);
  if (!(density > 0)) return std::nullopt;
  return BsdfSample{wi, evaluate(bsdf, point, wi) / density, density, false};
}

}  // namespace previz::truth
