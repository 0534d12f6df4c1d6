// When a frame needs which feature of the renderer, and what `previzd check` can say of each.
#include "daemon/core/render/world/feature.hpp"

#include "tests/support/scenes.hpp"
#include "tests/support/test.hpp"

namespace previz::test::feature_test {

using scene::Material;

// A set whose objects are boxes.
struct Scenario {
  void add(const scene::Material& material, std::uint32_t presence = scene::world_both) {
    add_instance(scene, mesh, add_material(scene, material), glm::dmat4(1), presence);
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

class Features : public ::testing::Test, protected Scenario {};

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
  }
  EXPECT_NE(bits, 0u);
  EXPECT_EQ(bits, bits_of_shaders());
}

// A material that differs from another in some ways.
Material but(Material material, void (*change)(Material&)) {
  change(material);
  return material;
}

Material coloured_glass(const glm::vec3& color) {
  Material material = glass(1.5f);
  material.attenuation_distance_m = 0.1f;
  material.attenuation_color = color;
  return material;
}

Material under_sheen(Material material) {
  material.sheen_color = {0, 0.1f, 0};
  return material;
}

Material brushed(Material material) {
  material.anisotropy = 0.5f;
  return material;
}

Material coloured_gloss(float metallic) {
  Material material = metal({1, 1, 1}, 0.3f);
  material.metallic = metallic;
  material.specular_color = {1, 0, 0};
  return material;
}

Material see_through(scene::AlphaMode mode, float alpha,
                     std::uint32_t texture = scene::no_texture) {
  Material material = diffuse({1, 1, 1});
  material.alpha_mode = mode;
  material.alpha = alpha;
  material.base_color_texture = texture;
  return material;
}

// What objects are made of, and some of the features that they do and do not need.
struct Row {
  const char* what;
  std::vector<Material> materials;
  std::vector<const char*> needed, not_needed = {};
  std::optional<scene::Texture> texture = {};  // the materials' texture 0
};

const glm::vec3 white(1), green(0.1f, 0.8f, 0.3f);
using enum scene::AlphaMode;

const Row rows[] = {
    {"glass, which has no opaque part", {glass(1.5f)}, {"refraction"}, {"gloss", "metal"}},
    {"glass and a mirror",
     {glass(1.5f), metal(white, 0)},
     {"metal", "gloss"},
     {"glowing surfaces", "lamps"}},
    {"twelve triangles that glow, and are found as surfaces",
     {emitter({1, 0, 0})},
     {"glowing surfaces", "lamps", "many lamps"},
     {"lamps in view"}},
    {"glass that takes nothing away", {coloured_glass(white)}, {}, {"coloured glass"}},
    {"a coloured pane, which has no inside",
     {but(coloured_glass(green), [](Material& m) { m.thin_walled = true; })},
     {},
     {"coloured glass"}},
    {"coloured glass", {coloured_glass(green)}, {"coloured glass"}},
    {"an index of 1, which reflects nothing", {plastic(white, 0.5f, 1)}, {}, {"gloss"}},
    {"plastic", {plastic(white, 0.3f)}, {"gloss"}, {"cloth", "brushed metal", "coloured gloss"}},
    {"cloth", {under_sheen(diffuse(white))}, {"cloth"}},
    {"strokes on what does not reflect", {brushed(diffuse(white))}, {}, {"brushed metal"}},
    {"strokes on what lets light through", {brushed(glass(1.5f))}, {}, {"brushed metal"}},
    {"brushed metal", {brushed(metal(white, 0.3f))}, {"brushed metal"}},
    {"metal, which has no coat", {coloured_gloss(1)}, {}, {"coloured gloss"}},
    {"coloured gloss", {coloured_gloss(0)}, {"coloured gloss"}},
    {"a pane that fibres stand on, which is no clear view", {under_sheen(pane())}, {}, {"panes"}},
    {"a pane", {pane()}, {"panes"}},
    {"normals of a texture",
     {but(diffuse(white), [](Material& m) { m.normal_texture = 0; })},
     {"textures", "normal maps"},
     {},
     texture_of(glm::vec4(1))},
    {"rough glass and rough metal",
     {but(glass(1.5f), [](Material& m) { m.roughness = 0.3f; }), metal(white, 0.2f)},
     {},
     {"photons"}},
    {"rough metal that a texture makes a mirror somewhere",
     {but(metal(white, 0.2f), [](Material& m) { m.metallic_roughness_texture = 0; })},
     {"photons"},
     {},
     texture_of(2, 1, {{1, 1, 1, 1}, {1, 0, 1, 1}})},
    {"metal, which does not transmit",
     {but(glass(1.5f), [](Material& m) { m.metallic = 1; })},
     {},
     {"refraction"}},
    {"metal that a texture takes away",
     {but(glass(1.5f),
          [](Material& m) {
            m.metallic = 1;
            m.metallic_roughness_texture = 0;
          })},
     {"refraction"},
     {},
     texture_of({1, 1, 0, 1})},
    {"alpha of what is opaque", {see_through(opaque, 0.8f)}, {}, {"alpha"}},
    {"0.8, above the cut-off of 0.5", {see_through(mask, 0.8f)}, {}, {"alpha"}},
    {"0.48, below it", {see_through(mask, 0.8f, 0)}, {"alpha"}, {}, texture_of({1, 1, 1, 0.6f})},
    {"a veil", {see_through(blend, 0.8f)}, {"alpha"}},
    {"a veil of 1", {see_through(blend, 1)}, {}, {"alpha"}},
    // The shaders read texels as halves, whose neighbours below 1 are 2^-11 apart.
    {"1 as a half", {see_through(blend, 1, 0)}, {}, {"alpha"}, texture_of({1, 1, 1, 0.9999f})},
    {"less than 1", {see_through(blend, 1, 0)}, {"alpha"}, {}, texture_of({1, 1, 1, 0.999f})},
    {"above the cut-off as a float, and at 0.5, below it, as a half",
     {but(see_through(mask, 1, 0), [](Material& m) { m.alpha_cutoff = 0.50005f; })},
     {"alpha"},
     {},
     texture_of({1, 1, 1, 0.5001f})},
};

TEST(FeaturesOf, Materials) {
  for (const Row& row : rows) {
    SCOPED_TRACE(row.what);
    Scenario scenario;
    if (row.texture) add_texture(scenario.scene, *row.texture);
    for (const Material& material : row.materials) scenario.add(material);
    for (const char* feature : row.needed) EXPECT_TRUE(scenario.needs(feature)) << feature;
    for (const char* feature : row.not_needed) EXPECT_FALSE(scenario.needs(feature)) << feature;
  }
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

TEST_F(Features, ManyLampsAreFive) {
  for (int i = 0; i < 4; ++i) scene.lights.push_back(lamp(set::LightType::point));
  EXPECT_FALSE(needs("many lamps"));
  scene.lights.push_back(lamp(set::LightType::point));
  EXPECT_TRUE(needs("many lamps"));
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

TEST_F(Features, TexturesAreThoseOfMaterialsInUse) {
  Material material = diffuse({1, 1, 1});
  material.normal_texture = add_texture(scene, texture_of(glm::vec4(1)));
  add_material(scene, material);
  EXPECT_FALSE(needs("textures"));
  add(material);
  EXPECT_TRUE(needs("textures"));
}

TEST_F(Features, TexturesAreFilteredWhereTheSetAsksForIt) {
  Material material = diffuse({1, 1, 1});
  set.estimation.filter_textures = true;
  add(material);
  EXPECT_FALSE(needs("filtered textures"));
  material.normal_texture = add_texture(scene, texture_of(glm::vec4(1)));
  add(material);
  EXPECT_FALSE(needs("filtered textures"));  // normals are not filtered
  material.base_color_texture = material.normal_texture;
  add(material);
  EXPECT_TRUE(needs("filtered textures"));
  set.estimation.filter_textures = false;
  EXPECT_FALSE(needs("filtered textures"));
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
