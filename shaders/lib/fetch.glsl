// Buffers that many invocations read at random: as texels on a CPU device, where Mesa's driver reads them
// 1.4 to 1.7 times as fast as storage; as storage on a graphics card, and where texels are few.
#ifndef PREVIZ_FETCH_GLSL
#define PREVIZ_FETCH_GLSL
#extension GL_EXT_samplerless_texture_functions : require

#include "shaders/lib/device.glsl"
#include "shaders/lib/halves.glsl"

bool reads_storage() { return (DEVICE & DEVICE_READS_STORAGE) != 0u; }

#define PREVIZ_TEXELS_float textureBuffer
#define PREVIZ_TEXELS_vec2 textureBuffer
#define PREVIZ_TEXELS_vec4 textureBuffer
#define PREVIZ_TEXELS_uint utextureBuffer
#define PREVIZ_TEXELS_uvec2 utextureBuffer
#define PREVIZ_TEXELS_uvec4 utextureBuffer

#define PREVIZ_FETCHED_AS(texels, type, name, stored, unpack)  \
  uniform texels name;                                         \
  readonly buffer Storage_##name { stored name##_storage[]; }; \
  type fetch_##name(int index) {                               \
    type element;                                              \
    if (reads_storage()) element = unpack(name##_storage[index]); \
    else element = type(texelFetch(name, index));              \
    return element;                                            \
  }

// Declare such a buffer, of elements of the type or of four half floats, which fetch(name, index) reads. A
// pass is given the buffer by its name: the block is another view of the same memory.
#define PREVIZ_FETCHED(type, name) PREVIZ_FETCHED_AS(PREVIZ_TEXELS_##type, type, name, type, type)
#define PREVIZ_FETCHED_HALVES(name) \
  PREVIZ_FETCHED_AS(textureBuffer, vec4, name, uvec2, unpack_four_halves)
#define fetch(name, index) fetch_##name(index)

// Declares the words of record `index` of such a buffer, of uvec4, as integers and as floats.
#define PREVIZ_FETCH_RECORD(name, texel_count, index, integers, floats)      \
  uvec4 integers[texel_count];                                               \
  vec4 floats[texel_count];                                                  \
  for (int texel = 0; texel < texel_count; ++texel) {                        \
    integers[texel] = fetch(name, int(index) * texel_count + texel);         \
    floats[texel] = uintBitsToFloat(integers[texel]);                        \
  }

// Declare a buffer that passes also write, as name[index]; read_name(index) reads what an earlier pass has
// written there.
#define PREVIZ_STATE(type, name)                            \
  uniform PREVIZ_TEXELS_##type name##_texels;               \
  layout(scalar) buffer State_##name { type name[]; };      \
  type read_##name(uint index) {                            \
    type element;                                           \
    if (reads_storage()) element = name[index];             \
    else element = type(texelFetch(name##_texels, int(index))); \
    return element;                                         \
  }

#endif
