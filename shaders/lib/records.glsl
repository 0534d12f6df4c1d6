// The instances and materials of the scene, as a pass reads them, and which features it has.
#ifndef PREVIZ_RECORDS_GLSL
#define PREVIZ_RECORDS_GLSL

#include "shaders/lib/fetch.glsl"
#include "shaders/lib/render_shared.h"

layout(constant_id = 0) const uint FEATURES = 0xffffffffu;
bool has_feature(uint feature) { return (FEATURES & feature) != 0u; }

PREVIZ_FETCHED(uvec4, instances)  // INSTANCE_TEXELS a GpuInstance
PREVIZ_FETCHED(uvec4, materials)  // MATERIAL_TEXELS a GpuMaterial

const int INSTANCE_TEXELS = 8;
const int MATERIAL_TEXELS = 13;

// These fetch the fields that a pass uses, and no others.
GpuInstance instance_at(uint instance) {
  PREVIZ_FETCH_RECORD(instances, INSTANCE_TEXELS, instance, t, f)
  return GpuInstance(vec4[](f[0], f[1], f[2]), vec4[](f[3], f[4], f[5]), t[6].x, t[6].y, t[6].z, t[6].w, t[7].x,
                     t[7].y, t[7].z, t[7].w);
}

GpuMaterial material_at(uint material) {
  PREVIZ_FETCH_RECORD(materials, MATERIAL_TEXELS, material, t, f)
  return GpuMaterial(f[0].xyz, f[0].w, f[1].xyz, f[1].w, f[2].x, f[2].y, f[2].z, t[2].w, t[3].x, t[3].y,
                     t[3].z, t[3].w, f[4].x, t[4].y, f[4].z, f[4].w, t[5].x, f[5].yzw, f[6].x, f[6].y,
                     vec3(f[6].zw, f[7].x), f[7].y, vec3(f[7].zw, f[8].x), f[8].yz, t[8].w,
                     uint[](t[9].x, t[9].y, t[9].z, t[9].w, t[10].x, t[10].y, t[10].z, t[10].w, t[11].x),
                     uint[](t[11].y, t[11].z), f[11].w, t[12].x, uint[](t[12].y, t[12].z, t[12].w));
}

// Returns a material's texture of a layer (LAYER_*).
const int LAYER_TEXTURES_TEXEL = 9;
uint layer_texture(uint material, uint layer) {
  const int first = int(material) * MATERIAL_TEXELS + LAYER_TEXTURES_TEXEL;
  return fetch(materials, first + int(layer >> 2))[layer & 3u];
}

#endif
