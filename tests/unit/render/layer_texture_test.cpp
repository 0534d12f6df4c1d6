// Colours of vertices, textures that lie differently on a surface, and the textures that say where
// a surface is glass, lacquered, glossy, brushed or cloth: each by its channel (KHR_materials_*).
#include "shaders/lib/render_shared.h"
#include "tests/support/render_fixture.hpp"

namespace previz::test::layer_texture_test {

using scene::Material;

// A square seen from the side under a sky with a bright quarter.
View square(const Material& material) {
  View view = empty_view({0.6, -1.5, 1.2}, {0, 0, 0}, pinhole(32, 24, 0.3));
  add(view.scene, rectangle_mesh({1, 1}), material);
  view.environment = one_sided_sky();
  return view;
}

render::Sheet<glm::vec3> picture(const View& view) {
  return render_clean(view, 4, up_to_depth(2)).layers.mixed;
}

struct Layer {
  const char* name;
  std::uint32_t Material::*texture;
  std::vector<int> channels;  // that count
  Material (*with)(float);    // a material with this share of the factor
};

Material lacquered(float share) {
  Material m = plastic({0.2f, 0.3f, 0.7f}, 0.6f);
  m.clearcoat = share;
  m.clearcoat_roughness = 0.4f;
  return m;
}

const Layer all_layers[] = {
    {"transmission",
     &Material::transmission_texture,
     {0},
     [](float share) {
       Material m = glass(1.5f);
       m.roughness = 0.3f;
       m.transmission = share;
       return m;
     }},
    {"lacquer", &Material::clearcoat_texture, {0}, lacquered},
    {"roughness of lacquer",
     &Material::clearcoat_roughness_texture,
     {1},
     [](float share) {
       Material m = lacquered(1);
       m.clearcoat_roughness = 0.8f * share;
       return m;
     }},
    {"colour of sheen",
     &Material::sheen_color_texture,
     {0, 1, 2},
     [](float share) {
       Material m = diffuse({0.3f, 0.1f, 0.1f});
       m.sheen_color = glm::vec3(share);
       m.sheen_roughness = 0.5f;
       return m;
     }},
    {"roughness of sheen",
     &Material::sheen_roughness_texture,
     {3},
     [](float share) {
       Material m = diffuse({0.3f, 0.1f, 0.1f});
       m.sheen_color = glm::vec3(0.8f);
       m.sheen_roughness = share;
       return m;
     }},
    {"gloss",
     &Material::specular_texture,
     {3},
     [](float share) {
       Material m = plastic({0.1f, 0.1f, 0.1f}, 0.3f);
       m.specular = share;
       return m;
     }},
    {"colour of gloss",
     &Material::specular_color_texture,
     {0, 1, 2},
     [](float share) {
       Material m = plastic({0.1f, 0.1f, 0.1f}, 0.3f, 2);
       m.specular_color = glm::vec3(2 * share);
       return m;
     }},
};

// A half is exact in a texture, so that the textured factor is that of the plain material to the
// last bit; whatever the other channels hold.
TEST(LayerTextures, MultiplyTheirFactorByTheirChannels) {
  for (const Layer& layer : all_layers) {
    glm::vec4 value(0.125f);
    for (const int channel : layer.channels) value[channel] = 0.5f;
    View textured = square(layer.with(1));
    textured.scene.materials[0].*layer.texture = add_texture(textured.scene, texture_of(value));
    const auto shown = picture(textured);
    EXPECT_EQ(shown, picture(square(layer.with(0.5f)))) << layer.name;
    EXPECT_NE(shown, picture(square(layer.with(1)))) << layer.name;
  }
}

// Red and green give the direction, from -1 to 1, and blue the strength (KHR_materials_anisotropy):
// a half is no direction at all, which is taken as +X, and 0.5 + 0.5 (0, 1) a quarter turn. The
// tables of half the strength are those of the fourth step of eight.
TEST(LayerTextures, GiveAnAnisotropyItsDirectionAndStrength) {
  const auto brushed = [](float strength, double rotation_rad) {
    Material m = metal({0.9f, 0.7f, 0.4f}, 0.4f);
    m.anisotropy = strength;
    m.anisotropy_rotation_rad = static_cast<float>(rotation_rad);
    return m;
  };
  const auto expect_same = [&](const glm::vec4& value, const Material& expected) {
    View textured = square(brushed(0.8f, 0.25));
    textured.scene.materials[0].anisotropy_texture = add_texture(textured.scene, texture_of(value));
    const auto a = picture(textured), b = picture(square(expected));
    // The turn is a product of floats in place of one cosine: a few last places.
    for (std::size_t i = 0; i < a.size(); ++i)
      ASSERT_LT(glm::length(a[i] - b[i]), 1e-4f * glm::length(b[i])) << i;
  };
  expect_same({1, 0.5f, 1, 0}, brushed(0.8f, 0.25));
  expect_same({0.5f, 1, 1, 0}, brushed(0.8f, 0.25 + std::numbers::pi / 2));
  expect_same({0.5f, 0.5f, 1, 0}, brushed(0.8f, 0.25));
  expect_same({1, 0.5f, 0.5f, 0}, brushed(0.4f, 0.25));
}

// A texel whose normal is that of the mesh: (0, 0, 1) is stored as (0.5, 0.5, 1).
TEST(LayerTextures, LacquerHasItsOwnNormals) {
  const Material plain = lacquered(1);
  View bumpy = square(plain);
  const glm::vec4 tilted(0.75f, 0.5f, 0.9375f, 1);
  bumpy.scene.materials[0].clearcoat_normal_texture = add_texture(bumpy.scene, texture_of(tilted));
  EXPECT_NE(picture(bumpy), picture(square(plain)));
  View flat = square(plain);
  flat.scene.materials[0].clearcoat_normal_texture =
      add_texture(flat.scene, texture_of({0.5f, 0.5f, 1, 1}));
  EXPECT_EQ(picture(flat), picture(square(plain)));
  // Where nothing but lacquer reflects, bumps below it change nothing.
  Material lacquer = lacquered(1);
  lacquer.base_color = glm::vec3(0);
  lacquer.specular = 0;
  View below = square(lacquer);
  below.scene.materials[0].normal_texture = add_texture(below.scene, texture_of(tilted));
  EXPECT_EQ(picture(below), picture(square(lacquer)));
}

// Under an even sky a matt surface shows its albedo, every path alike.
TEST(VertexColors, MultiplyTheBaseColourBetweenTheVertices) {
  View view = square(diffuse({0.8f, 0.6f, 0.4f}));
  view.environment = uniform_environment(glm::vec3(1));
  view.world_from_camera = look_at({0, 0, 2}, {0, 0, 0});
  scene::Mesh& mesh = view.scene.meshes[0];
  // Red rises along X from 0 to 1, green falls along Y; a linear function, whichever the triangles.
  for (const glm::vec3& p : mesh.positions)
    mesh.colors.emplace_back(p.x + 0.5f, 0.5f - p.y, 0.5f, 1.0f);
  const auto shown = render_clean(view, 16, up_to_depth(2), set::LightSampling::bsdf).layers.mixed;
  const PinholeIntrinsics& k = view.calibration.intrinsics;
  for (const auto& [x, y, i] : pixels_of(k.width, k.height)) {
    // The middle of the pixel on the square, 2 m away; the camera's up is +Y.
    const double at_x = 2 * (x - k.cx) / k.fx, at_y = -2 * (y - k.cy) / k.fy;
    const double half_pixel = 1 / k.fx;  // 2 m times half a pixel; samples lie within
    EXPECT_NEAR(shown[i].r, 0.8 * (at_x + 0.5), 0.8 * half_pixel);
    EXPECT_NEAR(shown[i].g, 0.6 * (0.5 - at_y), 0.6 * half_pixel);
    EXPECT_NEAR(shown[i].b, 0.4 * 0.5, 1e-4);
  }
}

TEST(VertexColors, OfAnAlphaLetLightThrough) {
  constexpr float veil_alpha = 0.25f;
  View view = lit_point(0.6);
  Material veil = emitter(glm::vec3(0));
  veil.alpha_mode = scene::AlphaMode::blend;
  scene::Mesh mesh = rectangle_mesh({0.2, 0.2});
  mesh.colors.assign(mesh.positions.size(), glm::vec4(1, 1, 1, veil_alpha));
  add(view.scene, mesh, veil, at({0, 0, 1}));
  view.scene.lights.push_back(lamp(set::LightType::directional));
  const render::Layers layers = render_clean(view, 1, up_to_depth(1)).layers;
  // Colours are fractions of 16 bits: 0.25 is off by 1 / 131070 at most.
  EXPECT_NEAR(mean(layers.mixed).g, 0.6 / std::numbers::pi * (1 - veil_alpha), 1e-5);
}

// The base colour by the first coordinates, the roughness by others: as if its texture were turned.
TEST(TextureMappings, ReadEachTextureByItsOwn) {
  Material material = metal({0.9f, 0.7f, 0.4f}, 1);
  scene::Texture stripes = texture_of(1, 2, {{1, 0.25f, 1, 1}, {1, 0.75f, 1, 1}});
  stripes.nearest = true;
  scene::Texture turned = stripes;
  std::swap(turned.width, turned.height);
  View by_other = square(material), as_turned = square(material);
  scene::Mesh& mesh = by_other.scene.meshes[0];
  mesh.more_uvs.resize(1);
  for (const glm::vec2& uv : mesh.uvs) mesh.more_uvs[0].emplace_back(uv.y, uv.x);
  by_other.scene.materials[0].metallic_roughness_texture = add_texture(by_other.scene, stripes);
  by_other.scene.materials[0].mappings[gpu::TEXTURE_OF_METALLIC_ROUGHNESS] = 1;
  as_turned.scene.materials[0].metallic_roughness_texture = add_texture(as_turned.scene, turned);
  EXPECT_EQ(picture(by_other), picture(as_turned));
  by_other.scene.materials[0].mappings = {};
  EXPECT_NE(picture(by_other), picture(as_turned));
}

void expect_alike(const View& a, const View& b) {
  const auto shown = picture(a), expected = picture(b);
  // Triangles and turns that are rounded otherwise: a few last places.
  for (std::size_t i = 0; i < shown.size(); ++i)
    ASSERT_LT(glm::length(shown[i] - expected[i]), 1e-4f * glm::length(expected[i])) << i;
}

// A square whose bumps lean to these directions of the texture, or a plain one with these tangents.
View bumpy(float along_x, float along_y, const std::optional<glm::vec4>& tangent = {}) {
  Material metallic = metal({0.9f, 0.7f, 0.4f}, 0.4f);
  View view = square(metallic);
  view.scene.materials[0].normal_texture =
      add_texture(view.scene, texture_of({0.5f + along_x, 0.5f + along_y, 0.9375f, 1}));
  if (tangent)
    view.scene.meshes[0].tangents.assign(view.scene.meshes[0].positions.size(), *tangent);
  return view;
}

// glTF 2.0, 3.7.2.1: +X is the tangent, and +Y is cross(normal, tangent) times w.
TEST(Tangents, SayWhichWayBumpsLie) {
  const glm::vec4 plain(1, 0, 0, 1);
  const auto expected = picture(bumpy(0.125f, 0.0625f, plain));
  EXPECT_EQ(picture(bumpy(-0.125f, 0.0625f, glm::vec4(-1, 0, 0, -1))), expected);
  EXPECT_EQ(picture(bumpy(0.125f, -0.0625f, glm::vec4(1, 0, 0, -1))), expected);
  EXPECT_EQ(picture(bumpy(0.0625f, -0.125f, glm::vec4(0, 1, 0, 1))), expected);
  EXPECT_NE(picture(bumpy(-0.125f, 0.0625f, plain)), expected);
  EXPECT_EQ(picture(bumpy(0.125f, 0, plain)), picture(bumpy(0.125f, 0)));
  // No direction at all: that of the coordinates.
  EXPECT_EQ(picture(bumpy(0.125f, 0, glm::vec4(0))), picture(bumpy(0.125f, 0)));
}

// The mirror image of bumps that lean to +x leans to -x, and +Y stays.
TEST(Tangents, AreMirroredWithTheirInstance) {
  View mirrored = bumpy(0.125f, 0.0625f, glm::vec4(1, 0, 0, 1));
  mirrored.scene.instances[0].world_from_object[0][0] = -1;
  expect_alike(mirrored, bumpy(-0.125f, 0.0625f, glm::vec4(1, 0, 0, 1)));
}

TEST(Tangents, SayWhichWayBrushedMetalLies) {
  Material m = metal({0.9f, 0.7f, 0.4f}, 0.4f);
  m.anisotropy = 0.8f;
  View turned = square(m);
  turned.scene.meshes[0].tangents.assign(turned.scene.meshes[0].positions.size(), {0, 1, 0, 1});
  EXPECT_NE(picture(turned), picture(square(m)));
  m.anisotropy_rotation_rad = std::numbers::pi_v<float> / 2;
  expect_alike(turned, square(m));
}

}  // namespace previz::test::layer_texture_test
