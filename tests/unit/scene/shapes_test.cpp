#include "tests/support/scenes.hpp"
#include "tests/support/test.hpp"

namespace previz::test::shapes_test {

using Point = std::tuple<float, float, float>;

Point key(const glm::vec3& p) {
  return {p.x, p.y, p.z};
}

double signed_volume(const scene::Mesh& mesh) {
  double volume = 0;
  for (const glm::uvec3& t : mesh.triangles)
    volume +=
        glm::dot(glm::dvec3(mesh.positions[t.x]),
                 glm::cross(glm::dvec3(mesh.positions[t.y]), glm::dvec3(mesh.positions[t.z]))) /
        6;
  return volume;
}

// Every directed edge occurs once, and once in the other direction.
bool is_closed(const scene::Mesh& mesh) {
  std::map<std::pair<Point, Point>, int> edges;
  for (const glm::uvec3& t : mesh.triangles)
    for (int i = 0; i < 3; ++i)
      ++edges[{key(mesh.positions[t[i]]), key(mesh.positions[t[(i + 1) % 3]])}];
  for (const auto& [edge, count] : edges)
    if (count != 1 || !edges.contains({edge.second, edge.first})) return false;
  return true;
}

void expect_sound(const scene::Mesh& mesh) {
  SCOPED_TRACE(mesh.name);
  ASSERT_EQ(mesh.normals.size(), mesh.positions.size());
  ASSERT_TRUE(mesh.uvs.empty() || mesh.uvs.size() == mesh.positions.size());
  for (const glm::vec3& normal : mesh.normals) EXPECT_NEAR(glm::length(normal), 1, 1e-6);
  for (const glm::uvec3& t : mesh.triangles) {
    const glm::vec3 winding = glm::cross(mesh.positions[t.y] - mesh.positions[t.x],
                                         mesh.positions[t.z] - mesh.positions[t.x]);
    for (int i = 0; i < 3; ++i) EXPECT_GT(glm::dot(mesh.normals[t[i]], winding), 0);
  }
}

TEST(SceneShapes, AreClosedAndFaceOutwards) {
  for (const scene::Mesh& mesh :
       {box_mesh({1, 2, 3}), uv_sphere_mesh(0.5, 48, 24), icosphere_mesh(0.5, 3)}) {
    expect_sound(mesh);
    EXPECT_TRUE(is_closed(mesh)) << mesh.name;
    EXPECT_GT(signed_volume(mesh), 0) << mesh.name;
    expect_sound(inside_out(mesh));
    EXPECT_LT(signed_volume(inside_out(mesh)), 0) << mesh.name;
  }
  expect_sound(rectangle_mesh({2, 3}));
  EXPECT_NEAR(signed_volume(box_mesh({1, 2, 3})), 6, 1e-6);
}

TEST(SceneShapes, TheIcosphereIsAsRoundAsItSays) {
  const scene::Mesh mesh = icosphere_mesh(1, 3);
  EXPECT_EQ(mesh.triangles.size(), 20u * 64u);
  for (const glm::uvec3& t : mesh.triangles) {
    const glm::vec3 centre =
        (mesh.positions[t.x] + mesh.positions[t.y] + mesh.positions[t.z]) / 3.0f;
    EXPECT_GT(glm::length(centre), 0.99f);
  }
}

TEST(SceneShapes, RandomScenesAreRepeatableAndTakeEveryMaterial) {
  std::set<std::string> names;
  for (std::uint32_t seed = 0; seed < 6; ++seed) {
    RandomScene options;
    options.removed_objects = 1;
    options.lights = 2;
    const View a = random_scene(seed, options), b = random_scene(seed, options);
    ASSERT_EQ(a.scene.instances.size(), 10u);
    EXPECT_EQ(a.environment.radiance, b.environment.radiance);
    EXPECT_EQ(a.world_from_camera, b.world_from_camera);
    for (std::size_t i = 0; i < a.scene.instances.size(); ++i)
      EXPECT_EQ(a.scene.instances[i].world_from_object, b.scene.instances[i].world_from_object);
    for (const scene::Mesh& mesh : a.scene.meshes) expect_sound(mesh);
    const scene::Material& material = a.scene.materials[a.scene.instances[5].material];
    names.insert(material.name + (material.name == "metal" && material.roughness > 0 ? "+" : ""));
    EXPECT_EQ(a.scene.instances[5].presence, scene::world_mixed);
    EXPECT_EQ(a.scene.instances[9].presence, scene::world_real);
  }
  EXPECT_EQ(names, (std::set<std::string>{"diffuse", "textured", "plastic", "metal", "metal+",
                                          "emitter"}));
}

TEST(SceneShapes, RandomObjectsStandOnTheTableAndDoNotTouch) {
  for (std::uint32_t seed = 0; seed < 50; ++seed) {
    RandomScene options;
    options.real_objects = options.virtual_objects = 6;
    const View view = random_scene(seed, options);
    std::vector<std::pair<glm::dvec2, double>> discs;
    for (std::size_t i = 1; i < view.scene.instances.size(); ++i) {
      const scene::Instance& instance = view.scene.instances[i];
      const scene::Mesh& mesh = view.scene.meshes[instance.mesh];
      const glm::dvec2 centre(instance.world_from_object[3]);
      double low = 1, radius = 0;
      for (const glm::vec3& p : mesh.positions) {
        const glm::dvec3 world(instance.world_from_object * glm::dvec4(p, 1));
        low = std::min(low, world.z);
        radius = std::max(radius, glm::distance(glm::dvec2(world), centre));
      }
      // The lowest vertex of an icosphere can be above its south pole by a facet's sagitta, 1 %.
      EXPECT_NEAR(low, -0.002, 0.002);
      discs.emplace_back(centre, radius);
    }
    for (std::size_t i = 0; i < discs.size(); ++i)
      for (std::size_t j = 0; j < i; ++j)
        EXPECT_GT(glm::distance(discs[i].first, discs[j].first), discs[i].second + discs[j].second);
  }
}

}  // namespace previz::test::shapes_test
