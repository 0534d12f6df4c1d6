// When a frame needs which feature of the renderer, and what `previzd check` can say of each.
#include "daemon/render/feature.hpp"

#include "tests/support/scenes.hpp"
#include "tests/support/test.hpp"

namespace previz::test::feature_test {

class Features : public ::testing::Test {
 protected:
  void add(const scene::Material& material, std::uint32_t presence = scene::world_both) {
    add_instance(scene, mesh, add_material(scene, material), glm::dmat4(1.0), presence);
  }

  bool needs(const std::string& name) const {
    const auto materials = render::material_features(scene, set.estimation.specular_roughness);
    const auto row = std::ranges::find(render::features(), name, &render::Feature::name);
    if (row == render::features().end()) {
      ADD_FAILURE() << "there is no feature \"" << name << '"';
      return false;
    }
    return render::is_needed(*row, render::demand_of(set, scene, materials));
  }

  // Names of all features that the set needs, in alphabetical order.
  std::set<std::string> needed() const {
    std::set<std::string> result;
    for (const render::Feature& feature : render::features())
      if (needs(feature.name)) result.insert(feature.name);
    return result;
  }

  scene::Scene scene;
  set::Set set;
  std::uint32_t mesh = add_mesh(scene, box_mesh({1, 1, 1}));
};

// All FEATURE_* bits that the shaders know.
std::uint32_t bits_of_shaders() {
  std::ifstream header(PREVIZ_SOURCE_DIR "/shaders/lib/material_shared.h");
  const std::string text(std::istreambuf_iterator<char>(header), {});
  const std::regex constant(R"(uint FEATURE_\w+ = (\d+)u;)");
  std::uint32_t bits = 0;
  for (std::sregex_iterator found(text.begin(), text.end(), constant), end; found != end; ++found)
    bits |= static_cast<std::uint32_t>(std::stoul((*found)[1]));
  return bits;
}

// Each bit that the shaders are specialised on is one row's; names are unique, and both sentences
// are there and say different things.
TEST(FeatureTable, HasEachFeatureOnce) {
  std::uint32_t bits = 0;
  std::set<std::string> names;
  for (const render::Feature& feature : render::features()) {
    EXPECT_TRUE(names.insert(feature.name).second) << feature.name;
    EXPECT_LE(std::popcount(feature.bit), 1) << feature.name;
    EXPECT_EQ(bits & feature.bit, 0u) << feature.name;
    bits |= feature.bit;
    EXPECT_TRUE(feature.bit != 0 || !feature.can_be_carried) << feature.name;
    EXPECT_TRUE(feature.in_material || feature.of_extension || feature.in_frame) << feature.name;
    EXPECT_NE(std::string(feature.used), "") << feature.name;
    EXPECT_NE(std::string(feature.left_out), "") << feature.name;
    EXPECT_NE(std::string(feature.used), feature.left_out) << feature.name;
  }
  EXPECT_NE(bits, 0u);
  EXPECT_EQ(bits, bits_of_shaders());
}

TEST_F(Features, ADiffuseRealSceneNeedsNothing) {
  set.lighting.from = set::LightFrom::set;
  set.quality.denoise = false;
  add(diffuse({0.5f, 0.5f, 0.5f}));
  add_material(scene, glass(1.5f));  // on no instance
  add_texture(scene, {});            // of no material
  EXPECT_EQ(needed(), std::set<std::string>());
  set.lighting.from = set::LightFrom::camera;
  set.quality.denoise = true;
  EXPECT_EQ(needed(), (std::set<std::string>{"denoiser", "environment light"}));
}

TEST_F(Features, ASceneCountsMeshesOnceAndInstancesEach) {
  for (int i = 0; i < 3; ++i) add(diffuse({1, 1, 1}));
  add(diffuse({1, 1, 1}), 0);            // in no world
  add_mesh(scene, box_mesh({2, 2, 2}));  // on no instance
  const scene::Size size = size_of(scene);
  EXPECT_EQ(size.triangles, 12u);
  EXPECT_EQ(size.instanced_triangles, 36u);
}

TEST_F(Features, ReadMaterials) {
  add(glass(1.5f));
  EXPECT_TRUE(needs("refraction"));
  EXPECT_FALSE(needs("gloss"));  // no opaque part
  EXPECT_FALSE(needs("metal"));
  add(metal({1, 1, 1}, 0));
  EXPECT_TRUE(needs("metal"));
  EXPECT_TRUE(needs("gloss"));
  EXPECT_FALSE(needs("glowing surfaces"));
  EXPECT_FALSE(needs("lamps"));
  add(emitter({1, 0, 0}));
  EXPECT_TRUE(needs("glowing surfaces"));
  EXPECT_TRUE(needs("lamps"));
  EXPECT_FALSE(needs("lamps in view"));  // found as surfaces
}

TEST_F(Features, ManyLampsAreFiveOrGlowingTriangles) {
  for (int i = 0; i < 4; ++i) scene.lights.push_back(lamp(set::LightType::point));
  EXPECT_FALSE(needs("many lamps"));
  scene.lights.push_back(lamp(set::LightType::point));
  EXPECT_TRUE(needs("many lamps"));
  scene.lights.clear();
  add(emitter({1, 1, 1}));  // a box has twelve
  EXPECT_TRUE(needs("many lamps"));
}

TEST_F(Features, GlassIsColouredWhereItsInsideTakesLightAway) {
  scene::Material bottle = glass(1.5f);
  bottle.attenuation_distance_m = 0.1f;
  add(bottle);
  EXPECT_FALSE(needs("coloured glass"));  // white takes nothing away
  bottle.attenuation_color = {0.1f, 0.8f, 0.3f};
  bottle.thin_walled = true;
  add(bottle);
  EXPECT_FALSE(needs("coloured glass"));  // a pane has no inside
  bottle.thin_walled = false;
  add(bottle);
  EXPECT_TRUE(needs("coloured glass"));
}

TEST_F(Features, AnAnimatedShapeIsADeformingObject) {
  add(diffuse({1, 1, 1}));
  EXPECT_FALSE(needs("deforming objects"));
  scene.deformations.emplace_back();
  EXPECT_TRUE(needs("deforming objects"));
}

TEST_F(Features, MaterialsOfWhatCannotBeHitDoNotCount) {
  scene::Mesh nothing = box_mesh({1, 1, 1});
  for (glm::vec3& p : nothing.positions) p.x = std::numeric_limits<float>::quiet_NaN();
  mesh = add_mesh(scene, nothing);
  add(glass(1.5f));
  mesh = add_mesh(scene, {});
  add(glass(1.5f));
  EXPECT_FALSE(needs("refraction") || needs("photons"));
}

TEST_F(Features, ThereIsGlossWhereACoatOrMetalReflects) {
  add(plastic({1, 1, 1}, 0.5f, 1.0f));  // an ior of 1 reflects nothing
  EXPECT_FALSE(needs("gloss"));
  add(plastic({1, 1, 1}, 0.3f));
  EXPECT_TRUE(needs("gloss"));
}

TEST_F(Features, ReadLayersAndBrushStrokes) {
  add(plastic({1, 1, 1}, 0.3f));
  EXPECT_FALSE(needs("cloth") || needs("brushed metal") || needs("coloured gloss"));
  scene::Material cloth = diffuse({1, 1, 1});
  cloth.sheen_color = {0, 0.1f, 0};
  add(cloth);
  EXPECT_TRUE(needs("cloth"));
  scene::Material brushed = diffuse({1, 1, 1});
  brushed.anisotropy = 0.5f;
  add(brushed);
  EXPECT_FALSE(needs("brushed metal"));  // it does not reflect
  brushed = glass(1.5f);
  brushed.anisotropy = 0.5f;
  add(brushed);
  EXPECT_FALSE(needs("brushed metal"));  // what lets light through is left as it is
  brushed = metal({1, 1, 1}, 0.3f);
  brushed.anisotropy = 0.5f;
  add(brushed);
  EXPECT_TRUE(needs("brushed metal"));
  scene::Material gloss = metal({1, 1, 1}, 0.3f);
  gloss.specular_color = {1, 0, 0};
  add(gloss);
  EXPECT_FALSE(needs("coloured gloss"));  // metal has no coat
  gloss.metallic = 0;
  add(gloss);
  EXPECT_TRUE(needs("coloured gloss"));
}

// A pane that fibres stand on is no clear view.
TEST_F(Features, APaneWithSheenIsNone) {
  scene::Material pane = glass(1.5f);
  pane.thin_walled = true;
  pane.sheen_color = {0.5f, 0.5f, 0.5f};
  add(pane);
  EXPECT_FALSE(needs("panes"));
  pane.sheen_color = {0, 0, 0};
  add(pane);
  EXPECT_TRUE(needs("panes"));
}

TEST_F(Features, TexturesAreThoseOfMaterialsInUse) {
  scene::Texture texture;
  texture.width = texture.height = 1;
  texture.texels = {{1, 1, 1, 1}};
  scene::Material material = diffuse({1, 1, 1});
  material.normal_texture = add_texture(scene, texture);
  add_material(scene, material);
  EXPECT_FALSE(needs("textures"));
  add(material);
  EXPECT_TRUE(needs("textures"));
  EXPECT_TRUE(needs("normal maps"));
}

TEST_F(Features, TexturesAreFilteredWhereTheSetAsksForIt) {
  scene::Texture texture;
  texture.width = texture.height = 1;
  texture.texels = {{1, 1, 1, 1}};
  scene::Material material = diffuse({1, 1, 1});
  set.estimation.filter_textures = true;
  add(material);
  EXPECT_FALSE(needs("filtered textures"));
  material.normal_texture = add_texture(scene, texture);
  add(material);
  EXPECT_FALSE(needs("filtered textures"));  // normals are not filtered
  material.base_color_texture = material.normal_texture;
  add(material);
  EXPECT_TRUE(needs("filtered textures"));
  set.estimation.filter_textures = false;
  EXPECT_FALSE(needs("filtered textures"));
}

TEST_F(Features, PhotonsNeedAClearInterface) {
  scene::Material material = glass(1.5f);
  material.roughness = 0.3f;
  add(material);
  add(metal({1, 1, 1}, 0.2f));
  EXPECT_FALSE(needs("photons"));
  // Where a texture makes it smooth, a rough metal is a mirror.
  scene::Texture texture;
  texture.width = 2;
  texture.height = 1;
  texture.texels = {{1, 1, 1, 1}, {1, 0, 1, 1}};
  scene::Material polished = metal({1, 1, 1}, 0.2f);
  polished.metallic_roughness_texture = add_texture(scene, texture);
  add(polished);
  EXPECT_TRUE(needs("photons"));
}

TEST_F(Features, AMirrorIsSmoothBelowTheSetsThreshold) {
  add(metal({1, 1, 1}, 0.2f));  // alpha 0.04
  EXPECT_FALSE(needs("photons"));
  set.estimation.specular_roughness = 0.05;
  EXPECT_TRUE(needs("photons"));
}

TEST_F(Features, PhotonsNeedLightAndTheSetsWish) {
  add(glass(1.5f));
  EXPECT_TRUE(needs("photons"));
  EXPECT_FALSE(needs("traced caustics"));
  set.estimation.caustics = set::Caustics::traced;
  EXPECT_FALSE(needs("photons"));
  EXPECT_TRUE(needs("traced caustics"));
  set.estimation.caustics = set::Caustics::none;
  EXPECT_FALSE(needs("photons") || needs("traced caustics"));
  set.estimation.caustics = set::Caustics::photons;
  set.lighting.from = set::LightFrom::set;
  EXPECT_FALSE(needs("photons"));
  scene.lights = {lamp(set::LightType::point)};
  EXPECT_TRUE(needs("photons"));
}

TEST_F(Features, AMetalDoesNotTransmit) {
  scene::Material material = glass(1.5f);
  material.metallic = 1;
  add(material);
  EXPECT_FALSE(needs("refraction"));
  scene::Texture no_metal;
  no_metal.width = no_metal.height = 1;
  no_metal.texels = {{1, 1, 0, 1}};
  material.metallic_roughness_texture = add_texture(scene, no_metal);
  add(material);
  EXPECT_TRUE(needs("refraction"));
}

TEST_F(Features, AlphaCountsOnlyWhereItCanLetThrough) {
  scene::Texture texture;
  texture.width = texture.height = 1;
  texture.texels = {{1, 1, 1, 0.6f}};
  scene::Material material = diffuse({1, 1, 1});
  material.alpha = 0.8f;
  add(material);
  EXPECT_FALSE(needs("alpha"));  // opaque
  material.alpha_mode = scene::AlphaMode::mask;
  add(material);
  EXPECT_FALSE(needs("alpha"));  // 0.8 is above the cut-off of 0.5
  material.base_color_texture = add_texture(scene, texture);
  add(material);
  EXPECT_TRUE(needs("alpha"));  // 0.48 is not
  scene.instances.clear();
  material.alpha_mode = scene::AlphaMode::blend;
  material.base_color_texture = scene::no_texture;
  add(material);
  EXPECT_TRUE(needs("alpha"));
  material.alpha = 1;
  scene.instances.clear();
  add(material);
  EXPECT_FALSE(needs("alpha"));
}

// The shaders read texels as halves, whose neighbours below 1 are 2^-11 apart.
TEST_F(Features, AlphaIsReadAsTheShadersReadIt) {
  scene::Texture texture;
  texture.width = texture.height = 1;
  scene::Material material = diffuse({1, 1, 1});
  material.alpha_mode = scene::AlphaMode::blend;
  for (const float alpha : {0.9999f, 0.999f}) {
    texture.texels = {{1, 1, 1, alpha}};
    material.base_color_texture = add_texture(scene, texture);
    scene.instances.clear();
    add(material);
    EXPECT_EQ(needs("alpha"), alpha < 0.9995f) << alpha;
  }
  // Above the cut-off as a float, and at 0.5, below it, as a half.
  texture.texels = {{1, 1, 1, 0.5001f}};
  material.alpha_mode = scene::AlphaMode::mask;
  material.alpha_cutoff = 0.50005f;
  material.base_color_texture = add_texture(scene, texture);
  scene.instances.clear();
  add(material);
  EXPECT_TRUE(needs("alpha"));
}

TEST_F(Features, ReadPresence) {
  add(diffuse({1, 1, 1}));
  EXPECT_FALSE(needs("two worlds"));
  add(diffuse({1, 1, 1}), scene::world_mixed);
  EXPECT_TRUE(needs("two worlds"));
  EXPECT_FALSE(needs("removed objects"));
  scene.instances.clear();
  add(diffuse({1, 1, 1}), scene::world_real);
  EXPECT_TRUE(needs("two worlds"));
  EXPECT_TRUE(needs("removed objects"));
}

// What a carrier has lost is in neither world until it is found, and the pipelines wait for it.
TEST_F(Features, AnObjectThatIsLostIsStillCounted) {
  add(glass(1.5f), 0);
  EXPECT_TRUE(needs("refraction"));
  EXPECT_TRUE(needs("two worlds"));
}

TEST_F(Features, ReadLamps) {
  EXPECT_FALSE(needs("lamps"));
  scene.lights = {lamp(set::LightType::point)};
  EXPECT_TRUE(needs("lamps"));
  EXPECT_FALSE(needs("lamps in view"));
  EXPECT_FALSE(needs("relighting"));
  scene.lights[0].gain_mixed = 0;  // it may be turned up while the camera runs
  EXPECT_TRUE(needs("lamps"));
  EXPECT_TRUE(needs("relighting"));
  scene.lights = {lamp(set::LightType::sphere)};
  EXPECT_TRUE(needs("lamps in view"));
  scene.lights.clear();
  set.lighting.mode = set::LightMode::hybrid;  // lamps may be found in what the light camera sees
  EXPECT_TRUE(needs("lamps"));
  EXPECT_TRUE(needs("lamps in view"));
}

TEST_F(Features, ReadTheSet) {
  EXPECT_FALSE(needs("lens"));
  set.observer.calibration.emplace();
  EXPECT_FALSE(needs("lens"));
  set.observer.calibration->lens = ThinLens{0.05, 2, 1};
  EXPECT_TRUE(needs("lens"));

  EXPECT_FALSE(needs("difference only"));
  set.estimation.estimator = set::Estimator::difference;
  EXPECT_TRUE(needs("difference only"));
  set.estimation.composite = set::Composite::ratio;  // needs both worlds in full
  EXPECT_FALSE(needs("difference only"));

  EXPECT_FALSE(needs("camera's light"));
  set.estimation.real_radiance = set::RealRadiance::camera;
  EXPECT_TRUE(needs("camera's light"));
}

}  // namespace previz::test::feature_test
