// Textures: where a texel is beyond their edges, and what lies at a point or under a footprint.
#ifndef PREVIZ_TEXTURES_GLSL
#define PREVIZ_TEXTURES_GLSL

#include "shaders/lib/records.glsl"

PREVIZ_FETCHED(uvec4, textures)  // TEXTURE_TEXELS a GpuTexture
PREVIZ_FETCHED(uvec2, texels)    // all textures one after the other: four halves a texel, linear

const int TEXTURE_TEXELS = 2;
GpuTexture texture_at(uint index) {
  PREVIZ_FETCH_RECORD(textures, TEXTURE_TEXELS, index, t, f)
  return GpuTexture(t[0].x, t[0].y, t[0].z, t[0].w, t[1].x, t[1].y, t[1].z, t[1].w);
}

vec4 fetch_texel(GpuTexture t, ivec2 at) {
  const uvec2 bits = fetch(texels, int(t.first_texel) + at.y * int(t.width) + at.x);
  return vec4(unpackHalf2x16(bits.x), unpackHalf2x16(bits.y));
}

// Returns the texel that stands for texel i beyond the edges, by the wrap mode.
int wrap_texel(int i, int size, uint mode) {
  if (mode == TEXTURE_CLAMP) return clamp(i, 0, size - 1);
  const int period = mode == TEXTURE_MIRROR ? 2 * size : size;
  i = i - period * int(floor(float(i) / float(period)));
  i = clamp(i, 0, period - 1);  // far out, float division may be off by one
  return i < size ? i : period - 1 - i;
}

// Looks up a texture, bilinearly or at the nearest texel.
vec4 sample_texture(uint index, vec2 uv) {
  const GpuTexture t = texture_at(index);
  const ivec2 size = ivec2(t.width, t.height);
  // Beyond this range a float cannot resolve texels; the clamp also keeps NaN out of the
  // addressing.
  uv = clamp(uv, vec2(-65536.0), vec2(65536.0));
  const vec2 at = uv * vec2(size);
  if (t.nearest != 0u) {
    const ivec2 i = ivec2(floor(at));
    return fetch_texel(t, ivec2(wrap_texel(i.x, size.x, t.wrap_u), wrap_texel(i.y, size.y, t.wrap_v)));
  }
  const vec2 low = floor(at - 0.5);
  const vec2 f = at - 0.5 - low;
  const int x0 = wrap_texel(int(low.x), size.x, t.wrap_u);
  const int x1 = wrap_texel(int(low.x) + 1, size.x, t.wrap_u);
  const int y0 = wrap_texel(int(low.y), size.y, t.wrap_v);
  const int y1 = wrap_texel(int(low.y) + 1, size.y, t.wrap_v);
  return mix(mix(fetch_texel(t, ivec2(x0, y0)), fetch_texel(t, ivec2(x1, y0)), f.x),
             mix(fetch_texel(t, ivec2(x0, y1)), fetch_texel(t, ivec2(x1, y1)), f.x), f.y);
}

// Looks up a texture's mean over a footprint of this area (in the units of uv), which takes so many of
// its texels: between the two levels whose texels are next in size. A footprint of less than a texel
// is a point.
vec4 sample_footprint(uint index, vec2 uv, float area) {
  if (!has_feature(FEATURE_FILTERED_TEXTURES)) return sample_texture(index, uv);
  const uint levels = texture_at(index).levels;
  const float taken = area * float(texture_at(index).width) * float(texture_at(index).height);
  if (levels == 0u || !(taken > 1.0)) return sample_texture(index, uv);
  const float level = min(0.5 * log2(taken), float(levels));
  const uint fine = min(uint(level), levels - 1u);
  const uint first = texture_at(index).first_level;
  return mix(sample_texture(fine == 0u ? index : first + fine - 1u, uv),
             sample_texture(first + fine, uv), level - float(fine));
}

#endif
