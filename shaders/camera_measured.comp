// Turns the plate into the radiance that the camera measured (shaders/README.md, "Camera radiance").
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/batch.glsl"
#include "shaders/lib/plate.glsl"
#include "shaders/lib/scene.glsl"

// The linear radiance of each code, by the response and this frame's exposure.
layout(scalar) readonly buffer RadianceOf { float radiance_of[]; };
// The fourth component is 0 where a channel is clipped, and otherwise 1 (camera_usable.comp).
layout(scalar) writeonly buffer PlateBuffer { vec4 plate[]; };

void main() {
  if (gl_GlobalInvocationID.x >= batch.width * batch.height) return;
  const uint index = batch.y * frame.width + gl_GlobalInvocationID.x;
  const uvec3 codes = plate_codes(index);
  const bool clipped = frame.clip_from != NO_INDEX && any(greaterThanEqual(codes, uvec3(frame.clip_from)));
  plate[index] = vec4(radiance_of[codes.r], radiance_of[codes.g], radiance_of[codes.b],
                      clipped ? 0.0 : 1.0);
}
