// The GPU renderer against the independent CPU tracer on every kind of material: rough and smooth
// glass, panes, lacquer, cloth, brushed metal, and the textures that say where they are.
#include "tests/truth/two_tracers.hpp"

namespace previz::test::material_agreement_test {

using scene::Material, scene::world_both, scene::world_mixed, scene::world_real;

// Patches of normals up to half a radian off.
scene::Texture bumps() {
  scene::Texture texture = texture_of(8, 8);
  for (int i = 0; i < 64; ++i) {
    const double angle = 2.4 * i;
    const glm::dvec3 n =
        glm::normalize(glm::dvec3(0.5 * glm::dvec2(std::cos(angle), std::sin(angle)), 1));
    texture.texels.emplace_back(glm::vec3(0.5 * n + 0.5), 1.0f);
  }
  return texture;
}

scene::Texture holes() {
  scene::Texture texture = texture_of(4, 4);
  texture.nearest = true;
  for (int i = 0; i < 16; ++i)
    texture.texels.emplace_back(glm::vec3(1), (i + i / 4) % 2 == 0 ? 1.0f : 0.0f);
  return texture;
}

// Returns a function that puts a mesh of a material somewhere into the scene.
auto adder_to(scene::Scene& scene) {
  return [&scene](const scene::Mesh& mesh, const Material& material, const glm::dvec3& place,
                  std::uint32_t presence) { add(scene, mesh, material, at(place), presence); };
}

// Rough glass, solid and as a pane, white rough metal, normal maps on plastic and metal, a veil and
// a glowing fence with holes; on a table in both worlds, under an environment with a bright side.
View rough_materials() {
  View view = empty_view({0.6, -2, 1.2}, {0, 0, 0.15}, pinhole(64, 48, 0.8));
  scene::Scene& scene = view.scene;
  const auto add = adder_to(scene);
  Material ball = glass(1.5f);
  ball.roughness = 0.4f;
  ball.base_color = {0.9f, 0.8f, 0.6f};
  Material pane = ball;
  pane.thin_walled = true;
  pane.roughness = 0.25f;
  Material bumpy = plastic({0.2f, 0.5f, 0.7f}, 0.3f);
  bumpy.normal_texture = add_texture(scene, bumps());
  Material hammered = metal({0.9f, 0.7f, 0.4f}, 0.5f);
  hammered.normal_texture = bumpy.normal_texture;
  hammered.normal_scale = 0.7f;
  add(rectangle_mesh({3, 3}), diffuse({0.6f, 0.5f, 0.4f}), {0, 0, 0}, world_both);
  add(box_mesh({0.3, 0.3, 0.3}), bumpy, {-0.5, 0.2, 0.15}, world_both);
  add(uv_sphere_mesh(0.25, 48, 24), ball, {-0.1, -0.3, 0.25}, world_mixed);
  add(uv_sphere_mesh(0.2, 48, 24), metal(glm::vec3(1), 0.8f), {0.4, 0.3, 0.2}, world_mixed);
  add(box_mesh({0.25, 0.25, 0.25}), hammered, {0.5, -0.3, 0.125}, world_real);
  add(box_mesh({0.6, 0.004, 0.5}), pane, {0.1, 0.6, 0.3}, world_mixed);
  Material veil = diffuse({0.8f, 0.3f, 0.3f});
  veil.alpha_mode = scene::AlphaMode::blend;
  veil.alpha = 0.4f;
  Material fence = emitter({1.5f, 1.2f, 0.4f});
  fence.alpha_mode = scene::AlphaMode::mask;
  fence.base_color_texture = add_texture(scene, holes());
  add(box_mesh({0.4, 0.002, 0.3}), veil, {0.6, -0.7, 0.2}, world_mixed);
  add(box_mesh({0.3, 0.002, 0.3}), fence, {-0.7, -0.4, 0.2}, world_both);
  view.environment = one_sided_sky();
  return view;
}

// Panes of both worlds and of one: a clear and a stained one between lamps and the table, one with
// a matt share, one bent round a lamp, and a mirror and a solid ball that show them; lamps of every
// extent, one of them a mesh, in front of the panes and behind.
View panes() {
  View view = empty_view({0.6, -2, 1.2}, {0, 0, 0.15}, pinhole(48, 32, 0.8));
  scene::Scene& scene = view.scene;
  const auto add = adder_to(scene);
  Material dusty = pane({0.9f, 0.8f, 0.7f});
  dusty.transmission = 0.6f;
  dusty.specular = 0;
  add(rectangle_mesh({3, 3}), diffuse({0.6f, 0.5f, 0.4f}), {0, 0, 0}, world_both);
  add(rectangle_mesh({0.9, 0.9}), pane(), {-0.5, 0, 0.5}, world_both);
  add(rectangle_mesh({0.7, 0.7}), pane({0.9f, 0.5f, 0.1f}), {0.5, 0.1, 0.4}, world_mixed);
  add(box_mesh({0.5, 0.05, 0.4}), dusty, {0, 0.6, 0.25}, world_real);
  add(uv_sphere_mesh(0.15, 32, 16), pane({0.5f, 0.9f, 0.9f}), {0.1, -0.6, 0.3}, world_mixed);
  add(uv_sphere_mesh(0.15, 32, 16), metal(glm::vec3(0.9f), 0.3f), {-0.5, -0.4, 0.15}, world_mixed);
  add(rectangle_mesh({0.3, 0.3}), emitter({4, 3, 2}), {-0.4, 0.3, 0.9}, world_both);
  scene.lights.push_back(sphere_lamp({0.1, -0.6, 0.3}, 0.08, glm::dvec3(8, 6, 4)));
  set::Light panel = panel_lamp({0.6, 0.2, 1}, {0.4, 0.4}, glm::dvec3(3, 4, 5));
  panel.gain_mixed = 0.6;
  panel.tint = {1, 0.7, 0.5};
  scene.lights.push_back(panel);
  view.environment = one_sided_sky();
  return view;
}

TEST(Panes, AgreeWithTheCpuTracer) {
  expect_agreement(panes(), 16, true);
}

TEST(Panes, HaveTheSameDifferenceByBothEstimators) {
  expect_same_difference(panes(), 16, true);
}

TEST(RoughMaterials, AgreeWithTheCpuTracer) {
  expect_agreement(rough_materials(), 32, true);
}

// A coloured ball with a matt cube and a glowing one inside, a rough coloured box, and a coloured
// block in both worlds that a lamp with a size stands in; lacquer on metal and, rough, on paint.
View glass_and_lacquer() {
  View view = empty_view({0.4, -2, 1.1}, {0, 0, 0.2}, pinhole(48, 32, 0.7));
  scene::Scene& scene = view.scene;
  const auto add = adder_to(scene);
  Material jelly = glass(1.3f);
  jelly.attenuation_color = {0.8f, 0.2f, 0.3f};
  jelly.attenuation_distance_m = 0.2f;
  jelly.clearcoat = 0.8f;
  Material frosted = glass(1.5f);
  frosted.roughness = 0.5f;
  frosted.attenuation_color = {0.2f, 0.6f, 0.9f};
  frosted.attenuation_distance_m = 0.15f;
  Material block = glass(1.0f);
  block.attenuation_color = {0.3f, 0.9f, 0.2f};
  block.attenuation_distance_m = 0.3f;
  add(rectangle_mesh({3, 3}), diffuse({0.6f, 0.5f, 0.4f}), {0, 0, 0}, world_both);
  add(uv_sphere_mesh(0.3, 48, 24), jelly, {-0.3, -0.2, 0.32}, world_mixed);
  add(box_mesh({0.15, 0.15, 0.15}), diffuse({0.9f, 0.9f, 0.8f}), {-0.35, -0.2, 0.3}, world_mixed);
  add(box_mesh({0.08, 0.08, 0.08}), emitter({3, 3, 2}), {-0.2, -0.25, 0.42}, world_mixed);
  add(box_mesh({0.3, 0.3, 0.4}), frosted, {0.35, -0.3, 0.22}, world_mixed);
  add(box_mesh({0.4, 0.3, 0.5}), block, {0.1, 0.4, 0.27}, world_both);
  Material car = metal({0.6f, 0.1f, 0.1f}, 0.5f);
  car.clearcoat = 1;
  Material toy = plastic({0.2f, 0.3f, 0.7f}, 0.6f);
  toy.clearcoat = 0.7f;
  toy.clearcoat_roughness = 0.3f;
  add(uv_sphere_mesh(0.2, 48, 24), car, {0.75, 0.1, 0.22}, world_mixed);
  add(box_mesh({0.25, 0.25, 0.25}), toy, {-0.75, 0.2, 0.14}, world_both);
  scene.lights = {sphere_lamp({0.1, 0.4, 0.3}, 0.08, {8, 7, 6})};
  view.environment = uniform_environment(glm::vec3(0.3f, 0.4f, 0.5f), 8);
  return view;
}

TEST(GlassAndLacquer, AgreeWithTheCpuTracer) {
  expect_agreement(glass_and_lacquer(), 16, true);
}

TEST(GlassAndLacquer, HaveTheSameDifferenceByBothEstimators) {
  expect_same_difference(glass_and_lacquer(), 16, true);
}

// Sheen above paint, a mirror, solid and rough glass, a pane and below lacquer; brushed metal and
// brushed plastic with bumps, also where no texture coordinates say which way; coloured gloss.
View cloth_and_brushed_metal() {
  View view = empty_view({0.4, -2, 1.0}, {0, 0, 0.15}, pinhole(48, 32, 0.8));
  scene::Scene& scene = view.scene;
  const auto add = adder_to(scene);
  const auto under_sheen = [](Material material, const glm::vec3& color, float roughness) {
    material.sheen_color = color;
    material.sheen_roughness = roughness;
    return material;
  };
  const auto brushed = [](Material material, float strength, float rotation) {
    material.anisotropy = strength;
    material.anisotropy_rotation_rad = rotation;
    return material;
  };
  const glm::vec3 white(1);
  add(rectangle_mesh({3, 3}), under_sheen(diffuse({0.5f, 0.4f, 0.3f}), {0.3f, 0.5f, 0.9f}, 0.5f),
      {0, 0, 0}, world_both);
  add(uv_sphere_mesh(0.2, 48, 24), brushed(metal({0.9f, 0.7f, 0.4f}, 0.3f), 0.7f, 0.5f),
      {-0.6, -0.2, 0.2}, world_mixed);
  add(icosphere_mesh(0.15, 3), brushed(metal(white, 0.4f), 0.8f, 0), {-0.2, 0.5, 0.15}, world_both);
  Material bumpy = brushed(plastic({0.2f, 0.5f, 0.7f}, 0.4f), 0.9f, -1);
  bumpy.normal_texture = add_texture(scene, bumps());
  add(box_mesh({0.3, 0.3, 0.3}), bumpy, {0.7, 0.3, 0.15}, world_both);
  add(uv_sphere_mesh(0.2, 48, 24), under_sheen(metal(white, 0), {0.7f, 0.7f, 0.2f}, 0.3f),
      {0.3, -0.2, 0.2}, world_mixed);
  add(uv_sphere_mesh(0.15, 48, 24), under_sheen(glass(1.4f), {0.9f, 0.5f, 0.5f}, 0.8f),
      {-0.1, -0.6, 0.15}, world_mixed);
  Material frosted = glass(1.5f);
  frosted.roughness = 0.5f;
  add(box_mesh({0.25, 0.25, 0.25}), under_sheen(frosted, white, 0.4f), {0.7, -0.4, 0.13},
      world_mixed);
  add(box_mesh({0.5, 0.004, 0.4}), under_sheen(pane({0.9f, 0.8f, 0.7f}), {0.8f, 0.8f, 0.8f}, 0.6f),
      {0.3, 0.7, 0.2}, world_real);
  Material seat = under_sheen(plastic({0.6f, 0.1f, 0.1f}, 0.5f), {0.9f, 0.9f, 0.6f}, 0.7f);
  seat.clearcoat = 0.6f;
  seat.clearcoat_roughness = 0.4f;
  add(box_mesh({0.3, 0.2, 0.2}), seat, {-0.8, 0.4, 0.1}, world_both);
  Material gloss = plastic({0.05f, 0.05f, 0.05f}, 0.3f, 2.0f);
  gloss.specular_color = {1.5f, 0.3f, 0.1f};
  add(uv_sphere_mesh(0.12, 48, 24), gloss, {0.2, 0.3, 0.12}, world_mixed);
  scene.lights = {sphere_lamp({-0.5, -0.8, 1.2}, 0.25, {6, 5, 4})};
  view.environment = one_sided_sky();
  return view;
}

TEST(ClothAndBrushedMetal, AgreeWithTheCpuTracer) {
  expect_agreement(cloth_and_brushed_metal(), 16, true);
}

TEST(ClothAndBrushedMetal, HaveTheSameDifferenceByBothEstimators) {
  expect_same_difference(cloth_and_brushed_metal(), 16, true);
}

// Patches of every channel from 0 to 1, of which no two beside each other are alike.
scene::Texture patches(float least) {
  scene::Texture texture = texture_of(5, 5);
  texture.nearest = true;
  for (int i = 0; i < 25; ++i) {
    glm::vec4 texel;
    for (int c = 0; c < 4; ++c)
      texel[c] = least + (1 - least) * static_cast<float>((7 * i + 5 * c) % 11) / 10;
    texture.texels.push_back(texel);
  }
  return texture;
}

// Gives a mesh other texture coordinates, turned and of another scale, and a colour in each corner.
scene::Mesh painted(scene::Mesh mesh) {
  std::vector<glm::vec2> turned;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    turned.emplace_back(2.5f * mesh.uvs[i].y + 0.3f, 1 - 1.5f * mesh.uvs[i].x);
    const auto k = static_cast<float>(i % 7) / 6;
    mesh.colors.emplace_back(1 - 0.7f * k, 0.3f + 0.7f * k, 0.6f, 1 - 0.6f * k);
  }
  mesh.more_uvs = {std::move(turned)};
  return mesh;
}

// A texture for each factor that an extension has, each in turn by the mesh's first coordinates or
// by others: glass with opaque patches, lacquer with bumps of its own above bumps and with bare
// patches, cloth, coloured gloss, metal brushed in many directions; paint and a veil that have
// their colours and their alpha from the mesh, and a lamp that glows in a pattern.
View patchwork() {
  View view = empty_view({0.3, -2, 1.1}, {0, 0, 0.15}, pinhole(64, 48, 0.8));
  scene::Scene& scene = view.scene;
  const auto add = adder_to(scene);
  const std::uint32_t any = add_texture(scene, patches(0)),
                      some = add_texture(scene, patches(0.3f));
  const std::uint32_t dents = add_texture(scene, bumps());
  const auto textured = [&](Material material, std::uint32_t Material::*texture,
                            std::uint32_t which, std::uint8_t mapping = 0) {
    material.*texture = which;
    const auto role = std::ranges::find(scene::material_textures, texture);
    material.mappings[static_cast<std::size_t>(role - scene::material_textures.begin())] = mapping;
    return material;
  };
  const auto ball = [](double radius) { return painted(uv_sphere_mesh(radius, 48, 24)); };
  const auto cube = [](double side) { return painted(box_mesh(glm::dvec3(side))); };
  add(painted(rectangle_mesh({3, 3})), diffuse({0.6f, 0.5f, 0.4f}), {0, 0, 0}, world_both);
  add(ball(0.2), textured(glass(1.5f), &Material::transmission_texture, any, 1), {-0.7, -0.3, 0.21},
      world_mixed);
  add(painted(box_mesh({0.4, 0.004, 0.4})), textured(pane(), &Material::transmission_texture, any),
      {0, 0.7, 0.2}, world_both);
  Material car = textured(metal({0.6f, 0.2f, 0.1f}, 0.5f), &Material::normal_texture, dents);
  car.clearcoat = 1;
  car = textured(car, &Material::clearcoat_texture, any);
  add(ball(0.2), textured(car, &Material::clearcoat_normal_texture, dents, 1), {-0.2, -0.2, 0.2},
      world_mixed);
  Material toy = textured(plastic({0.2f, 0.3f, 0.7f}, 0.6f), &Material::normal_texture, dents, 1);
  toy.clearcoat = 0.9f;
  toy.clearcoat_roughness = 0.6f;
  add(cube(0.25), textured(toy, &Material::clearcoat_roughness_texture, some, 1),
      {-0.6, 0.4, 0.125}, world_both);
  Material cloth = diffuse({0.3f, 0.1f, 0.1f});
  cloth.sheen_color = {0.9f, 0.8f, 0.5f};
  cloth.sheen_roughness = 0.8f;
  cloth = textured(cloth, &Material::sheen_color_texture, any);
  add(cube(0.2), textured(cloth, &Material::sheen_roughness_texture, some, 1), {0.3, -0.5, 0.1},
      world_mixed);
  Material gloss = plastic({0.05f, 0.05f, 0.05f}, 0.3f, 2.0f);
  gloss.specular_color = {1.5f, 0.9f, 0.6f};
  gloss = textured(gloss, &Material::specular_texture, any, 1);
  add(ball(0.15), textured(gloss, &Material::specular_color_texture, any), {0.6, 0.3, 0.15},
      world_both);
  Material brushed = metal({0.9f, 0.7f, 0.4f}, 0.3f);
  brushed.anisotropy = 0.9f;
  brushed.anisotropy_rotation_rad = 0.5f;
  add(ball(0.2), textured(brushed, &Material::anisotropy_texture, any, 1), {0.25, 0.1, 0.2},
      world_mixed);
  Material veil = diffuse({0.9f, 0.8f, 0.7f});
  veil.alpha_mode = scene::AlphaMode::blend;
  add(painted(box_mesh({0.3, 0.002, 0.3})), veil, {0.7, -0.4, 0.2}, world_mixed);
  Material sign = textured(emitter({3, 2, 1}), &Material::emission_texture, any, 1);
  sign.alpha_mode = scene::AlphaMode::blend;
  add(painted(box_mesh({0.3, 0.02, 0.2})), sign, {0.5, 0.7, 0.3}, world_both);
  view.environment = one_sided_sky();
  return view;
}

TEST(Patchwork, AgreesWithTheCpuTracer) {
  expect_agreement(patchwork(), 16, true);
}

TEST(Patchwork, HasTheSameDifferenceByBothEstimators) {
  expect_same_difference(patchwork(), 16, true);
}

// The same bumps and brushed metal where the meshes state tangents that turn from vertex to vertex,
// one of them in a mirrored instance.
View turned_tangents() {
  View view = cloth_and_brushed_metal();
  for (scene::Mesh& mesh : view.scene.meshes)
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
      const glm::vec3 p = 5.0f * mesh.positions[i];
      mesh.tangents.emplace_back(glm::normalize(glm::vec3(std::cos(p.x), std::sin(p.y), 0.5f)),
                                 mesh.positions[0].x < 0 ? 1 : -1);
    }
  for (scene::Instance& instance : view.scene.instances)
    if (scene::has_directions(view.scene.materials[instance.material]))
      instance.world_from_object[0] *= -1;
  return view;
}

TEST(Tangents, AgreeWithTheCpuTracer) {
  expect_agreement(turned_tangents(), 16, true);
}

}  // namespace previz::test::material_agreement_test
