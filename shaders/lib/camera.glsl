// The camera as a measurement: the radiance of real points that the plate shows (shaders/README.md,
// "Camera radiance").
#ifndef PREVIZ_CAMERA_GLSL
#define PREVIZ_CAMERA_GLSL

#include "shaders/lib/calibrated_ray.glsl"
#include "shaders/lib/lens.glsl"

// width * height: radiance, 1 / depth of the surface (0: not to be used). This is a view of
// camera_usable.comp's plate.
PREVIZ_FETCHED(vec4, seen_radiance)

// A point is taken for the surface that the plate shows if its depth differs from that surface's by
// no more than this share.
const float SEEN_DEPTH_TOLERANCE = 2e-3;
// The ray through a point's projection must pass the point this closely, in pixels. Otherwise the
// distortion has folded the point back into the picture.
const float SEEN_RAY_TOLERANCE = 0.5;

// Returns the place in the picture of a ray given by x/z and y/z; pixel centres are at whole
// numbers.
vec2 project(vec2 ray) {
  const vec2 bent = distorted(ray, frame.radial, frame.radial_divisor, frame.tangential);
  return frame.focal_px * bent + frame.principal_px;
}

// Looks up the radiance that the plate shows of a surface point, interpolated between the four
// pixels around it. It returns false if the point is outside the picture or hidden, or if any of
// the four pixels must not be used.
bool measured_radiance(vec3 position, out vec3 radiance) {
  radiance = vec3(0.0);
  const vec3 camera = frame.world_from_camera[0].xyz * position.x +
                      frame.world_from_camera[1].xyz * position.y +
                      frame.world_from_camera[2].xyz * position.z;
  if (camera.z <= 0.0) return false;
  const vec2 ray = camera.xy / camera.z;
  const vec2 at = project(ray);
  const vec2 last = vec2(frame.width, frame.height) - 1.0;
  if (!all(greaterThanEqual(at, vec2(0.0))) || !all(lessThan(at, last))) return false;
  const uvec2 pixel = uvec2(at + 0.5);
  const vec2 off = (calibrated_ray(pixel, at + 0.5 - vec2(pixel)) - ray) * frame.focal_px;
  if (dot(off, off) > SEEN_RAY_TOLERANCE * SEEN_RAY_TOLERANCE) return false;
  const vec2 low = floor(at);
  const int first = int(low.y) * int(frame.width) + int(low.x);
  const int below = first + int(frame.width);
  const vec4 p00 = fetch(seen_radiance, first), p10 = fetch(seen_radiance, first + 1);
  const vec4 p01 = fetch(seen_radiance, below), p11 = fetch(seen_radiance, below + 1);
  if (min(min(p00.w, p10.w), min(p01.w, p11.w)) <= 0.0) return false;
  const vec2 f = at - low;
  const vec4 seen = mix(mix(p00, p10, f.x), mix(p01, p11, f.x), f.y);
  // Inverse depths may be interpolated, since that of a plane is linear over the picture.
  if (abs(seen.w * camera.z - 1.0) > SEEN_DEPTH_TOLERANCE) return false;
  radiance = seen.rgb;
  return true;
}

#endif
