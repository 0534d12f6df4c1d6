// The calibrated lens: rays through points of the picture, by a table of the pixels' corners.
#ifndef PREVIZ_CALIBRATED_RAY_GLSL
#define PREVIZ_CALIBRATED_RAY_GLSL

#include "shaders/lib/scene.glsl"

// RG32F, (width + 1)(height + 1): x/z and y/z of the rays through the pixels' corners.
uniform textureBuffer corner_rays;

// Returns x/z and y/z of the undistorted ray through the point `inside` a pixel, which ranges over
// [0, 1]^2 of the pixel's area.
vec2 calibrated_ray(uvec2 pixel, vec2 inside) {
  const int stride = int(frame.width) + 1;
  const int corner = int(pixel.y) * stride + int(pixel.x);
  const vec2 top = mix(texelFetch(corner_rays, corner).xy, texelFetch(corner_rays, corner + 1).xy, inside.x);
  const vec2 bottom = mix(texelFetch(corner_rays, corner + stride).xy,
                          texelFetch(corner_rays, corner + stride + 1).xy, inside.x);
  return mix(top, bottom, inside.y);
}

#endif
