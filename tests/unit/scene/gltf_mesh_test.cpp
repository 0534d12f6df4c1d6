#include "tests/support/gltf_test.hpp"

namespace previz::test::gltf_mesh_test {

using GltfMesh = GltfTest;

const std::vector<glm::vec3> square = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};

TEST_F(GltfMesh, ReadsIndicesOfEveryComponentTypeAndNone) {
  const int positions = gltf.positions(square);
  const int unindexed = gltf.positions({square[0], square[1], square[2]});
  const Json attributes = {{"POSITION", positions}, {"NORMAL", gltf.normals({4, {0, 0, 1}})}};
  const int u8 = gltf.values<std::uint8_t>(5121, "SCALAR", {0, 1, 2, 0, 2, 3});
  const int u16 = gltf.values<std::uint16_t>(5123, "SCALAR", {0, 1, 2, 0, 2, 3});
  const int u32 = gltf.values<std::uint32_t>(5125, "SCALAR", {0, 1, 2, 0, 2, 3});
  for (const int indices : {u8, u16, u32}) add_mesh(attributes, {{"indices", indices}});
  add_mesh({{"POSITION", unindexed}});
  for (const char* name : {"test.gltf", "test.glb"}) {
    const scene::Scene scene = load(name);
    ASSERT_EQ(scene.meshes.size(), 4u);
    for (int i = 0; i < 3; ++i) {
      EXPECT_EQ(scene.meshes[i].positions, square);
      EXPECT_THAT(scene.meshes[i].triangles, ElementsAre(glm::uvec3(0, 1, 2), glm::uvec3(0, 2, 3)));
    }
    EXPECT_THAT(scene.meshes[3].triangles, ElementsAre(glm::uvec3(0, 1, 2)));
    EXPECT_THAT(scene.notes, IsEmpty());
  }
}

TEST_F(GltfMesh, TurnsStripsAndFansIntoTriangles) {
  const std::vector<glm::vec3> zigzag = {{0, 0, 0}, {0, 1, 0}, {1, 0, 0}, {1, 1, 0}, {2, 0, 0}};
  const std::vector<glm::vec3> wheel = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {-1, 1, 0}};
  const int normals = gltf.normals({5, {0, 0, 1}}), down = gltf.normals({5, {0, 0, -1}});
  add_mesh({{"POSITION", gltf.positions(zigzag)}, {"NORMAL", down}}, {{"mode", 5}});
  add_mesh({{"POSITION", gltf.positions(wheel)}, {"NORMAL", normals}}, {{"mode", 6}});
  const scene::Scene scene = load();
  ASSERT_EQ(scene.meshes.size(), 2u);
  EXPECT_THAT(scene.meshes[0].triangles,
              ElementsAre(glm::uvec3(0, 1, 2), glm::uvec3(1, 3, 2), glm::uvec3(2, 3, 4)));
  EXPECT_THAT(scene.meshes[1].triangles,
              ElementsAre(glm::uvec3(1, 2, 0), glm::uvec3(2, 3, 0), glm::uvec3(3, 4, 0)));
  EXPECT_THAT(scene.notes, IsEmpty());  // every triangle faces its normals
}

TEST_F(GltfMesh, SkipsPointsAndLinesWithANote) {
  const int positions = gltf.positions(square);
  for (int mode = 0; mode < 4; ++mode) add_mesh({{"POSITION", positions}}, {{"mode", mode}});
  gltf.root("t", gltf.triangle_mesh());
  const scene::Scene scene = load();
  EXPECT_EQ(scene.instances.size(), 1u);
  EXPECT_EQ(scene.notes.size(), 4u);
  EXPECT_THAT(scene.notes, Contains(HasSubstr("points and lines are not supported; skipped")));
}

TEST_F(GltfMesh, MakesFlatNormalsWhereThereAreNone) {
  // Two faces of a roof that share an edge: the shared vertices are split.
  add_mesh({{"POSITION", gltf.positions({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}})},
            {"TEXCOORD_0", gltf.uvs({{0, 0}, {1, 0}, {0, 1}, {1, 1}})}},
           {{"indices", gltf.indices({0, 1, 2, 0, 2, 3})}});
  const scene::Scene scene = load();
  const scene::Mesh& mesh = scene.meshes.at(0);
  const glm::vec3 z(0, 0, 1), x(1, 0, 0);
  EXPECT_THAT(mesh.normals, ElementsAre(z, z, z, x, x, x));
  EXPECT_THAT(mesh.triangles, ElementsAre(glm::uvec3(0, 1, 2), glm::uvec3(3, 4, 5)));
  EXPECT_EQ(mesh.uvs.size(), 6u);
  EXPECT_EQ(mesh.uvs[5], glm::vec2(1, 1));
  EXPECT_EQ(mesh.positions[5], glm::vec3(0, 0, 1));
}

TEST_F(GltfMesh, AppliesSparseReplacements) {
  const int base = gltf.positions(square);
  const int indices = gltf.view(GltfWriter::bytes_of(std::vector<std::uint16_t>{1, 2}));
  const int values = gltf.view(GltfWriter::bytes_of(std::vector<glm::vec3>{{2, 0, 0}, {2, 2, 0}}));
  const Json sparse = {{"count", 2},
                       {"indices", {{"bufferView", indices}, {"componentType", 5123}}},
                       {"values", {{"bufferView", values}}}};
  gltf.json["accessors"][base]["sparse"] = sparse;
  // The same over zeros: no buffer view at all.
  const int over_zeros = gltf.accessor(-1, 5126, "VEC3", 4);
  gltf.json["accessors"][over_zeros]["sparse"] = sparse;
  add_mesh({{"POSITION", base}}, {{"indices", gltf.indices({0, 1, 2, 0, 2, 3})}});
  add_mesh({{"POSITION", over_zeros}}, {{"indices", gltf.indices({0, 1, 2})}});
  const scene::Scene scene = load();
  EXPECT_EQ(scene.meshes.at(0).positions[1], glm::vec3(2, 0, 0));
  EXPECT_EQ(scene.meshes.at(0).positions[2], glm::vec3(2, 2, 0));
  EXPECT_THAT(scene.meshes.at(1).positions,
              ElementsAre(glm::vec3(0), glm::vec3(2, 0, 0), glm::vec3(2, 2, 0)));
}

TEST_F(GltfMesh, ReadsQuantisedAttributesAndStrides) {
  gltf.json["extensionsUsed"] = {"KHR_mesh_quantization"};
  // Interleaved, stride 12: int16 position (3, padded), int8 normalised normal (3, padded).
  struct Vertex {
    std::int16_t position[3], padding;
    std::int8_t normal[4];
  };
  const std::vector<Vertex> vertices = {{{0, 0, 0}, 0, {0, 0, 127, 0}},
                                        {{300, 0, 0}, 0, {0, 0, 127, 0}},
                                        {{0, -200, 0}, 0, {0, 0, -128, 0}}};
  const int view = gltf.view(GltfWriter::bytes_of(vertices), sizeof(Vertex));
  const Json attributes = {
      {"POSITION", gltf.accessor(view, 5122, "VEC3", 3)},
      {"NORMAL", gltf.accessor(view, 5120, "VEC3", 3, true, offsetof(Vertex, normal))},
      {"TEXCOORD_0",
       gltf.values<std::uint16_t>(5123, "VEC2", {0, 65535, 32768, 0, 65535, 65535}, true)}};
  gltf.json["accessors"][2]["count"] = 3;  // six numbers, three pairs
  add_mesh(attributes);
  gltf.json["extensionsRequired"] = {"KHR_mesh_quantization"};
  const scene::Scene scene = load();
  const scene::Mesh& mesh = scene.meshes.at(0);
  EXPECT_THAT(mesh.positions,
              ElementsAre(glm::vec3(0), glm::vec3(300, 0, 0), glm::vec3(0, -200, 0)));
  // (0,0,0) (300,0,0) (0,-200,0) winds to -Z: the two normals that do not are turned round.
  EXPECT_THAT(mesh.normals,
              ElementsAre(glm::vec3(0, 0, -1), glm::vec3(0, 0, -1), glm::vec3(0, 0, -1)));
  EXPECT_THAT(scene.notes, ElementsAre(HasSubstr("2 normals point to the back")));
  EXPECT_EQ(mesh.uvs[0], glm::vec2(0, 1));
  EXPECT_FLOAT_EQ(mesh.uvs[1].x, 32768.0f / 65535.0f);
}

TEST_F(GltfMesh, DropsAndCountsWhatCannotBeTraced) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<glm::vec3> positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0},    {nan, 0, 0},
                                            {2, 0, 0}, {9, 9, 9}, {1e20f, 0, 0}};
  const int indices = gltf.indices({0, 1, 3,  // NaN
                                    0, 1, 4,  // collinear
                                    0, 2, 6,  // beyond any stage
                                    1, 1, 2,  // a point twice
                                    0, 1, 2,  // good
                                    0, 1});   // incomplete
  add_mesh({{"POSITION", gltf.positions(positions)}, {"NORMAL", gltf.normals({7, {0, 0, 1}})}},
           {{"indices", indices}});
  const scene::Scene scene = load();
  EXPECT_THAT(scene.meshes.at(0).triangles, ElementsAre(glm::uvec3(0, 1, 2)));
  EXPECT_EQ(scene.meshes[0].positions.size(), 3u);  // unused vertices are gone
  EXPECT_THAT(scene.notes,
              ElementsAre(HasSubstr("the last triangle is incomplete"),
                          HasSubstr("2 triangles have positions that are not a number"),
                          HasSubstr("2 triangles have no area; dropped")));
}

TEST_F(GltfMesh, MakesNormalsUnitAndReplacesThoseThatAreNone) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  add_mesh({{"POSITION", gltf.positions(square)},
            {"NORMAL", gltf.normals({{0, 0, 0.5f}, {0, 0, 0}, {nan, 0, 1}, {0, 3, 4}})}},
           {{"indices", gltf.indices({0, 1, 2, 0, 2, 3})}});
  const scene::Scene scene = load();
  const glm::vec3 z(0, 0, 1);
  EXPECT_THAT(scene.meshes.at(0).normals, ElementsAre(z, z, z, glm::vec3(0, 0.6f, 0.8f)));
  EXPECT_THAT(scene.notes, ElementsAre(HasSubstr("2 normals are no direction")));
}

TEST_F(GltfMesh, NotesEmptyMeshesAndSkipsThem) {
  gltf.root("none", gltf.add("meshes", {{"name", "none"}, {"primitives", Json::array()}}));
  add_mesh({{"POSITION", gltf.positions({3, {1, 1, 1}})}});
  add_mesh({{"NORMAL", gltf.normals({3, {0, 0, 1}})}});
  const scene::Scene scene = load();
  EXPECT_THAT(scene.instances, IsEmpty());
  EXPECT_THAT(scene.meshes, IsEmpty());
  EXPECT_THAT(scene.notes, Contains(HasSubstr("mesh 0: has no primitives; skipped")));
  EXPECT_THAT(scene.notes, Contains(HasSubstr("is empty; skipped")));
  EXPECT_THAT(scene.notes, Contains(HasSubstr("has no positions; skipped")));
  EXPECT_THAT(scene.notes, Contains(HasSubstr("has nothing visible in it")));
}

TEST_F(GltfMesh, SharesGeometryBetweenNodesAndMaterials) {
  const int positions = gltf.positions(square);
  const int indices = gltf.indices({0, 1, 2, 0, 2, 3});
  const auto primitive = [&](int material) {
    return Json{
        {"attributes", {{"POSITION", positions}}}, {"indices", indices}, {"material", material}};
  };
  gltf.add("materials", {{"name", "red"}});
  gltf.add("materials", {{"name", "blue"}});
  const int red = gltf.mesh(primitive(0)), blue = gltf.mesh(primitive(1));
  gltf.root("a", red);
  gltf.root("b", red);
  gltf.root("c", blue);
  object.presence = set::Presence::phantom;
  set::Object again;  // the same file once more, as another object
  again.file = directory.path() / "." / "test.gltf";
  a_set.objects = {again};
  const scene::Scene scene = load();
  EXPECT_EQ(scene.meshes.size(), 1u);
  EXPECT_EQ(scene.materials.size(), 2u);
  ASSERT_EQ(scene.instances.size(), 6u);
  EXPECT_EQ(scene.instances[0].material, scene.instances[1].material);
  EXPECT_NE(scene.instances[0].material, scene.instances[2].material);
  EXPECT_EQ(scene.instances[2].object, 0u);
  EXPECT_EQ(scene.instances[3].object, 1u);
  EXPECT_EQ(scene.instances[2].presence, scene::world_both);
  EXPECT_EQ(scene.instances[3].presence, scene::world_mixed);
}

TEST_F(GltfMesh, NamesFileMeshAndPrimitiveOfBadIndicesAndAccessors) {
  gltf.root("a", gltf.mesh(Json::object(), "statue"));
  const auto message_of = [&](const Json& primitive) {
    return error_with("/meshes/0/primitives/0", primitive);
  };
  const int positions = gltf.positions(square);
  const std::string at = (directory / "test.gltf").string() + ": mesh 0 \"statue\", primitive 0";
  EXPECT_EQ(
      message_of({{"attributes", {{"POSITION", positions}}}, {"indices", gltf.indices({0, 1, 4})}}),
      at + ": index 4 is outside its 4 vertices");
  EXPECT_EQ(message_of({{"attributes", {{"POSITION", 99}}}}), at + ", positions: no accessor 99");
  EXPECT_EQ(message_of({{"attributes", {{"POSITION", gltf.uvs({3, {0, 0}})}}}}),
            at + ", positions: must have 3 components an element");
  EXPECT_EQ(message_of({{"attributes", {{"POSITION", positions}}},
                        {"indices", gltf.values<float>(5126, "SCALAR", {0, 1, 2})}}),
            at + ", indices: indices must be unsigned scalars of 1, 2 or 4 bytes");
  EXPECT_EQ(message_of({{"attributes",
                         {{"POSITION", positions}, {"NORMAL", gltf.normals({3, {0, 0, 1}})}}}}),
            at + ": its attributes have different numbers of elements");
  EXPECT_EQ(message_of({{"attributes", {{"POSITION", positions}}}, {"mode", 7}}),
            at + ": mode 7 is not one of glTF's");
}

TEST_F(GltfMesh, RefusesAbsurdSizesBeforeAllocating) {
  const int positions = gltf.positions(square);
  add_mesh({{"POSITION", positions}});
  const std::string accessor = "/accessors/" + std::to_string(positions);
  expect_refused({
      {accessor + "/count", 5, "5 elements do not fit into a view of 48 bytes"},
      {accessor + "/count", 4000000000u, "4000000000 elements are more than its data can hold"},
      {accessor + "/byteOffset", 1ull << 53, "do not fit into a view"},
      {accessor + "/byteOffset", 1, "do not fit into a view"},
  });
  gltf.json["accessors"][positions].erase("bufferView");
  expect_refused({{accessor + "/count", 1u << 30, "more than its data can hold"}});
}

// glTF 2.0, 3.7.2.1: factors of the base colour, linear, brought into 0 to 1.
TEST_F(GltfMesh, ReadsVertexColours) {
  const int positions = gltf.positions({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}});
  const auto colored = [&](int colors) {
    add_mesh({{"POSITION", positions}, {"COLOR_0", colors}});
  };
  colored(gltf.values<glm::vec3>(5126, "VEC3", {{0, 0.25f, 0.5f}, {1, 1, 1}, {0, 0, 0}}));
  colored(gltf.accessor(gltf.view({255, 51, 0, 102, 0, 0, 0, 255, 255, 255, 255, 255}, 4), 5121,
                        "VEC4", 3, true));
  const std::vector<std::uint16_t> words = {65535, 0, 13107, 0, 0, 65535, 0, 0, 0, 0, 0, 0};
  colored(gltf.accessor(gltf.view(GltfWriter::bytes_of(words), 8), 5123, "VEC3", 3, true));
  colored(gltf.values<glm::vec3>(5126, "VEC3", {{2, -1, std::nanf("")}, {1, 1, 1}, {0, 0, 0}}));
  colored(gltf.values<glm::vec3>(5126, "VEC3", {{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}));
  const scene::Scene scene = load();
  ASSERT_EQ(scene.meshes.size(), 5u);
  EXPECT_EQ(scene.meshes[0].colors[0], glm::vec4(0, 0.25f, 0.5f, 1));
  EXPECT_EQ(scene.meshes[1].colors[0], glm::vec4(1, 0.2f, 0, 0.4f));
  EXPECT_EQ(scene.meshes[2].colors[0], glm::vec4(1, 0, 0.2f, 1));
  EXPECT_EQ(scene.meshes[3].colors[0], glm::vec4(1, 0, 1, 1));
  EXPECT_TRUE(scene.meshes[4].colors.empty());  // white changes nothing
  EXPECT_THAT(scene.notes, ElementsAre(HasSubstr("1 vertex colour is outside of 0 to 1")));
}

// A square with an upright texture (v runs down) and a normal map.
class GltfTangents : public GltfTest {
 protected:
  void SetUp() override {
    gltf.add("materials", {{"normalTexture", {{"index", gltf.texture(1, 1, {9, 9, 9, 255})}}}});
    add_mesh({{"POSITION", gltf.positions(square)},
              {"NORMAL", gltf.normals({4, {0, 0, 1}})},
              {"TEXCOORD_0", gltf.uvs({{0, 1}, {1, 1}, {1, 0}, {0, 0}})}},
             {{"indices", gltf.indices({0, 1, 2, 0, 2, 3})}, {"material", 0}});
  }

  std::vector<glm::vec4> kept(const std::vector<glm::vec4>& given) {
    first_primitive()["attributes"]["TANGENT"] = gltf.values<glm::vec4>(5126, "VEC4", given);
    return load().meshes.at(0).tangents;
  }
  static glm::vec4 turned(double degrees) {
    const double angle = glm::radians(degrees);
    return {std::cos(angle), std::sin(angle), 0, 1};
  }
};

// glTF 2.0, 3.7.2.1. +Y of a normal map is up in the picture: cross((0, 0, 1), (1, 0, 0)) * 1.
TEST_F(GltfTangents, AreKeptWhereTheyAreNotThoseOfTheCoordinates) {
  EXPECT_THAT(load().meshes.at(0).tangents, IsEmpty());
  EXPECT_THAT(kept({4, {1, 0, 0, 1}}), IsEmpty());
  EXPECT_THAT(kept({4, turned(0.5)}), IsEmpty());
  for (const glm::vec4& other : {turned(2), glm::vec4(-1, 0, 0, -1), glm::vec4(1, 0, 0, -1)})
    EXPECT_EQ(kept({4, other}), std::vector<glm::vec4>(4, other));
  EXPECT_EQ(kept({4, {0, 3, 0, 1}}), std::vector<glm::vec4>(4, {0, 1, 0, 1}));
  const Json uvs = first_primitive()["attributes"]["TEXCOORD_0"];
  first_primitive()["attributes"].erase("TEXCOORD_0");
  EXPECT_EQ(kept({4, {1, 0, 0, 1}}).size(), 4u);
}

TEST_F(GltfTangents, MayBeQuantised) {
  first_primitive()["attributes"]["TANGENT"] =
      gltf.accessor(gltf.view({0, 127, 0, 129, 0, 127, 0, 129, 0, 127, 0, 129, 0, 127, 0, 129}),
                    5120, "VEC4", 4, true);
  gltf.json["extensionsRequired"] = {"KHR_mesh_quantization"};
  EXPECT_EQ(load().meshes.at(0).tangents, std::vector<glm::vec4>(4, {0, 1, 0, -1}));
}

TEST_F(GltfTangents, AreReadOnlyWhereDirectionsMatter) {
  ASSERT_EQ(kept({4, {0, 1, 0, 1}}).size(), 4u);
  const Json normals = first_primitive()["attributes"]["NORMAL"];
  first_primitive()["attributes"].erase("NORMAL");  // to be ignored then
  EXPECT_THAT(load().meshes.at(0).tangents, IsEmpty());
  first_primitive()["attributes"]["NORMAL"] = normals;
  gltf.json["materials"][0] = Json::object();
  EXPECT_THAT(load().meshes.at(0).tangents, IsEmpty());
  gltf.json["materials"][0]["extensions"]["KHR_materials_anisotropy"]["anisotropyStrength"] = 0.5;
  EXPECT_EQ(load().meshes.at(0).tangents.size(), 4u);
}

TEST_F(GltfTangents, ThatAreNoDirectionOrDeformAreNoted) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(kept({{0, 1, 0, 1}, {0, 0, 0, 1}, {nan, 0, 0, 1}, {0, 1, 0, 0}}),
            (std::vector<glm::vec4>{{0, 1, 0, 1}, {}, {}, {}}));
  EXPECT_THAT(load().notes, ElementsAre(HasSubstr("3 tangents are no direction")));
  first_primitive()["targets"] = {{{"POSITION", gltf.positions(square)}}};
  gltf.json["meshes"][0]["weights"] = {1};
  EXPECT_THAT(kept({4, {0, 1, 0, 1}}), IsEmpty());
  EXPECT_THAT(load().notes, Contains(HasSubstr("deforms, so that its tangents are not used")));
  EXPECT_THAT(kept({4, {1, 0, 0, 1}}), IsEmpty());
  EXPECT_THAT(load().notes, Not(Contains(HasSubstr("tangents"))));
}

// Of a normal that is turned to the front, +Y stays where it was.
TEST_F(GltfTangents, KeepTheirPlusYWhereANormalIsTurned) {
  first_primitive()["attributes"]["NORMAL"] = gltf.normals({4, {0, 0, -1}});
  EXPECT_EQ(kept({4, {0, 1, 0, -1}}), std::vector<glm::vec4>(4, {0, 1, 0, 1}));
}

}  // namespace previz::test::gltf_mesh_test
