// The scenes of the ground truth sets as set.json states them. The sets lie outside the repository.
#include <nlohmann/json.hpp>

#include "daemon/core/render/world/feature.hpp"
#include "daemon/core/scene/load.hpp"
#include "daemon/core/scene/scene.hpp"
#include "tests/support/shared_data.hpp"
#include "tests/support/test.hpp"

namespace previz::scene::groundtruth_test {

using Json = nlohmann::json;
namespace fs = std::filesystem;

class GroundTruthScene : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    directory = test::shared_data("groundtruth") / GetParam();
    PREVIZ_NEEDS(directory / "set.json");
    json = Json::parse(std::ifstream(directory / "set.json"));
    set::Object phantom, virtual_object;
    phantom.file = directory / "phantom.glb";
    phantom.presence = set::Presence::phantom;
    virtual_object.file = directory / "virtual.glb";
    set.objects = {phantom, virtual_object};
  }

  fs::path directory;
  Json json;
  set::Set set;
};

void expect_color(const glm::vec3& color, const Json& expected) {
  for (int i = 0; i < 3; ++i) EXPECT_FLOAT_EQ(color[i], expected[static_cast<std::size_t>(i)]);
}

void expect_material(const Material& material, const Json& expected) {
  const std::string type = expected.at("type");
  if (type == "diffuse") {
    EXPECT_EQ(material.metallic, 0);
    EXPECT_EQ(material.specular, 0);
    EXPECT_EQ(material.base_color_texture != no_texture, expected.contains("tex"));
    expect_color(material.base_color,
                 expected.contains("tex") ? Json{1, 1, 1} : expected.at("albedo"));
  } else if (type == "metal") {
    EXPECT_EQ(material.metallic, 1);
    EXPECT_EQ(material.roughness, 0);
    expect_color(material.base_color, expected.at("albedo"));
  } else if (type == "glass") {
    EXPECT_EQ(material.transmission, 1);
    EXPECT_FALSE(material.thin_walled);
    EXPECT_FLOAT_EQ(material.ior, expected.at("ior"));
  }
}

TEST_P(GroundTruthScene, HasTheObjectsOfSetJson) {
  const Scene scene = load_scene(set);
  EXPECT_EQ(scene.notes, std::vector<std::string>{});
  std::map<std::string, const Instance*> by_name;
  for (const Instance& instance : scene.instances) by_name[instance.name] = &instance;
  std::size_t count = 0;
  std::uint64_t triangles = 0;
  for (const char* world : {"real", "virtual"}) {
    for (const Json& object : json.at("objects").at(world)) {
      SCOPED_TRACE(object.at("name").get<std::string>());
      ASSERT_TRUE(by_name.contains(object.at("name")));
      const Instance& instance = *by_name[object.at("name")];
      const Mesh& mesh = scene.meshes[instance.mesh];
      EXPECT_EQ(mesh.triangles.size(), object.at("triangles").get<std::size_t>());
      EXPECT_EQ(instance.presence, *world == 'r' ? world_both : world_mixed);
      EXPECT_EQ(scene.materials[instance.material].name, object.at("material").get<std::string>());
      expect_material(scene.materials[instance.material],
                      json.at("gltf").at("materials").at(object.at("material").get<std::string>()));
      glm::dvec3 low(1e9), high(-1e9);
      for (const glm::vec3& p : mesh.positions) {
        const glm::dvec3 at(instance.world_from_object * glm::dvec4(p, 1));
        low = glm::min(low, at);
        high = glm::max(high, at);
      }
      for (int i = 0; i < 3; ++i) {  // stated with five decimals
        EXPECT_NEAR(low[i], object.at("bbox_min")[static_cast<std::size_t>(i)], 6e-6);
        EXPECT_NEAR(high[i], object.at("bbox_max")[static_cast<std::size_t>(i)], 6e-6);
      }
      triangles += mesh.triangles.size();
      ++count;
    }
  }
  EXPECT_EQ(scene.instances.size(), count);
  EXPECT_EQ(size_of(scene).instanced_triangles, triangles);
  const auto materials = render::material_features(scene, set.estimation.specular_roughness);
  const render::Demand demand = render::demand_of(set, scene, materials);
  const auto expect_needed = [&](const std::string& name, bool expected) {
    const auto feature = std::ranges::find(render::features(), name, &render::Feature::name);
    ASSERT_NE(feature, render::features().end()) << name;
    EXPECT_EQ(render::is_needed(*feature, demand), expected) << name;
  };
  expect_needed("two worlds", true);
  expect_needed("textures", true);  // the tags
  for (const char* name : {"alpha", "lamps", "removed objects"}) expect_needed(name, false);
  expect_needed("refraction", std::string(GetParam()) == "glass");
  expect_needed("metal", std::string(GetParam()) != "statues");
}

INSTANTIATE_TEST_SUITE_P(Sets, GroundTruthScene, ::testing::Values("desk", "glass", "statues"),
                         [](const auto& tested) { return std::string(tested.param); });

class Statues : public GroundTruthScene {};

TEST_P(Statues, ShareTheirMeshes) {
  const Scene scene = load_scene(set);
  std::set<std::uint32_t> meshes;
  int statues = 0;
  for (const Instance& instance : scene.instances) {
    if (instance.presence != world_mixed) continue;
    meshes.insert(instance.mesh);
    ++statues;
  }
  EXPECT_EQ(statues, 6);
  EXPECT_EQ(meshes.size(), 4u);  // dragon, bunny, cow, teapot
  const Size size = size_of(scene);
  EXPECT_EQ(size.instanced_triangles, 2u * 201031 + 35136 + 2 * 69451 + 6320 + 4 * 12 + 2 * 2);
  EXPECT_EQ(size.triangles, 201031u + 35136 + 69451 + 6320 + 4 * 12 + 2 * 2);
}

INSTANTIATE_TEST_SUITE_P(Set, Statues, ::testing::Values("statues"));

}  // namespace previz::scene::groundtruth_test
