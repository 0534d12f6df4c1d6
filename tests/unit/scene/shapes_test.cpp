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

}  // namespace previz::test::shapes_test
