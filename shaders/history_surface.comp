// Finds the place that each pixel shows at its middle, which is where a mirror or glass has its light from, where
// its surface was in the picture before, and for how many samples what is seen there may be carried along
// (shaders/README.md, "Accumulation over time").
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/batch.glsl"
#include "shaders/lib/calibrated_ray.glsl"
#include "shaders/lib/deformed.glsl"
#include "shaders/lib/history.glsl"
#include "shaders/lib/mirrored.glsl"
#include "shaders/lib/moved.glsl"
#include "shaders/lib/pane.glsl"
#include "shaders/lib/trace.glsl"

layout(scalar) writeonly buffer Places { vec4 places[]; };  // from the camera; most samples
layout(scalar) writeonly buffer Things { uvec2 things[]; };  // pack_thing, pack_normals
layout(scalar) writeonly buffer Befores { vec2 befores[]; };  // place in the picture before
// Where what deforms was, from the camera of the frame before. It has no pixels where nothing deforms.
layout(scalar) writeonly buffer BentPlaces { vec3 bent_places[]; };

// Plastic and lacquer reflect about this share of the light around.
const float COAT_SHARE = 0.1;
// What is reflected may turn by this share of the lobe's width while it is averaged.
const float MOST_TURN = 0.5;
const float ANY_NUMBER = 1e9;
const float LEAST_LEFT = 0.25;
// A lobe that is wider than this shows more than the one point that a ray finds.
const float SHARP_ALPHA = 0.01;

// Returns for how many samples the reflections of a surface stay what they are, if every frame turns
// them by this angle.
float most_samples(Surface s, float turn) {
  if (!is_specular(s)) return ANY_NUMBER;
  const float coat = COAT_SHARE * s.specular * (1.0 - s.metallic) * (1.0 - s.transmission);
  const float finest = 1.0 / frame.focal_px.x;  // a pixel
  float needed = max(max(s.metallic, s.transmission), coat) / max(s.alpha, finest);
  if (has_feature(FEATURE_CLEARCOAT))
    needed = max(needed, COAT_SHARE * s.clearcoat / max(s.clearcoat_alpha, finest));
  return needed * turn > 0.0 ? MOST_TURN * history.samples / (needed * turn) : ANY_NUMBER;
}

// Returns the angle between the directions, seen from the surface, to the camera now and in the frame
// before.
float turn_of(vec3 position, GpuMotion motion) {
  const vec3 now = normalize(rotated(motion.before_from_now, position));
  const vec3 before = normalize(moved(motion.before_from_now, position));
  return length(now - before);
}

// Returns the samples that are left of a past whose light has changed by this share. What counts as less than
// a quarter of a sample would only be seen as a ghost.
float left_after(float change) {
  const float left = change > 0.0 ? history.samples * history.most_drift / change : ANY_NUMBER;
  return left < LEAST_LEFT ? 0.0 : left;
}

// Returns the bits of pack_thing() for what is seen in an instance.
uint mirror_of(uint instance, uint way) {
  return 1u + hash_bits(instance) % 7u + (hash_bits(way) % 8u << 3);
}

// A pixel's own surface, as far as it is needed while a ray from it is followed over mirrors.
struct OwnSurface {
  vec3 normal;
  uint instance;
  uint of_class;  // for pack_thing
  float left;     // as left_after
  bool is_known;  // where it was before
};

// Stores what a pixel shows where its ray ends: `position` is from the camera, `most` samples may be carried
// along, and `thing` is the instance or NO_THING. `mirrors` are on the way.
void store_seen(uint index, OwnSurface own, MirroredRay ray, uint mirrors, vec3 position, vec3 normal,
                uint thing, float most) {
  // A lobe this wide shows the light of its surroundings, too, which is that of the surface itself.
  if (ray.alpha > SHARP_ALPHA) most = min(most, own.left);
  places[index] = vec4(position, own.is_known ? most : 0.0);
  const uint mirror = mirrors > 0u ? mirror_of(own.instance, ray.way) : 0u;
  things[index] = uvec2(pack_thing(thing, own.of_class, mirror), pack_normals(normal, own.normal));
}

// Finds what a pixel shows, over mirrors and through glass. The rays of the camera and of the mirrors take one
// way through the code, which fits the registers of a graphics card.
void find_seen(uint index, MirroredRay ray) {
  OwnSurface own;
  for (uint mirrors = 0u; mirrors <= MOST_MIRRORS; ++mirrors) {
    Hit hit;
    if (!trace_closest(ray.origin, ray.direction, 0.0, 3.4e38, WORLD_MIXED, ray.source, hit)) {
      if (mirrors > 0u)
        store_seen(index, own, ray, mirrors, FAR_AWAY * ray.direction, -ray.direction, NO_THING, ANY_NUMBER);
      return;
    }
    const Surface s =
        make_surface(GpuHit(hit.t, hit.barycentrics, hit.instance, hit.primitive), ray.direction, 0.0);
    // What shines through, through a hole or through a pane, is not at this surface.
    const bool is_pane = lets_light_through(instance_at(hit.instance).material);
    if (is_pane && mirrors == 0u) {
      things[index].x = pack_thing(NO_THING, SEE_THROUGH_CLASS, 0u);
      return;
    }
    vec3 elsewhere;
    const bool is_mirror = !is_pane && shows_elsewhere(s, elsewhere);
    if (is_pane || (is_mirror && mirrors == MOST_MIRRORS)) {
      store_seen(index, own, ray, mirrors, s.position, s.geometric_normal, hit.instance, 0.0);
      return;
    }
    if (mirrors == 0u || !is_mirror) {
      const GpuMotion motion = motions[hit.instance];
      const bool is_known = motion.is_known != 0u;
      float bent;
      const vec3 before = position_before(hit, s, motion, bent);
      if (motion.points != NO_INDEX) bent_places[index] = before;
      const float left = left_after(change_by_moved(s, hit.instance, bent));
      if (mirrors == 0u) {
        if (is_known) befores[index] = project_before(before);
        own = OwnSurface(s.normal, hit.instance, hit.presence == WORLD_BOTH ? 0u : 1u, left, is_known);
      }
      if (!is_mirror) {
        const float most = is_known ? most_samples(s, turn_of(s.position, motion)) : 0.0;
        store_seen(index, own, ray, mirrors, s.position, s.geometric_normal, hit.instance, min(most, left));
        return;
      }
    }
    ray = ray_from_mirror(ray, s, hit, elsewhere);
  }
}

void main() {
  if (gl_GlobalInvocationID.x >= batch.width * batch.height) return;
  const uint index = batch.y * frame.width + gl_GlobalInvocationID.x;
  const uvec2 pixel = uvec2(index % frame.width, index / frame.width);
  places[index] = vec4(0.0);
  things[index] = uvec2(pack_thing(NO_THING, 0u, 0u), 0u);
  befores[index] = vec2(NOWHERE);
  const vec3 from_lens = normalize(vec3(calibrated_ray(pixel, vec2(0.5)), 1.0));
  const vec3 direction = transform_vector(frame.world_from_camera, from_lens);
  find_seen(index, MirroredRay(vec3(0.0), direction, TRACE_FROM_NOWHERE, 0.0, 0u));
}
