// The film camera's lens, forward: where rays land in the picture.
#ifndef PREVIZ_LENS_GLSL
#define PREVIZ_LENS_GLSL

// Returns the place, over the focal length, of a ray given by x/z and y/z (Brown 1966, Conrady 1919;
// coefficients in OpenCV's order). The result is not finite where the divisor is 0, and rays beyond
// the radius at which the lens folds may land in the picture.
vec2 distorted(vec2 ray, vec3 dividend, vec3 divisor, vec2 tangential) {
  const float r2 = dot(ray, ray);
  float radial = 1.0 + r2 * (dividend.x + r2 * (dividend.y + r2 * dividend.z));
  // Vulkan allows a division by 1 to round.
  if (divisor != vec3(0.0)) radial /= 1.0 + r2 * (divisor.x + r2 * (divisor.y + r2 * divisor.z));
  return ray * radial + 2.0 * tangential * ray.x * ray.y + tangential.yx * (r2 + 2.0 * ray * ray);
}

#endif
