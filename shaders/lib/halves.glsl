// Three or four numbers as halves of words.
#ifndef PREVIZ_HALVES_GLSL
#define PREVIZ_HALVES_GLSL

uvec2 pack_halves(vec3 v) { return uvec2(packHalf2x16(v.rg), packHalf2x16(vec2(v.b, 0.0))); }

vec3 unpack_halves(uvec2 halves) {
  return vec3(unpackHalf2x16(halves.x), unpackHalf2x16(halves.y).x);
}

uvec2 pack_four_halves(vec4 v) { return uvec2(packHalf2x16(v.xy), packHalf2x16(v.zw)); }

vec4 unpack_four_halves(uvec2 halves) {
  return vec4(unpackHalf2x16(halves.x), unpackHalf2x16(halves.y));
}

#endif
