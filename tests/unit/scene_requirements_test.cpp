#include <gtest/gtest.h>

#include "tests/support/scenes.hpp"

namespace previz::test {
namespace scene_requirements_test {

class SceneRequirements : public ::testing::Test {
 protected:
  void add(const scene::Material& material, std::uint32_t presence = scene::world_both) {
    add_instance(scene, mesh, add_material(scene, material), glm::dmat4(1.0), presence);
  }
  scene::Requirements required() const { return requirements(scene, set); }

  scene::Scene scene;
  set::Set set;
  std::uint32_t mesh = add_mesh(scene, box_mesh({1, 1, 1}));
};

TEST_F(SceneRequirements, ADiffuseRealSceneNeedsNothing) {
  add(diffuse({0.5f, 0.5f, 0.5f}));
  add_material(scene, glass(1.5f));  // on no instance
  add_mesh(scene, box_mesh({2, 2, 2}));
  const scene::Requirements r = required();
  EXPECT_FALSE(r.transmission || r.metals || r.rough_specular || r.textures || r.alpha ||
               r.emissive_meshes || r.lights || r.caustics || r.differing_objects ||
               r.removed_objects || r.thin_lens);
  EXPECT_EQ(r.triangles, 12u);
  EXPECT_EQ(r.instanced_triangles, 12u);
}

TEST_F(SceneRequirements, CountsMeshesOnceAndInstancesEach) {
  for (int i = 0; i < 3; ++i) add(diffuse({1, 1, 1}));
  EXPECT_EQ(required().triangles, 12u);
  EXPECT_EQ(required().instanced_triangles, 36u);
}

TEST_F(SceneRequirements, ReadsMaterials) {
  add(glass(1.5f));
  EXPECT_TRUE(required().transmission);
  EXPECT_FALSE(required().rough_specular);  // smooth
  EXPECT_FALSE(required().metals);
  add(metal({1, 1, 1}, 0));
  EXPECT_TRUE(required().metals);
  EXPECT_FALSE(required().rough_specular);
  add(emitter({1, 0, 0}));
  EXPECT_TRUE(required().emissive_meshes);
  add(plastic({1, 1, 1}, 0.3f));
  EXPECT_TRUE(required().rough_specular);
}

TEST_F(SceneRequirements, ALobeIsRoughAboveTheSetsThreshold) {
  add(metal({1, 1, 1}, 0.2f));  // alpha 0.04
  EXPECT_TRUE(required().rough_specular);
  set.estimation.specular_roughness = 0.05;
  EXPECT_FALSE(required().rough_specular);
}

TEST_F(SceneRequirements, CausticsNeedAClearInterface) {
  scene::Material material = glass(1.5f);
  material.roughness = 0.3f;
  add(material);
  add(metal({1, 1, 1}, 0.2f));
  EXPECT_FALSE(required().caustics);
  // Where a texture makes it smooth, a rough metal is a mirror.
  scene::Texture texture;
  texture.width = 2;
  texture.height = 1;
  texture.texels = {{1, 1, 1, 1}, {1, 0, 1, 1}};
  scene::Material polished = metal({1, 1, 1}, 0.2f);
  polished.metallic_roughness_texture = add_texture(scene, texture);
  add(polished);
  EXPECT_TRUE(required().caustics);
}

TEST_F(SceneRequirements, AMetalDoesNotTransmitAndAnIorOfOneDoesNotReflect) {
  scene::Material material = glass(1.5f);
  material.metallic = 1;
  add(material);
  EXPECT_FALSE(required().transmission);
  scene::Texture no_metal;
  no_metal.width = no_metal.height = 1;
  no_metal.texels = {{1, 1, 0, 1}};
  material.metallic_roughness_texture = add_texture(scene, no_metal);
  add(material);
  EXPECT_TRUE(required().transmission);
  scene.instances.clear();
  add(plastic({1, 1, 1}, 0.5f, 1.0f));
  EXPECT_FALSE(required().rough_specular);
}

TEST_F(SceneRequirements, AlphaCountsOnlyWhereItCanLetThrough) {
  scene::Texture texture;
  texture.width = texture.height = 1;
  texture.texels = {{1, 1, 1, 0.6f}};
  scene::Material material = diffuse({1, 1, 1});
  material.alpha = 0.8f;
  add(material);
  EXPECT_FALSE(required().alpha);  // opaque
  material.alpha_mode = scene::AlphaMode::mask;
  add(material);
  EXPECT_FALSE(required().alpha);  // 0.8 is above the cut-off of 0.5
  material.base_color_texture = add_texture(scene, texture);
  add(material);
  EXPECT_TRUE(required().alpha);  // 0.48 is not
  EXPECT_TRUE(required().textures);
  scene.instances.clear();
  material.alpha_mode = scene::AlphaMode::blend;
  material.base_color_texture = scene::no_texture;
  add(material);
  EXPECT_TRUE(required().alpha);
  material.alpha = 1;
  scene.instances.clear();
  add(material);
  EXPECT_FALSE(required().alpha);
}

TEST_F(SceneRequirements, ReadsPresence) {
  add(diffuse({1, 1, 1}), scene::world_mixed);
  EXPECT_TRUE(required().differing_objects);
  EXPECT_FALSE(required().removed_objects);
  add(diffuse({1, 1, 1}), scene::world_real);
  EXPECT_TRUE(required().removed_objects);
  scene.instances.clear();
  add(glass(1.5f), 0);  // in no world
  EXPECT_FALSE(required().transmission || required().differing_objects);
  EXPECT_EQ(required().triangles, 0u);
}

TEST_F(SceneRequirements, ReadsLightsAndLens) {
  set::Light light;
  light.gain_mixed = light.gain_real = 0;
  scene.lights = {light};
  EXPECT_FALSE(required().lights);
  scene.lights[0].gain_real = 1;
  EXPECT_TRUE(required().lights);
  scene.lights[0].emission = glm::dvec3(0);
  EXPECT_FALSE(required().lights);
  set.lighting.mode = set::LightMode::hybrid;  // lamps may be found in what the light camera sees
  EXPECT_TRUE(required().lights);
  set.observer.calibration.emplace();
  EXPECT_FALSE(required().thin_lens);
  set.observer.calibration->lens = ThinLens{0.05, 2, 1};
  EXPECT_TRUE(required().thin_lens);
}

}  // namespace scene_requirements_test
}  // namespace previz::test
