#include "daemon/core/scene/seen_backs.hpp"

#include "tests/support/gltf_test.hpp"

namespace previz::test::seen_backs_test {

class SeenBacks : public GltfTest {
 protected:
  int material(Json given) { return gltf.add("materials", std::move(given)); }
};

const char* const said = "its one-sided faces are shown from behind, too, where glTF hides them ";

// glTF 2.0, 3.9.6.
TEST_F(SeenBacks, OfOneSidedSheetsAreSaid) {
  for (const Json& given :
       {Json{{"name", "leaf"}, {"doubleSided", false}},
        Json{{"name", "paper"}, {"doubleSided", true}}, Json{{"doubleSided", false}}})
    gltf.root("a", gltf.triangle_mesh(material(given)));
  gltf.root("a", gltf.triangle_mesh());  // the default material
  EXPECT_THAT(load().notes,
              ElementsAre(HasSubstr(std::string(said) + "(materials: \"leaf\", number 2)")));
  gltf.json["materials"][2]["extensions"]["KHR_materials_transmission"]["transmissionFactor"] = 1;
  gltf.json["materials"][2]["pbrMetallicRoughness"]["metallicFactor"] = 0;
  EXPECT_THAT(load().notes, ElementsAre(HasSubstr("(materials: \"leaf\")")));
  object.presence = set::Presence::phantom;
  EXPECT_THAT(load().notes, IsEmpty());
}

// A tetrahedron in two primitives of one mesh; turned, it is an outline or a room.
TEST_F(SeenBacks, AreNotThoseOfSolidsButOfThoseTurnedInsideOut) {
  const int leaf = material({{"name", "leaf"}, {"doubleSided", false}});
  const glm::vec3 o(0), x(1, 0, 0), y(0, 1, 0), z(0, 0, 1);
  const auto part = [&](const std::vector<glm::vec3>& corners) {
    return Json{{"attributes", {{"POSITION", gltf.positions(corners)}}}, {"material", leaf}};
  };
  const Json half = part({o, y, x, o, x, z}), other = part({o, z, y, x, y, z});
  gltf.root("solid", gltf.add("meshes", {{"primitives", Json::array({half, other})}}));
  EXPECT_THAT(load().notes, IsEmpty());
  gltf.json["meshes"][0]["primitives"] = {part({o, x, y, o, z, x}), part({o, y, z, x, z, y})};
  EXPECT_THAT(load().notes, ElementsAre(HasSubstr("(materials: \"leaf\")")));
}

TEST(SeenBacksOf, ManyTrianglesTakeABoundedTime) {
  scene::Mesh sheet;
  sheet.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  sheet.triangles.assign(10000, {0, 1, 2});
  const std::vector<const scene::Mesh*> same(400, &sheet);
  std::uint64_t tries = 1'000'000;
  EXPECT_EQ(scene::are_seen_from_behind(same, tries), std::vector<bool>(400, true));
  EXPECT_EQ(tries, 1'000'000u - 24u * 10000u);  // once
  tries = 100'000;
  EXPECT_EQ(scene::are_seen_from_behind(same, tries), std::vector<bool>(400, true));
  EXPECT_EQ(tries, 0u);
  EXPECT_EQ(scene::are_seen_from_behind(same, tries), std::vector<bool>(400));
}

}  // namespace previz::test::seen_backs_test
