// Objects that get other materials while they are shown: what is uploaded, built and encoded for
// that, and that the picture is that of a scene which was made so.
#include "daemon/core/render/world/feature.hpp"
#include "tests/support/render_fixture.hpp"

namespace previz::test::variants_test {

// A box above a table, in three looks: grey, mirror, lamp.
struct Stage {
  View view;
  std::uint32_t box = 0;
  Stage() {
    view.environment = uniform_environment(glm::vec3(0.2f));
    view.calibration = pinhole(32, 24, 0.8);
    view.world_from_camera = look_at({0, -2, 1.2}, {0, 0, 0.2});
    add(view.scene, rectangle_mesh({4, 4}), diffuse(glm::vec3(0.5)));
    const std::uint32_t mesh = add_mesh(view.scene, box_mesh(glm::dvec3(0.4)));
    scene::Variants variants;
    variants.names = {"mirror", "lamp"};
    variants.parts.resize(1);
    for (const scene::Material& material :
         {diffuse(glm::vec3(0.3)), metal(glm::vec3(0.9), 0), emitter(glm::vec3(3))})
      variants.parts[0].looks.push_back({mesh, add_material(view.scene, material)});
    box = add_instance(view.scene, mesh, variants.parts[0].looks[0].material, at({0, 0, 0.4}),
                       scene::world_mixed);
    variants.parts[0].instance = box;
    variants.object = view.scene.instances[box].object;
    view.scene.variants = {variants};
  }
  std::vector<scene::Instance> shown_as(const std::string& variant) const {
    std::vector<scene::Instance> instances = view.scene.instances;
    EXPECT_TRUE(scene::show_variant(view.scene.variants[0], variant, instances));
    return instances;
  }
};

struct Picture {
  render::Sheet<glm::vec3> mixed;
  render::Counters counters;
};

Picture picture_of(SetRenderer& renderer) {
  const render::Layers layers = renderer.rendered_clean(4);
  return {layers.mixed, renderer.counters()};
}

// Switching builds no tree, uploads no material and no texture, compiles no pipeline, and encodes
// lamps only where what glows has changed.
TEST(Variants, AreShownWithoutATreeAnUploadOrAPipeline) {
  const Stage stage;
  SetRenderer renderer(stage.view, up_to_depth(4));
  const Picture grey = picture_of(renderer);
  EXPECT_EQ(grey.counters.built_trees, 2u);
  EXPECT_EQ(grey.counters.uploaded_materials, 1u);
  EXPECT_EQ(grey.counters.encoded_lights, 1u);
  const std::uint32_t needed = renderer.needed();
  std::uint64_t encoded = 1;
  for (const char* variant : {"mirror", "lamp", "", "lamp", "mirror"}) {
    const bool glowed = encoded % 2 == 0;
    const bool glows = std::string(variant) == "lamp";
    encoded += glowed != glows ? 1 : 0;
    View as_made = stage.view;
    as_made.scene.instances = stage.shown_as(variant);
    renderer.move(as_made.scene.instances, stage.view.scene.lights);
    const Picture shown = picture_of(renderer);
    EXPECT_EQ(shown.counters.built_trees, 2u) << variant;
    EXPECT_EQ(shown.counters.uploaded_materials, 1u) << variant;
    EXPECT_EQ(shown.counters.uploaded_textures, 1u) << variant;
    EXPECT_EQ(shown.counters.encoded_lights, encoded) << variant;
    EXPECT_EQ(renderer.needed(), needed) << variant;
    SetRenderer fresh(as_made, up_to_depth(4));
    EXPECT_EQ(picture_of(fresh).mixed, shown.mixed) << variant;
  }
}

// Set anew with other materials, as a set file that was read again: trees, vertices and textures
// stay, and the picture is that of a new renderer.
TEST(Variants, ASceneWithOtherMaterialsKeepsItsTrees) {
  Stage stage;
  SetRenderer renderer(stage.view, up_to_depth(4));
  picture_of(renderer);
  const auto set_again = [&](const View& view) {
    renderer.begin_set(up_to_depth(4), view.calibration);
    renderer.set_scene(view.scene);
    renderer.set_environment(view.environment, set::LightSampling::importance);
    const Picture again = picture_of(renderer);
    SetRenderer fresh(view, up_to_depth(4));
    EXPECT_EQ(picture_of(fresh).mixed, again.mixed);
    return again.counters;
  };
  View repainted = stage.view;
  repainted.scene.materials[0].base_color = {0.9f, 0.1f, 0.1f};
  render::Counters counters = set_again(repainted);
  EXPECT_EQ(counters.built_trees, 2u);
  EXPECT_EQ(counters.uploaded_materials, 2u);
  EXPECT_EQ(counters.uploaded_textures, 1u);
  EXPECT_EQ(counters.encoded_lights, 2u);

  repainted.scene.materials[0].emission = {1, 2, 3};  // the table is a lamp
  EXPECT_EQ(set_again(repainted).built_trees, 2u);

  repainted.scene.materials[0].base_color_texture =
      add_texture(repainted.scene, texture_of(glm::vec4(0.5f)));
  counters = set_again(repainted);
  EXPECT_EQ(counters.built_trees, 2u);
  EXPECT_EQ(counters.uploaded_textures, 2u);

  repainted.scene.meshes[1].positions[0].z += 0.01f;
  EXPECT_EQ(set_again(repainted).built_trees, 4u) << "a vertex has moved";
  repainted.scene.instances.push_back(repainted.scene.instances[1]);
  repainted.scene.instances.back().world_from_object[3].x = 0.5;
  EXPECT_EQ(set_again(repainted).built_trees, 6u) << "there is one more instance";
}

// What a variant needs is in the pipelines from the start.
TEST(Variants, AreAskedForTheirFeatures) {
  const Stage stage;
  View plain = stage.view;
  plain.scene.variants.clear();
  const auto needs = [](const View& view, const std::string& name) {
    const set::Set set;
    const auto materials = render::material_features(view.scene, 1e-3);
    for (const render::Feature& feature : render::features())
      if (feature.name == name)
        return render::is_needed(feature, render::demand_of(set, view.scene, materials));
    ADD_FAILURE() << name;
    return false;
  };
  for (const char* name :
       {"metal", "gloss", "photons", "lamps", "many lamps", "glowing surfaces"}) {
    EXPECT_TRUE(needs(stage.view, name)) << name;
    EXPECT_FALSE(needs(plain, name)) << name;
  }
}

}  // namespace previz::test::variants_test
