// The scene as the shaders see it: its buffers, and how a hit becomes a surface.
#ifndef PREVIZ_SCENE_GLSL
#define PREVIZ_SCENE_GLSL

#include "shaders/lib/textures.glsl"

PREVIZ_FETCHED(vec4, vertices)    // 2 a vertex: position, u; normal, v (object space)
PREVIZ_FETCHED(uvec4, triangles)  // 1 a triangle: three indices into the vertices
PREVIZ_FETCHED(uvec2, extras)     // of GpuInstance: colours as four 16-bit fractions, and texture
                                  // coordinates as two floats
layout(scalar) uniform Frame { GpuFrame frame; };

const float PI = 3.14159265358979;

// A point of a surface that is seen from the direction `wo`. Normals are turned to the viewer's
// side.
struct Surface {
  vec3 position;
  float error;            // bound on the position's error along the geometric normal, metres
  vec3 geometric_normal;  // unit, dot(geometric_normal, wo) >= 0
  vec3 normal;            // unit, interpolated, on the side of the geometric normal
  vec3 clear_normal;      // as normal, of the coat of lacquer: see lacquer_normal()
  vec3 wo;                // unit, towards where the ray came from
  bool entering;          // the ray came from outside, where the winding is counter-clockwise
  vec3 base_color;
  float metallic;
  float alpha;            // GGX width, roughness^2
  float specular;
  float ior;
  float transmission;
  bool thin_walled;
  uint albedo_table;      // rough glass: its first table of ALBEDO
  vec3 emission;
  PREVIZ_LAYER_FACTORS(PREVIZ_FACTOR_MEMBER)
  float clearcoat_alpha;
  vec3 tangent;           // where is_anisotropic(): unit, across the normal
  float tangent_alpha;    // GGX width along the tangent; alpha is that across it
  float anisotropy_step;  // of the anisotropy's tables, counted from no strength at all; below 0: the only one
  uint medium;            // behind the surface, where that is a coloured solid (lib/medium.glsl)
};

vec3 transform_point(vec4 rows[3], vec3 p) {
  return vec3(dot(rows[0].xyz, p) + rows[0].w, dot(rows[1].xyz, p) + rows[1].w,
              dot(rows[2].xyz, p) + rows[2].w);
}
vec3 transform_vector(vec4 rows[3], vec3 v) {
  return vec3(dot(rows[0].xyz, v), dot(rows[1].xyz, v), dot(rows[2].xyz, v));
}
// Applies |rows| to a non-negative v, which bounds the summands of transform_vector().
vec3 transform_bound(vec4 rows[3], vec3 v) {
  return vec3(dot(abs(rows[0].xyz), v), dot(abs(rows[1].xyz), v), dot(abs(rows[2].xyz), v));
}
vec3 transform_translation(vec4 rows[3]) { return vec3(rows[0].w, rows[1].w, rows[2].w); }

// Transforms a normal, for which the transposed inverse is needed.
vec3 transform_normal(vec4 inverse_rows[3], vec3 n) {
  return inverse_rows[0].xyz * n.x + inverse_rows[1].xyz * n.y + inverse_rows[2].xyz * n.z;
}

// Returns a bound on the error of a hit point in world space, per axis. It covers rounding of the
// interpolation and of the transform (Pharr, Jakob, Humphreys, *Physically Based Rendering*,
// "Managing Rounding Error") and of the ray that was taken into object space for the test.
vec3 position_error(GpuInstance instance, vec3 object_bound, vec3 position) {
  const float gamma = 8.0 * 5.9604645e-8;
  const vec3 ray_bound = transform_bound(instance.object_from_world, abs(position)) +
                         abs(transform_translation(instance.object_from_world));
  return gamma * (transform_bound(instance.world_from_object, object_bound + ray_bound) +
                  abs(transform_translation(instance.world_from_object)));
}

// For slivers the bound below grows with their aspect only up to here. Beyond it the bound would
// reach over things that lie on the sliver: 12 cm on a road of 1 km x 4 m. A ray never meets the
// triangle that it leaves, so that the bound has to cover the triangles beside it only, and those
// only where the ray starts within rounding of a common edge.
const float MOST_ASPECT = 4.0;

// Returns a bound on the distance from a triangle's plane at which rounding in lib/trace.glsl may
// see the origin of a ray that starts on the plane. Distances are combined from those of the
// corners, so the error grows with the triangle's size, and with its aspect, as the error of the
// weights does.
float plane_error(GpuInstance instance, vec3 edge1, vec3 edge2) {
  const vec3 e1 = transform_vector(instance.world_from_object, edge1);
  const vec3 e2 = transform_vector(instance.world_from_object, edge2);
  const float size = max(length(e1), length(e2));
  if (size == 0.0) return 0.0;
  const float doubled_area = length(cross(e1 / size, e2 / size));  // over size^2
  return 8.0 * 5.9604645e-8 * size * clamp(1.0 / doubled_area, 1.0, MOST_ASPECT);
}

vec2 triangle_uv(vec4 p0, vec4 n0, vec4 p1, vec4 n1, vec4 p2, vec4 n2, vec3 b) {
  return vec2(p0.w, n0.w) * b.x + vec2(p1.w, n1.w) * b.y + vec2(p2.w, n2.w) * b.z;
}

struct Triangle {
  vec4 p0, p1, p2;  // position, u
  vec4 n0, n1, n2;  // normal, v
};

// Returns what a vertex of the instance has beside its place, its normal and its first texture
// coordinates.
uvec2 vertex_extra(GpuInstance instance, uint vertex, uint which) {
  return fetch(extras, int(instance.first_extra + vertex * instance.extras_per_vertex + which));
}

// Returns the factors of the base colour and of the alpha that the mesh states at a point of a triangle
// of these vertices.
vec4 vertex_color(GpuInstance instance, uvec3 vertices, vec3 b) {
  if (instance.extras_per_vertex == 0u) return vec4(1.0);
  vec4 color = vec4(0.0);
  for (int i = 0; i < 3; ++i) {
    const uvec2 bits = vertex_extra(instance, vertices[i], 0u);
    color += b[i] * vec4(unpackUnorm2x16(bits.x), unpackUnorm2x16(bits.y));
  }
  return color;
}

// Returns by which of the mesh's texture coordinates a material reads a texture (TEXTURE_OF_*).
uint mapping_of(uint material, uint role) {
  const GpuMaterial m = material_at(material);
  return ((role < 8u ? m.mappings[0] : m.mappings[1]) >> (4u * (role & 7u))) & 15u;
}

// Returns the triangle with the texture coordinates by which the material reads a texture.
Triangle mapped_triangle(Triangle t, GpuInstance instance, uvec3 vertices, uint role) {
  if (!has_feature(FEATURE_MAPPINGS)) return t;
  const uint mapping = mapping_of(instance.material, role);
  if (mapping == 0u || mapping >= instance.extras_per_vertex) return t;
  const vec2 uv0 = uintBitsToFloat(vertex_extra(instance, vertices.x, mapping));
  const vec2 uv1 = uintBitsToFloat(vertex_extra(instance, vertices.y, mapping));
  const vec2 uv2 = uintBitsToFloat(vertex_extra(instance, vertices.z, mapping));
  t.p0.w = uv0.x;
  t.n0.w = uv0.y;
  t.p1.w = uv1.x;
  t.n1.w = uv1.y;
  t.p2.w = uv2.x;
  t.n2.w = uv2.y;
  return t;
}

// A mapped normal that dips below the surface is lifted above it by this much.
const float LEAST_NORMAL_LIFT = 1e-3;

// Returns the tangent that the mesh states at a point of a triangle of these vertices (glTF 2.0,
// 3.7.2.1), in object space; 0 where it states none.
vec4 stated_tangent(GpuInstance instance, uvec3 vertices, vec3 b) {
  vec4 tangent = vec4(0.0);
  if (!has_feature(FEATURE_TANGENTS) || instance.tangent_extra == 0u) return tangent;
  for (int i = 0; i < 3; ++i) {
    const uvec2 bits = vertex_extra(instance, vertices[i], instance.tangent_extra);
    tangent += b[i] * vec4(unpackSnorm2x16(bits.x), unpackSnorm2x16(bits.y));
  }
  return tangent;
}

// Finds the directions of +X and +Y of a texture around a normal. They are the stated ones, or
// follow the triangle's own texture coordinates, as glTF prescribes where no tangents are given, but
// are not smoothed over the vertices. Returns false if the coordinates give no direction.
bool texture_frame(GpuInstance instance, Triangle t, vec4 stated, vec3 normal, out vec3 tangent,
                   out vec3 bitangent) {
  if (has_feature(FEATURE_TANGENTS)) {
    const vec3 given = transform_vector(instance.world_from_object, stated.xyz);
    const vec3 given_across = given - normal * dot(normal, given);
    const float given_squared = dot(given_across, given_across);
    if (given_squared > 0.0) {
      tangent = given_across * inversesqrt(given_squared);
      // A mirrored instance mirrors the cross product.
      const bool is_mirrored = dot(cross(instance.world_from_object[0].xyz,
                                         instance.world_from_object[1].xyz),
                                   instance.world_from_object[2].xyz) < 0.0;
      const vec3 upwards = cross(normal, tangent);
      bitangent = (stated.w < 0.0) != is_mirrored ? -upwards : upwards;
      return true;
    }
  }
  const vec2 along1 = vec2(t.p1.w, t.n1.w) - vec2(t.p0.w, t.n0.w);
  const vec2 along2 = vec2(t.p2.w, t.n2.w) - vec2(t.p0.w, t.n0.w);
  const vec3 edge1 = transform_vector(instance.world_from_object, t.p1.xyz - t.p0.xyz);
  const vec3 edge2 = transform_vector(instance.world_from_object, t.p2.xyz - t.p0.xyz);
  const float area = along1.x * along2.y - along2.x * along1.y;
  const float side = area < 0.0 ? -1.0 : 1.0;
  const vec3 along_u = side * (edge1 * along2.y - edge2 * along1.y);
  const vec3 along_v = side * (edge2 * along1.x - edge1 * along2.x);
  const vec3 across = along_u - normal * dot(normal, along_u);
  const float across_squared = dot(across, across);
  tangent = vec3(0.0);
  bitangent = vec3(0.0);
  if (area == 0.0 || !(across_squared > 0.0)) return false;
  tangent = across * inversesqrt(across_squared);
  const vec3 turned = cross(normal, tangent);
  // v runs down the texture, while +Y points up.
  bitangent = dot(turned, along_v) < 0.0 ? turned : -turned;
  return true;
}

// Applies a normal texture.
vec3 map_normal(GpuInstance instance, uint texture, float scale, Triangle t, vec4 stated, vec2 uv,
                vec3 normal, vec3 outward) {
  vec3 tangent, bitangent;
  if (!texture_frame(instance, t, stated, normal, tangent, bitangent)) return normal;
  vec3 mapped = sample_texture(texture, uv).xyz * 2.0 - 1.0;
  mapped.xy *= scale;
  mapped = tangent * mapped.x + bitangent * mapped.y + normal * mapped.z;
  const float mapped_squared = dot(mapped, mapped);
  if (!(mapped_squared > 0.0)) return normal;
  mapped *= inversesqrt(mapped_squared);
  mapped += outward * max(0.0, LEAST_NORMAL_LIFT - dot(mapped, outward));
  return normalize(mapped);
}

// Returns an orthonormal basis whose third vector is n (Duff et al. 2017, "Building an Orthonormal
// Basis, Revisited").
mat3 make_frame(vec3 n) {
  const float side = n.z >= 0.0 ? 1.0 : -1.0;
  const float a = -1.0 / (side + n.z);
  const float b = n.x * n.y * a;
  return mat3(vec3(1.0 + side * n.x * n.x * a, side * b, -side * n.x),
              vec3(b, side + n.y * n.y * a, -n.y), n);
}

// Returns the unit vector across the normal that is nearest to a direction; any if the direction is
// 0 or along the normal.
vec3 tangent_near(vec3 direction, vec3 normal) {
  const vec3 across = direction - normal * dot(normal, direction);
  const float across_squared = dot(across, across);
  return across_squared > 0.0 ? across * inversesqrt(across_squared) : make_frame(normal)[0];
}

vec2 hit_uv(uint instance, uint primitive, vec2 barycentrics) {
  const uvec3 index = fetch(triangles, int(instance_at(instance).first_triangle + primitive)).xyz;
  const vec3 b = vec3(1.0 - barycentrics.x - barycentrics.y, barycentrics);
  vec2 uv = vec2(0.0);
  for (int i = 0; i < 3; ++i)
    uv += b[i] * vec2(fetch(vertices, int(2u * index[i])).w,
                      fetch(vertices, int(2u * index[i]) + 1).w);
  return uv;
}

float vertex_alpha(uint instance, uint primitive, vec2 barycentrics) {
  const uvec3 index = fetch(triangles, int(instance_at(instance).first_triangle + primitive)).xyz;
  return vertex_color(instance_at(instance), index, vec3(1.0 - barycentrics.x - barycentrics.y, barycentrics)).a;
}

// Returns the share of a surface that is there, by the alpha of its material.
float coverage(uint instance, uint primitive, vec2 barycentrics) {
  const GpuMaterial m = material_at(instance_at(instance).material);
  if (m.alpha_mode == ALPHA_OPAQUE) return 1.0;
  float alpha = m.alpha;
  if (has_feature(FEATURE_TEXTURES) && m.base_color_texture != NO_INDEX)
    alpha *= sample_texture(m.base_color_texture, hit_uv(instance, primitive, barycentrics)).a;
  if (has_feature(FEATURE_VERTEX_COLORS)) alpha *= vertex_alpha(instance, primitive, barycentrics);
  return m.alpha_mode == ALPHA_MASK ? float(alpha >= m.alpha_cutoff) : clamp(alpha, 0.0, 1.0);
}

// Returns the area in uv of a triangle's footprint of this area in the world; 0 of a triangle that has
// none. Seen at a slant a footprint is as long as it would be at this cosine at most.
const float LEAST_FOOTPRINT_COSINE = 0.25;

float footprint_in_uv(GpuInstance instance, Triangle t, float cosine, float footprint) {
  const vec2 along1 = vec2(t.p1.w, t.n1.w) - vec2(t.p0.w, t.n0.w);
  const vec2 along2 = vec2(t.p2.w, t.n2.w) - vec2(t.p0.w, t.n0.w);
  const vec3 edge1 = transform_vector(instance.world_from_object, t.p1.xyz - t.p0.xyz);
  const vec3 edge2 = transform_vector(instance.world_from_object, t.p2.xyz - t.p0.xyz);
  const float area = length(cross(edge1, edge2)) * max(cosine, LEAST_FOOTPRINT_COSINE);
  const float in_uv = abs(along1.x * along2.y - along2.x * along1.y);
  return area > 0.0 ? footprint * in_uv / area : 0.0;
}

// Where a surface looks up its textures.
struct TexturePoint {
  GpuInstance instance;
  uvec3 vertices;
  Triangle triangle;
  vec3 b;           // weights of the vertices
  vec2 uv;          // by the first mapping
  float area;       // of the sample's footprint in uv, by the first mapping
  float footprint;  // in the world, across the ray
  float cosine;     // under which the triangle is seen
};

// Finds where the point is in a texture of its material (TEXTURE_OF_*), and in `area` its footprint
// there.
vec2 mapped_uv(TexturePoint at, uint role, out float area) {
  area = at.area;
  if (!has_feature(FEATURE_MAPPINGS)) return at.uv;
  const Triangle t = mapped_triangle(at.triangle, at.instance, at.vertices, role);
  if (has_feature(FEATURE_FILTERED_TEXTURES) && at.footprint > 0.0)
    area = footprint_in_uv(at.instance, t, at.cosine, at.footprint);
  return triangle_uv(t.p0, t.n0, t.p1, t.n1, t.p2, t.n2, at.b);
}

vec4 look_up(TexturePoint at, uint texture, uint role) {
  float area;
  const vec2 uv = mapped_uv(at, role, area);
  return sample_footprint(texture, uv, area);
}

// Looks up a texture of a layer (LAYER_*), which is never filtered.
vec4 look_up_layer(TexturePoint at, uint layer) {
  float area;
  const vec2 uv = mapped_uv(at, TEXTURE_OF_LAYERS + layer, area);
  const uint material = at.instance.material;
  return sample_texture(layer_texture(material, layer), uv);
}

// Returns whether the material has this texture (LAYER_*).
bool has_layer(uint material, uint layer) {
  return has_feature(FEATURE_LAYER_TEXTURES) && (material_at(material).layers & (1u << layer)) != 0u;
}

// Applies the textures that multiply a factor; the others give directions. There is one look-up for all
// of them, because it is long.
#define PREVIZ_LAYER_BIT(layer, factor, channels) | (1u << layer)
#define PREVIZ_APPLY_LAYER(layer, factor, channels) case layer: s.factor *= texel.channels; break;
void apply_layers(inout Surface s, uint material, TexturePoint at) {
  uint left = material_at(material).layers & (0u PREVIZ_LAYER_TEXTURES(PREVIZ_LAYER_BIT));
  for (; left != 0u; left &= left - 1u) {
    const uint layer = uint(findLSB(left));
    const vec4 texel = look_up_layer(at, layer);
    switch (layer) {
      PREVIZ_LAYER_TEXTURES(PREVIZ_APPLY_LAYER)
      default: break;
    }
  }
  s.sheen_roughness = max(s.sheen_roughness, LEAST_SHEEN_ROUGHNESS);
}

// Returns the direction of the material's anisotropy on the texture times its strength, and the step of
// the tables of that strength (Surface).
vec2 anisotropy_at(uint material, TexturePoint at, out float step) {
  const vec2 given = material_at(material).anisotropy;
  step = -1.0;
  if (all(equal(given, vec2(0.0))) || !has_layer(material, LAYER_ANISOTROPY)) return given;
  const vec3 texel = look_up_layer(at, LAYER_ANISOTROPY).rgb;
  if (material_at(material).anisotropy_steps > 0u)
    step = clamp(texel.b, 0.0, 1.0) * float(material_at(material).anisotropy_steps);
  vec2 along = texel.rg * 2.0 - 1.0;
  const float size = length(along);
  along = size > 0.0 ? along / size : vec2(1.0, 0.0);
  return texel.b * vec2(given.x * along.x - given.y * along.y, given.x * along.y + given.y * along.x);
}

// Returns the world's direction of an anisotropy around the interpolated normal; 0 where there is none.
vec3 anisotropic_direction(TexturePoint at, vec2 anisotropy, vec3 normal) {
  vec3 tangent, bitangent;
  const Triangle t = mapped_triangle(at.triangle, at.instance, at.vertices,
                                     TEXTURE_OF_LAYERS + LAYER_ANISOTROPY);
  if (all(equal(anisotropy, vec2(0.0))) ||
      !texture_frame(at.instance, t, stated_tangent(at.instance, at.vertices, at.b), normal, tangent,
                     bitangent))
    return vec3(0.0);
  return tangent * anisotropy.x + bitangent * anisotropy.y;
}

#define PREVIZ_READ_FACTOR(type, name, feature, otherwise) \
  s.name = has_feature(feature) ? m.name : otherwise;
void apply_material(inout Surface s, TexturePoint at, vec2 anisotropy) {
  const uint material = at.instance.material;
  const GpuMaterial m = material_at(material);
  s.base_color = m.base_color;
  s.metallic = m.metallic;
  float roughness = m.roughness;
  s.specular = m.specular;
  s.ior = m.ior;
  s.transmission = m.transmission;
  s.thin_walled = m.thin_walled != 0u;
  s.albedo_table = m.albedo_table;
  s.emission = m.emission;
  if (has_feature(FEATURE_VERTEX_COLORS))
    s.base_color *= vertex_color(at.instance, at.vertices, at.b).rgb;
  if (has_feature(FEATURE_TEXTURES)) {
    if (m.base_color_texture != NO_INDEX)
      s.base_color *= sample_footprint(m.base_color_texture, at.uv, at.area).rgb;
    if (m.metallic_roughness_texture != NO_INDEX) {
      const vec4 t = look_up(at, m.metallic_roughness_texture, TEXTURE_OF_METALLIC_ROUGHNESS);
      roughness *= t.g;
      s.metallic *= t.b;
    }
    if (m.emission_texture != NO_INDEX)
      s.emission *= look_up(at, m.emission_texture, TEXTURE_OF_EMISSION).rgb;
  }
  s.alpha = roughness * roughness;
  PREVIZ_LAYER_FACTORS(PREVIZ_READ_FACTOR)
  if (has_feature(FEATURE_LAYER_TEXTURES)) apply_layers(s, material, at);
  s.clearcoat_alpha = s.clearcoat_roughness * s.clearcoat_roughness;
  s.tangent_alpha = s.alpha;
  if (has_feature(FEATURE_ANISOTROPY) && any(notEqual(anisotropy, vec2(0.0)))) {
    s.tangent_alpha = mix(s.alpha, 1.0, dot(anisotropy, anisotropy));
    s.alpha = max(s.alpha, LEAST_ANISOTROPIC_ALPHA);
    s.tangent_alpha = max(s.tangent_alpha, s.alpha);
  }
  s.medium = 0u;
  if (has_feature(FEATURE_ATTENUATION) && any(greaterThan(m.attenuation, vec3(0.0))))
    s.medium = material + 1u;
}

bool is_anisotropic(Surface s) {
  return has_feature(FEATURE_ANISOTROPY) && s.tangent_alpha > s.alpha;
}

bool has_coat_color(Surface s) {
  return has_feature(FEATURE_COAT_COLOR) && any(notEqual(s.specular_color, vec3(1.0)));
}

bool has_sheen(Surface s) {
  return has_feature(FEATURE_SHEEN) && any(greaterThan(s.sheen_color, vec3(0.0)));
}

// Returns whether the surface has any reflecting or refracting lobe, rough or smooth. Sheen is
// none: it has no mirror direction.
bool is_specular(Surface s) {
  return s.metallic > 0.0 || s.transmission > 0.0 || (s.specular > 0.0 && s.ior > 1.0) ||
         (has_feature(FEATURE_CLEARCOAT) && s.clearcoat > 0.0);
}

// At the silhouette of a smooth mesh, or under a normal map, a mirror direction may dip below the
// surface, where its light would be lost. The normal is then turned until that direction grazes the
// surface. Its height above the surface, a cosine, is MIRROR_LIFT, or nine tenths of the viewer's
// if that is less.
const float MIRROR_LIFT = 0.01;

vec3 mirroring_normal(vec3 normal, vec3 geometric_normal, vec3 wo) {
  const float least = min(0.9 * dot(wo, geometric_normal), MIRROR_LIFT);
  const vec3 mirrored = 2.0 * dot(normal, wo) * normal - wo;
  const float height = dot(mirrored, geometric_normal);
  if (height >= least) return normal;
  const vec3 half_way = wo + normalize(mirrored + (least - height) * geometric_normal);
  const float length_squared = dot(half_way, half_way);
  return length_squared > 0.0 ? half_way * inversesqrt(length_squared) : geometric_normal;
}

// Applies a normal texture (TEXTURE_OF_*) as it lies on the triangle.
vec3 normal_at(TexturePoint at, uint texture, float scale, uint role, vec3 normal, vec3 outward) {
  const Triangle t = mapped_triangle(at.triangle, at.instance, at.vertices, role);
  return map_normal(at.instance, texture, scale, t, stated_tangent(at.instance, at.vertices, at.b),
                    triangle_uv(t.p0, t.n0, t.p1, t.n1, t.p2, t.n2, at.b), normal, outward);
}

// Lacquer does not follow the normal texture of what is below it: it has its own, or is as smooth as the
// mesh (KHR_materials_clearcoat).
bool has_clear_normal() { return has_feature(FEATURE_CLEARCOAT) && has_feature(FEATURE_NORMAL_MAPS); }

vec3 clear_normal_at(uint material, TexturePoint at, vec3 normal, vec3 outward) {
  if (!has_layer(material, LAYER_CLEARCOAT_NORMAL)) return normal;
  return normal_at(at, layer_texture(material, LAYER_CLEARCOAT_NORMAL),
                   material_at(material).clearcoat_normal_scale,
                   TEXTURE_OF_LAYERS + LAYER_CLEARCOAT_NORMAL, normal, outward);
}

// Returns the normal of the coat of lacquer.
vec3 lacquer_normal(Surface s) { return has_clear_normal() ? s.clear_normal : s.normal; }

// Makes the surface at a hit of a ray with this direction, for a sample whose footprint has this area
// across the ray (0: a point). The hit's barycentrics are the weights of the triangle's second and
// third vertex.
Surface make_surface(GpuHit hit, vec3 direction, float footprint) {
  const GpuInstance instance = instance_at(hit.instance);
  const uvec3 index = fetch(triangles, int(instance.first_triangle + hit.primitive)).xyz;
  const vec4 p0 = fetch(vertices, int(2u * index.x));
  const vec4 p1 = fetch(vertices, int(2u * index.y));
  const vec4 p2 = fetch(vertices, int(2u * index.z));
  const vec4 n0 = fetch(vertices, int(2u * index.x) + 1);
  const vec4 n1 = fetch(vertices, int(2u * index.y) + 1);
  const vec4 n2 = fetch(vertices, int(2u * index.z) + 1);
  const vec3 b = vec3(1.0 - hit.barycentrics.x - hit.barycentrics.y, hit.barycentrics);

  Surface s;
  s.wo = -direction;
  const vec3 object_position = p0.xyz * b.x + p1.xyz * b.y + p2.xyz * b.z;
  const vec3 object_bound = abs(p0.xyz) * b.x + abs(p1.xyz) * b.y + abs(p2.xyz) * b.z;
  s.position = transform_point(instance.world_from_object, object_position);
  const vec3 face = cross(p1.xyz - p0.xyz, p2.xyz - p0.xyz);
  // The face normal is scaled first, because its length is an area, which underflows for small
  // triangles.
  const float face_scale = max(max(abs(face.x), abs(face.y)), abs(face.z));
  // A mesh that deforms may collapse a triangle to a line, which faces whoever looks at it.
  const vec3 outward =
      face_scale > 0.0 ? normalize(transform_normal(instance.object_from_world, face / face_scale))
                       : s.wo;
  s.entering = dot(outward, s.wo) >= 0.0;
  s.geometric_normal = s.entering ? outward : -outward;
  const vec3 bound = position_error(instance, object_bound, s.position);
  s.error = 2.0 * dot(abs(s.geometric_normal), bound) +
            plane_error(instance, p1.xyz - p0.xyz, p2.xyz - p0.xyz);
  const vec3 smooth_normal = transform_normal(instance.object_from_world,
                                              n0.xyz * b.x + n1.xyz * b.y + n2.xyz * b.z);
  const float length_squared = dot(smooth_normal, smooth_normal);
  s.normal = length_squared > 0.0 ? smooth_normal * inversesqrt(length_squared) : outward;
  const uint material = instance.material;
  TexturePoint at;
  at.instance = instance;
  at.vertices = index;
  at.triangle = Triangle(p0, p1, p2, n0, n1, n2);
  at.b = b;
  at.uv = triangle_uv(p0, n0, p1, n1, p2, n2, b);
  at.cosine = dot(s.geometric_normal, s.wo);
  at.footprint = footprint;
  at.area = footprint;
  if (has_feature(FEATURE_FILTERED_TEXTURES) && footprint > 0.0)
    at.area = footprint_in_uv(instance, at.triangle, at.cosine, footprint);
  vec2 anisotropy = vec2(0.0);
  if (has_feature(FEATURE_ANISOTROPY)) {
    anisotropy = anisotropy_at(material, at, s.anisotropy_step);
    s.tangent = anisotropic_direction(at, anisotropy, s.normal);
  }
  if (has_clear_normal()) s.clear_normal = clear_normal_at(material, at, s.normal, outward);
  if (has_feature(FEATURE_NORMAL_MAPS) && material_at(material).normal_texture != NO_INDEX)
    s.normal = normal_at(at, material_at(material).normal_texture, material_at(material).normal_scale,
                         TEXTURE_OF_NORMAL, s.normal, outward);
  if (dot(s.normal, s.geometric_normal) < 0.0) s.normal = -s.normal;
  apply_material(s, at, anisotropy);
  if (is_specular(s)) s.normal = mirroring_normal(s.normal, s.geometric_normal, s.wo);
  if (has_clear_normal()) {
    if (dot(s.clear_normal, s.geometric_normal) < 0.0) s.clear_normal = -s.clear_normal;
    s.clear_normal = mirroring_normal(s.clear_normal, s.geometric_normal, s.wo);
  }
  if (is_anisotropic(s)) s.tangent = tangent_near(s.tangent, s.normal);
  return s;
}

// Returns the origin of a ray that leaves the surface towards `direction`, clear of the surface
// itself.
vec3 offset_origin(Surface s, vec3 direction) {
  const float side = dot(direction, s.geometric_normal) >= 0.0 ? s.error : -s.error;
  return s.position + s.geometric_normal * side;
}

#endif
