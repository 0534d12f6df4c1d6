// Carries what the frames before showed at each pixel along to this frame, and adds this frame to it:
// the mean of the change, which is the difference of the worlds on real surfaces and the radiance of
// virtual ones. A pixel has two sides: its own is what it shows at its middle, and where a virtual object
// ends in it, the other one is what else it shows. Each has a mean of its own samples alone, and moves as
// its surface does (shaders/README.md, "Accumulation over time").
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/fetch.glsl"
#include "shaders/lib/history.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;
layout(scalar, push_constant) uniform Show { GpuShow show; };
layout(constant_id = 0) const uint FEATURES = 0xffffffffu;

// This frame's, of the band, as composite.comp makes them.
layout(scalar) readonly buffer Composites { vec4 composites[]; };
layout(scalar) readonly buffer Signals { vec4 signals[]; };
layout(scalar) readonly buffer Variances { vec4 variances[]; };
layout(scalar) readonly buffer Uncovered { vec4 uncovered[]; };
layout(scalar) readonly buffer Albedos { uvec2 albedos[]; };
layout(scalar) readonly buffer Caustics { vec4 caustics[]; };
// This frame's, of the picture, as history_surface.comp and history_cover.comp make them.
layout(scalar) readonly buffer Places { vec4 places[]; };
layout(scalar) readonly buffer Things { uvec2 things[]; };
layout(scalar) readonly buffer Befores { vec2 befores[]; };
layout(scalar) readonly buffer BentPlaces { vec3 bent_places[]; };
layout(scalar) readonly buffer Covers { float covers[]; };
// The history up to the frame before, of its picture.
PREVIZ_FETCHED(vec4, past_places)
PREVIZ_FETCHED(uvec2, past_things)
PREVIZ_FETCHED(vec4, past_lights)
PREVIZ_FETCHED(uvec2, past_spreads)
PREVIZ_FETCHED(uvec2, past_albedos)
PREVIZ_FETCHED(uvec2, past_others)
PREVIZ_FETCHED(uvec2, past_caustics)
// The history up to this frame. Four halves each, but for the light.
layout(scalar) writeonly buffer KeptLights { vec4 kept_lights[]; };     // own: change over white and albedo;
                                                                        // 1 / samples, or 0: none yet
layout(scalar) writeonly buffer KeptSpreads { uvec2 kept_spreads[]; };  // own: standard deviation of a
                                                                        // sample; mean(M)
layout(scalar) writeonly buffer KeptAlbedos { uvec2 kept_albedos[]; };  // own; 0: it is in the light
layout(scalar) writeonly buffer KeptOthers { uvec2 kept_others[]; };    // other: change over white; samples,
                                                                        // below 0 where no ray has found it
layout(scalar) writeonly buffer KeptCaustics { uvec2 kept_caustics[]; };  // own: photons' light over white;
                                                                          // its standard deviation

// A point of the history shows the same surface as a pixel if it lies within this share of the
// distance from the pixel's plane, and the cosine of the normals is at least LEAST_ALIKE.
const float MOST_OFF_PLANE = 0.01;
const float LEAST_ALIKE = 0.9;
// Interpolating between pixels that are f apart blurs by a variance of f (1 - f), in pixels squared.
// Where a history cannot be sharpened again, it is kept for as long as it is blurred by no more than
// this.
const float MOST_BLUR = 2.0;
// Nearer to a pixel than this, the pixel itself is taken.
const float SNAP = 0.01;
// A history that counts as less than this share of a sample is none.
const float LEAST_COUNTED = 0.25;
// A pixel becomes whole again where less than this share of it shows another side.
const float LEAST_SHARE = 1.0 / 512.0;
// A place in a mirror is looked for in so many steps of no more pixels than these. Where slopes are less
// apart than this, their angle's squared sine, they do not tell where it is.
const int MOST_STEPS = 6;
// What is not found there moves as the mirror does, for so many frames at most.
const float MOST_LOOSE = 4.0;
const float LONGEST_STEP = 8.0;
const float LEAST_DETERMINANT = 1e-4;
const ivec2 AROUND[8] = ivec2[](ivec2(1, 0), ivec2(-1, 0), ivec2(0, 1), ivec2(0, -1), ivec2(1, 1),
                                ivec2(-1, 1), ivec2(1, -1), ivec2(-1, -1));
// Another side of so many samples counts as half of an own side.
const float HALF_KNOWING = 2.0;
// The other side moves as the nearest pixel within this reach whose own side it is.
const int REACH = int(HISTORY_REACH);

// The side at the middle of a pixel.
struct Own {
  vec3 light;     // over white and `albedo`
  float doubt;    // sum of the squared weights of the samples, 1 / their effective number
  vec3 variance;  // of a sample
  float mask;     // mean(M)
  vec3 albedo;
  vec4 caustic;   // of photons, over white; variance of the mean
};

struct Other {
  vec3 light;     // over white
  float samples;
};

// What a pixel looks for in the frame before.
struct Wanted {
  vec2 at;        // place in its picture; pixel centres are at whole numbers
  vec3 position;  // from its camera
  vec3 normal;
  uint thing;     // pack_thing()
  float most;     // samples that it may count as
  bool is_loose;  // any place of it in the same mirror will do
};

int width() { return int(history.width); }
bool is_inside(ivec2 at, uint w, uint h) {
  return all(greaterThanEqual(at, ivec2(0))) && all(lessThan(at, ivec2(w, h)));
}
vec2 picture_scale() {
  return vec2(history.width_before, history.height_before) / vec2(history.width, history.height);
}
uint in_picture(ivec2 at) { return uint(at.y * width() + at.x); }
bool is_partly(float mask) { return mask > 0.0 && mask < 1.0; }

bool is_same_surface(int index, uint normal, Wanted wanted) {
  if (wanted.is_loose) return true;
  const vec3 off = fetch(past_places, index).xyz - wanted.position;
  return abs(dot(off, wanted.normal)) <= MOST_OFF_PLANE * length(wanted.position) &&
         dot(geometric_of(normal), wanted.normal) >= LEAST_ALIKE;
}

// A thing that a mirror shows coming out from behind another has no past, or that other one would be seen
// beside itself.
bool is_same_thing(uint thing, Wanted wanted) {
  if (!wanted.is_loose) return thing == wanted.thing;
  return are_same_mirror(thing, wanted.thing) && instance_of(thing) == instance_of(wanted.thing);
}

// Returns the index of a pixel of the frame before, or -1 where its own side is not what is wanted.
int own_index(ivec2 at, Wanted wanted) {
  if (!is_inside(at, history.width_before, history.height_before)) return -1;
  const int index = at.y * int(history.width_before) + at.x;
  const uvec2 thing = fetch(past_things, index);
  if (!is_same_thing(thing.x, wanted) || !is_same_surface(index, thing.y, wanted)) return -1;
  return fetch(past_lights, index).w > 0.0 ? index : -1;
}

// Returns how far the places that a mirror shows are apart from a pixel to the next, along one axis.
bool find_slope(ivec2 at, ivec2 axis, out vec3 slope) {
  const uint here = in_picture(at);
  for (int side = 1; side >= -1; side -= 2) {
    const ivec2 beside = at + side * axis;
    if (!is_inside(beside, history.width, history.height)) continue;
    const uint there = in_picture(beside);
    slope = float(side) * (places[there].xyz - places[here].xyz);
    if (things[there].x == things[here].x) return true;
  }
  return false;
}

// Returns the nearest pixel of the frame before whose own side is what is wanted, or -1.
int own_index_near(ivec2 at, Wanted wanted) {
  const int index = own_index(at, wanted);
  if (index >= 0) return index;
  for (int i = 0; i < 8; ++i) {
    const int beside = own_index(at + AROUND[i], wanted);
    if (beside >= 0) return beside;
  }
  return -1;
}

// Finds where a mirror showed a place in the frame before. That is looked for among the places that its
// pixels showed then, by Newton's method from where its surface was, with this frame's slopes.
bool find_in_mirror(ivec2 at, inout Wanted wanted) {
  vec3 slope_x, slope_y;
  if (!find_slope(at, ivec2(1, 0), slope_x) || !find_slope(at, ivec2(0, 1), slope_y)) return false;
  const vec2 scale = picture_scale();
  slope_x /= scale.x;
  slope_y /= scale.y;
  const float xx = dot(slope_x, slope_x), xy = dot(slope_x, slope_y), yy = dot(slope_y, slope_y);
  const float determinant = xx * yy - xy * xy;
  if (!(determinant > LEAST_DETERMINANT * xx * yy)) return false;
  for (int i = 0; i < MOST_STEPS; ++i) {
    const int index = own_index_near(ivec2(floor(wanted.at + 0.5)), wanted);
    if (index < 0) return false;
    const vec2 there = vec2(index % int(history.width_before), index / int(history.width_before));
    const vec3 off = wanted.position - fetch(past_places, index).xyz;
    const float x = dot(off, slope_x), y = dot(off, slope_y);
    const vec2 step = vec2(yy * x - xy * y, xx * y - xy * x) / determinant;
    wanted.at = there + clamp(step, -LONGEST_STEP, LONGEST_STEP);
    if (all(lessThan(abs(step), vec2(1.0)))) return true;
  }
  return false;
}

// Finds where a pixel was in the frame before, if it moves as what is seen at `source` does. Unless
// `in_mirrors` says that what a mirror shows is looked for, it moves as the mirror.
bool find_before(ivec2 at, ivec2 source, bool in_mirrors, out Wanted wanted) {
  const uvec2 thing = things[in_picture(source)];
  const vec4 place = places[in_picture(source)];
  wanted.thing = thing.x;
  wanted.is_loose = false;
  wanted.at = befores[in_picture(source)];
  wanted.most = min(history.most_samples, place.w);
  if (!all(lessThan(abs(wanted.at), vec2(1e6))) || wanted.most <= 0.0) return false;
  const uint instance = instance_of(thing.x);
  wanted.position = place.xyz;
  wanted.normal = geometric_of(thing.y);
  if (instance != NO_THING) {
    if (motions[instance].is_known == 0u) return false;
    wanted.position = motions[instance].points == NO_INDEX
                          ? moved(motions[instance].before_from_now, place.xyz)
                          : bent_places[in_picture(source)];
    wanted.normal = normalize(rotated(motions[instance].before_from_now, wanted.normal));
  }
  const bool has_mirrors = (FEATURES & (FEATURE_GLOSSY | FEATURE_TRANSMISSION)) != 0u;
  if (has_mirrors && is_seen_in_mirror(thing.x)) {
    const vec2 of_mirror = wanted.at;
    wanted.is_loose = !(in_mirrors && find_in_mirror(source, wanted));
    if (wanted.is_loose) {
      wanted.at = of_mirror;
      wanted.most = min(wanted.most, history.samples * MOST_LOOSE);
    }
  }
  wanted.at += picture_scale() * vec2(at - source);
  return true;
}

vec3 past_albedo(int index) { return unpack_halves(fetch(past_albedos, index)); }

// Returns a pixel's own side with its light over `albedo`, if that is known.
Own load_own(int index, vec3 albedo) {
  const vec4 light = fetch(past_lights, index);
  const vec4 spread = unpack_four_halves(fetch(past_spreads, index));
  const vec4 caustic = history.white_ratio * unpack_four_halves(fetch(past_caustics, index));
  const vec3 kept = past_albedo(index);
  vec3 factor = vec3(history.white_ratio);
  if (is_known(albedo) && !is_known(kept)) factor /= albedo;
  const vec3 deviation = factor * spread.rgb;
  return Own(factor * light.rgb, light.w, deviation * deviation, spread.w,
             is_known(kept) ? kept : albedo, vec4(caustic.rgb, caustic.w * caustic.w));
}

// Reads what a pixel of the frame before shows of a side. `of` is the class of that: it is the pixel's
// own side where the outline has moved on.
bool load_other(ivec2 at, float of, Wanted wanted, out Other other) {
  if (!is_inside(at, history.width_before, history.height_before)) return false;
  const int index = at.y * int(history.width_before) + at.x;
  const uint thing = fetch(past_things, index).x;
  const float side = class_of(thing);
  if (side == of) {
    const vec4 light = fetch(past_lights, index);
    if (!is_same_thing(thing, wanted) || !(light.w > 0.0)) return false;
    const Own own = load_own(index, vec3(0.0));
    other = Other((is_known(own.albedo) ? own.albedo : vec3(1.0)) * own.light + own.caustic.rgb,
                  1.0 / light.w);
    return true;
  }
  const vec4 kept = unpack_four_halves(fetch(past_others, index));
  other = Other(history.white_ratio * kept.rgb, abs(kept.w));
  return side == 1.0 - of && other.samples > 0.0;
}

// Returns the weights of four neighbours for a point f behind the second (Catmull and Rom 1974).
vec4 sharp_weights(float f) {
  return vec4(f * (-0.5 + f * (1.0 - 0.5 * f)), 1.0 + f * f * (-2.5 + 1.5 * f),
              f * (0.5 + f * (2.0 - 1.5 * f)), f * f * (-0.5 + 0.5 * f));
}

// A sum with sharp_weights(), some of which are below 0.
struct Sharp {
  vec3 sum;
  vec3 least, most;  // of what is in it
};

const Sharp EMPTY_SHARP = Sharp(vec3(0.0), vec3(1e30), vec3(-1e30));

void add(inout Sharp sharp, float weight, vec3 light) {
  sharp.sum += weight * light;
  sharp.least = min(sharp.least, light);
  sharp.most = max(sharp.most, light);
}

// Beside a lamp in a mirror, or a focus, the sum would be below all that there is. Noise is left as it is,
// which a limit would move to where more of it is.
vec3 limited(Sharp sharp) { return clamp(sharp.sum, sharp.least, sharp.most); }

// Adds the 12 pixels around the four to what is interpolated without blurring. Returns false if one of
// them is missing.
bool add_around(ivec2 low, vec4 wx, vec4 wy, Wanted wanted, vec3 albedo, inout Sharp light,
                inout Sharp caustic) {
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 4; ++x) {
      if ((x == 1 || x == 2) && (y == 1 || y == 2)) continue;
      if (wx[x] * wy[y] == 0.0) continue;
      const int index = own_index(low + ivec2(x - 1, y - 1), wanted);
      if (index < 0) return false;
      const Own own = load_own(index, albedo);
      add(light, wx[x] * wy[y], own.light);
      add(caustic, wx[x] * wy[y], own.caustic.rgb);
    }
  return true;
}

// A place among four pixels: the first of them, and how far it is from that, in pixels.
struct Cell {
  ivec2 low;
  vec2 f;
};

Cell cell_at(vec2 at) {
  const vec2 low = floor(at);
  const vec2 f = at - low;
  return Cell(ivec2(low) + ivec2(greaterThan(f, vec2(1.0 - SNAP))),
              mix(f, vec2(0.0), greaterThan(abs(f - 0.5), vec2(0.5 - SNAP))));
}

float weight_of(Cell cell, int x, int y) {
  return (x == 0 ? 1.0 - cell.f.x : cell.f.x) * (y == 0 ? 1.0 - cell.f.y : cell.f.y);
}

float blur_of(Cell cell) { return dot(cell.f, 1.0 - cell.f); }

// Returns the albedo that a pixel's light is over, if this frame has none: that of a pixel before.
vec3 albedo_before(Cell cell, Wanted wanted) {
  for (int i = 0; i < 4; ++i) {
    const int index = own_index(cell.low + ivec2(i & 1, i >> 1), wanted);
    if (index >= 0 && is_known(past_albedo(index))) return past_albedo(index);
  }
  return vec3(0.0);
}

// What pixels show of a surface beside their own side, over white.
struct Behind {
  vec3 light;
  float weight;
};

// Adds what a pixel of the frame before shows of the wanted side, which ends in it. Without this, what is at an
// outline, a contact shadow, would be made of what is around it.
void add_other(inout Behind behind, float weight, ivec2 at, Wanted wanted) {
  Other other;
  const float of = class_of(wanted.thing);
  if (is_seen_in_mirror(wanted.thing) || !load_other(at, of, wanted, other)) return;
  const float known = other.samples / (other.samples + HALF_KNOWING);
  behind.light += weight * known * other.light;
  behind.weight += weight * known;
}

// Interpolates the own side at the wanted place among the pixels that show the wanted surface, and
// lowers the samples that it may count as.
bool interpolate_own(inout Wanted wanted, vec3 albedo, out Own own) {
  own = Own(vec3(0.0), 0.0, vec3(0.0), 0.0, vec3(0.0), vec4(0.0));
  const Cell cell = cell_at(wanted.at);
  if (!is_known(albedo)) albedo = albedo_before(cell, wanted);
  const vec4 wx = sharp_weights(cell.f.x);
  const vec4 wy = sharp_weights(cell.f.y);
  float total = 0.0;
  Behind behind = Behind(vec3(0.0), 0.0);
  Sharp sharp = EMPTY_SHARP;
  Sharp sharp_caustic = EMPTY_SHARP;
  for (int y = 0; y < 2; ++y)
    for (int x = 0; x < 2; ++x) {
      const float weight = weight_of(cell, x, y);
      const int index = weight > 0.0 ? own_index(cell.low + ivec2(x, y), wanted) : -1;
      if (index < 0) {
        if (weight > 0.0) add_other(behind, weight, cell.low + ivec2(x, y), wanted);
        continue;
      }
      const Own there = load_own(index, albedo);
      own.light += weight * there.light;
      own.doubt += weight * there.doubt;
      own.variance += weight * there.variance;
      own.mask += weight * there.mask;
      own.albedo += weight * there.albedo;
      own.caustic += weight * there.caustic;
      total += weight;
      add(sharp, wx[x + 1] * wy[y + 1], there.light);
      add(sharp_caustic, wx[x + 1] * wy[y + 1], there.caustic.rgb);
    }
  if (total < 0.05) return false;
  // The sums are left as they are where all are there: a mean of equal values is the value itself.
  if (total < 1.0) {
    own.light /= total;
    own.doubt /= total;
    own.variance /= total;
    own.mask /= total;
    own.albedo /= total;
    own.caustic /= total;
    if (behind.weight > 0.0) {
      const vec3 over = is_known(own.albedo) ? own.albedo : vec3(1.0);
      const vec3 light = (behind.light / behind.weight - own.caustic.rgb) / over;
      own.light = mix(own.light, light, behind.weight / (total + behind.weight));
    }
  }
  const float blur = blur_of(cell);
  if (blur <= 0.0) return true;
  if (total > 0.999 && add_around(cell.low, wx, wy, wanted, albedo, sharp, sharp_caustic)) {
    own.light = is_seen_in_mirror(wanted.thing) ? limited(sharp) : sharp.sum;
    own.caustic.rgb = limited(sharp_caustic);
    return true;
  }
  wanted.most = min(wanted.most, history.samples * MOST_BLUR / blur);
  return wanted.most >= LEAST_COUNTED;
}

// Interpolates the other side in the same way, whose class is `of`, and lowers its samples.
bool interpolate_other(Wanted wanted, float of, out Other other) {
  other = Other(vec3(0.0), 0.0);
  const Cell cell = cell_at(wanted.at);
  float total = 0.0;
  for (int y = 0; y < 2; ++y)
    for (int x = 0; x < 2; ++x) {
      Other there;
      const float weight = weight_of(cell, x, y);
      if (weight <= 0.0 || !load_other(cell.low + ivec2(x, y), of, wanted, there)) continue;
      other.light += weight * there.light;
      other.samples += weight * there.samples;
      total += weight;
    }
  if (total < 0.05) return false;
  other.light /= total;
  other.samples /= total;
  const float blur = blur_of(cell);
  const float most = blur > 0.0 ? history.samples * MOST_BLUR / blur : wanted.most;
  other.samples = min(other.samples, min(wanted.most, most));
  return other.samples >= LEAST_COUNTED;
}

// Returns the nearest pixel around that is of class `of`; the pixel itself if there is none.
ivec2 nearest_of(ivec2 at, float of) {
  ivec2 nearest = at;
  int least = 2 * REACH * REACH + 1;
  for (int y = -REACH; y <= REACH; ++y)
    for (int x = -REACH; x <= REACH; ++x) {
      const ivec2 there = at + ivec2(x, y);
      if (x * x + y * y >= least || !is_inside(there, history.width, history.height)) continue;
      if (class_of(things[in_picture(there)].x) != of) continue;
      least = x * x + y * y;
      nearest = there;
    }
  return nearest;
}

// Returns whether a pixel is where it was in the frame before.
bool is_at(Wanted wanted, ivec2 at) {
  return all(lessThan(abs(wanted.at - picture_scale() * vec2(at)), vec2(SNAP)));
}

// Returns whether the nearest pixel of the frame before had another side that no ray had found: of
// something thinner than a pixel.
bool was_thin(Wanted wanted) {
  const ivec2 at = ivec2(floor(wanted.at + 0.5));
  if (!is_inside(at, history.width_before, history.height_before)) return false;
  const int index = at.y * int(history.width_before) + at.x;
  return unpack_four_halves(fetch(past_others, index)).w < 0.0;
}

// The sides of a pixel by this frame's samples alone.
struct Now {
  Own own;
  Other other;
  float samples;  // of its own side
};

Now this_frame(uint in_band, float side) {
  const float mask = composites[in_band].w;
  const float share = side > 0.5 ? mask : 1.0 - mask;
  const vec3 albedo = unpack_halves(albedos[in_band]);
  const vec3 change = signals[in_band].rgb;
  const vec3 caustic = show.has_caustics != 0u ? caustics[in_band].rgb : vec3(0.0);
  const vec3 own = side > 0.5 ? change - uncovered[in_band].rgb : uncovered[in_band].rgb;
  const bool is_whole = !is_partly(mask);
  Now now;
  now.samples = history.samples * share;
  now.own.mask = mask;
  // A pixel of both sides does not know their albedos, nor how the samples of one scatter.
  now.own.albedo = is_whole && share > 0.0 ? albedo : vec3(0.0);
  now.own.variance = is_whole ? (history.samples - 1.0) * variances[in_band].rgb : vec3(0.0);
  now.own.light = is_whole ? change : own / max(share, 1e-6);
  now.own.doubt = share > 0.0 ? 1.0 / now.samples : 0.0;
  now.own.caustic = is_whole && share > 0.0 && show.has_caustics != 0u ? caustics[in_band] : vec4(0.0);
  now.other.samples = history.samples - now.samples;
  now.other.light = is_whole ? change * albedo + caustic : (change - own) / max(1.0 - share, 1e-6);
  return now;
}

// Adds the samples of this frame to the own side before.
Own added(Own past, Now now, float most) {
  past.doubt = max(past.doubt, 1.0 / most);
  if (now.samples <= 0.0) return past;
  const float share = now.samples / (now.samples + 1.0 / past.doubt);
  const vec3 over = !is_known(now.own.albedo) && is_known(past.albedo) ? past.albedo : vec3(1.0);
  const vec3 step = now.own.light / over - past.light;
  Own mean = past;
  // Written as steps from the past, so that equal values stay what they are to the last bit.
  mean.light += share * step;
  if (is_known(now.own.albedo)) {
    mean.albedo += share * (now.own.albedo - past.albedo);
    mean.variance += share * (now.own.variance - past.variance);
  }
  mean.variance += share * (1.0 - share) * step * step;
  const float most_caustics = min(1.0 / past.doubt, history.most_caustic_samples);
  const float of_caustics = now.samples / (now.samples + most_caustics);
  mean.caustic.rgb += of_caustics * (now.own.caustic.rgb - past.caustic.rgb);
  mean.caustic.w = (1.0 - of_caustics) * (1.0 - of_caustics) * past.caustic.w +
                   of_caustics * of_caustics * now.own.caustic.w;
  mean.doubt = (1.0 - share) * (1.0 - share) * past.doubt + share * share / now.samples;
  return mean;
}

Other added(Other past, Other now) {
  const float samples = past.samples + now.samples;
  if (samples <= 0.0) return past;
  return Other(past.light + now.samples / samples * (now.light - past.light), samples);
}

// Halves hold no more than this, in whites, in either direction; all of it is shown as white or black.
const float MOST_KEPT = 65504.0;

void store(uint index, Own own, Other other) {
  if (own.mask < LEAST_SHARE) own.mask = 0.0;
  if (own.mask > 1.0 - LEAST_SHARE) own.mask = 1.0;
  if (own.mask == class_of(things[index].x)) other = Other(vec3(0.0), 0.0);
  kept_lights[index] = vec4(own.light, own.doubt);
  kept_spreads[index] = pack_four_halves(vec4(min(sqrt(own.variance), MOST_KEPT), own.mask));
  kept_albedos[index] = pack_halves(own.albedo);
  kept_others[index] = pack_four_halves(clamp(vec4(other.light, other.samples), -MOST_KEPT, MOST_KEPT));
  kept_caustics[index] =
      pack_four_halves(clamp(vec4(own.caustic.rgb, sqrt(own.caustic.w)), -MOST_KEPT, MOST_KEPT));
}

void main() {
  if (gl_GlobalInvocationID.x >= show.count) return;
  const uint in_band = show.in_band + gl_GlobalInvocationID.x;
  const uint index = show.in_picture + in_band;
  const ivec2 at = ivec2(index % history.width, index / history.width);
  const float side = class_of(things[index].x);
  Now now = this_frame(in_band, side);
  // What is seen through something has no history, and what it ends at has none.
  if (!has_sides(side, covers[index])) {
    now.own.doubt = 0.0;
    store(index, now.own, Other(vec3(0.0), 0.0));
    return;
  }
  const bool is_outline = covers[index] != COVER_UNKNOWN;
  Wanted wanted;
  Own own = now.own;
  Own own_past;
  bool is_thin = false;
  bool has_past = false;
  float most = history.most_samples;
  // Neither side moves, so that how much is covered is what it was.
  bool is_still = false;
  if (find_before(at, at, true, wanted)) {
    is_still = is_at(wanted, at);
    is_thin = !is_outline && was_thin(wanted);
    has_past = interpolate_own(wanted, now.own.albedo, own_past);
    if (has_past) own = added(own_past, now, wanted.most);
    most = wanted.most;
  }
  Other other = now.other;
  Other other_past = Other(vec3(0.0), 0.0);
  if (is_outline || is_thin) {
    Wanted moved_with;
    const bool was_seen = 
        find_before(at, is_outline ? nearest_of(at, 1.0 - side) : at, false, moved_with);
    is_still = is_still && was_seen && is_at(moved_with, at);
    if (was_seen && interpolate_other(moved_with, 1.0 - side, other_past))
      other = added(other_past, now.other);
  }
  // A pixel without a sample of its own side has only had others.
  const float before = !has_past ? 1.0 - side : is_outline || is_thin ? own_past.mask : side;
  const float samples = (has_past ? 1.0 / own_past.doubt : 0.0) + other_past.samples;
  if (samples > 0.0 && is_outline && !is_still)
    own.mask = mix(covers[index], now.own.mask, history.samples / (history.samples + COVER_RAYS));
  else if (samples > 0.0)
    own.mask =
        before + history.samples / (history.samples + min(samples, most)) * (now.own.mask - before);
  if (!is_outline) other.samples = -other.samples;
  store(index, own, other);
}
