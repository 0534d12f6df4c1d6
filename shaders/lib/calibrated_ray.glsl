// The calibrated lens: rays through points of the picture, by a table of the pixels' corners.
#ifndef PREVIZ_CALIBRATED_RAY_GLSL
#define PREVIZ_CALIBRATED_RAY_GLSL

#include "shaders/lib/scene.glsl"

// (width + 1)(height + 1): x/z and y/z of the rays through the pixels' corners.
PREVIZ_FETCHED(vec2, corner_rays)

// Returns x/z and y/z of the undistorted ray through the point `inside` a pixel, which ranges over
// [0, 1]^2 of the pixel's area.
vec2 calibrated_ray(uvec2 pixel, vec2 inside) {
  const int stride = int(frame.width) + 1;
  const int corner = int(pixel.y) * stride + int(pixel.x);
  const vec2 top = mix(fetch(corner_rays, corner), fetch(corner_rays, corner + 1), inside.x);
  const vec2 bottom =
      mix(fetch(corner_rays, corner + stride), fetch(corner_rays, corner + stride + 1), inside.x);
  return mix(top, bottom, inside.y);
}

#endif
