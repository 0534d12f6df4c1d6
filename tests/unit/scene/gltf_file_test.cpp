#include "tests/support/gltf_test.hpp"
#include "tests/support/session_fixture.hpp"

namespace previz::test::gltf_file_test {

class GltfFiles : public GltfTest {
 protected:
  static std::string error_of_file(const std::filesystem::path& file) {
    return test::error_of([&] { scene::load_scene(set_of(file)); });
  }
  std::string error_of(const std::string& bytes) {
    session::write_content(directory / "raw", bytes);
    return error_of_file(directory / "raw");
  }
  std::string saved(const char* name) {
    gltf.save(directory / name);
    return session::content_of(directory / name);
  }
};

TEST_F(GltfFiles, RefusesRequiredExtensionsAndNotesUsedOnes) {
  gltf.root("a", gltf.triangle_mesh());
  gltf.json["extensionsUsed"] = {"KHR_materials_iridescence", "KHR_materials_ior"};
  const std::string note = (directory / "test.gltf").string() +
                           ": the extension \"KHR_materials_iridescence\" is not supported; "
                           "ignored: soap bubbles and films of oil do not change colour with the "
                           "angle of view";
  EXPECT_THAT(load().notes, ElementsAre(note));
  for (const char* name : {"bubble", "oil", "beetle", "shell", "peacock"})
    gltf.add("materials",
             {{"name", name},
              {"extensions", {{"KHR_materials_iridescence", {{"iridescenceFactor", 1}}}}}});
  EXPECT_THAT(load().notes,
              ElementsAre(note + " (materials: \"bubble\", \"oil\", \"beetle\" and 2 more)"));
  gltf.json["extensionsUsed"] = {"KHR_materials_dispersion", "KHR_materials_diffuse_transmission",
                                 "EXT_of_someone"};
  EXPECT_THAT(load().notes, ElementsAre(HasSubstr("glass does not split light into its colours"),
                                        HasSubstr("lampshades are dark where light comes from"),
                                        HasSubstr("\"EXT_of_someone\" is not supported; ignored")));
  gltf.json["extensionsRequired"] = {"EXT_of_someone"};
  EXPECT_EQ(error(), (directory / "test.gltf").string() +
                         ": requires the extension \"EXT_of_someone\", which is not supported; "
                         "export the file without it");
  gltf.json["extensionsRequired"] = {"KHR_texture_basisu"};
  EXPECT_THAT(error(), HasSubstr("textures in PNG, JPEG or WebP"));
}

// The parser would stop at what such a file lacks: the extension is what the message is about.
TEST_F(GltfFiles, NamesARequiredExtensionBeforeWhatIsMissingForIt) {
  gltf.json["extensionsRequired"] = {"KHR_texture_basisu"};
  gltf.json["textures"] = {{{"extensions", {{"KHR_texture_basisu", {{"source", 0}}}}}}};
  gltf.json["buffers"] = {{{"byteLength", 12}}};
  EXPECT_THAT(error(), HasSubstr("requires the extension \"KHR_texture_basisu\""));
}

TEST_F(GltfFiles, IgnoresRequiredExtensionsThatOnlyChangeLooks) {
  gltf.root("a", gltf.triangle_mesh(gltf.add("materials", {{"name", "sign"}})));
  gltf.json["materials"][0]["extensions"]["KHR_materials_unlit"] = Json::object();
  for (const char* key : {"extensionsUsed", "extensionsRequired"})
    gltf.json[key] = {"KHR_materials_unlit"};
  EXPECT_THAT(load().notes,
              ElementsAre(HasSubstr("\"KHR_materials_unlit\", which the file requires, is not "
                                    "supported; ignored: unlit materials are lit like all others "
                                    "(materials: \"sign\")")));
}

TEST_F(GltfFiles, RefusesOtherVersionsByName) {
  const auto text = [](const std::string& asset) { return R"({"asset": )" + asset + "}"; };
  const std::string old = "is glTF 1.0; previzd reads glTF 2.0: convert it with \"gltf-pipeline";
  EXPECT_THAT(error_of(text(R"({"version": "1.0"})")), HasSubstr(old));
  EXPECT_THAT(error_of(R"({"meshes": {"a": {"primitives": []}}, "shaders": {}})"), HasSubstr(old));
  // A binary container of version 1: the length of its content and that content's format follow.
  const std::string content = R"({"asset": {"version": "1.0"}})";
  std::string binary("glTF\1\0\0\0", 8);
  for (const std::size_t number : {20 + content.size(), content.size(), std::size_t{0}})
    for (int shift = 0; shift < 32; shift += 8)
      binary.push_back(static_cast<char>(number >> shift & 0xff));
  EXPECT_THAT(error_of(binary + content), HasSubstr(old));
  EXPECT_THAT(error_of(text(R"({"version": "1.1"})")),
              HasSubstr("is glTF 1.1; previzd reads glTF 2.0: export it again as glTF 2.0"));
  EXPECT_THAT(error_of(text(R"({"version": "3.0"})")), HasSubstr("is glTF 3.0; previzd reads"));
  EXPECT_THAT(error_of(text(R"({"version": "2.1", "minVersion": "2.1"})")),
              HasSubstr("asks for a reader of glTF 2.1"));
  EXPECT_THAT(error_of(text(R"({"version": 2})")), HasSubstr("has no asset.version"));
}

TEST_F(GltfFiles, RefusesNumbersThatAreNotWholeByTheirPlace) {
  gltf.root("a", gltf.triangle_mesh());
  gltf.add("materials", {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}},
                         {"extras", {{"someTexture", {{"index", -1}}}}}});
  ASSERT_EQ(error(), "");
  expect_refused({
      {"/accessors/0/byteOffset", -4, "accessors[0].byteOffset is -4; it must be a whole number"},
      {"/accessors/0/byteOffset", 1e300, "accessors[0].byteOffset is 1e+300;"},
      {"/accessors/0/count", 2.5, "accessors[0].count is 2.5;"},
      {"/accessors/0/count", "3", "accessors[0].count is \"3\";"},
      {"/accessors/0/bufferView", 4294967296, "from 0 to 2147483647; export the file again"},
      {"/bufferViews/0/byteStride", -12, "bufferViews[0].byteStride is -12;"},
      {"/bufferViews/0/byteLength", 1e16, "from 0 to 9007199254740992;"},
      {"/meshes/0/primitives/0/attributes/POSITION", -1,
       "meshes[0].primitives[0].attributes.POSITION is -1;"},
      {"/nodes/0/mesh", 0.5, "nodes[0].mesh is 0.5;"},
      {"/scenes/0/nodes/0", nullptr, "scenes[0].nodes[0] is null;"},
      {"/materials/0/pbrMetallicRoughness/baseColorTexture/index", -1,
       "materials[0].pbrMetallicRoughness.baseColorTexture.index is -1;"},
  });
}

// tinygltf 2.7 takes 3.0 for a missing number.
TEST_F(GltfFiles, TakeWholeNumbersWithAPoint) {
  gltf.root("a", gltf.triangle_mesh());
  gltf.json["accessors"][0]["count"] = 3.0;
  gltf.json["nodes"][0]["mesh"] = 0.0;
  for (const char* name : {"test.gltf", "test.glb"}) EXPECT_EQ(load(name).instances.size(), 1u);
}

TEST_F(GltfFiles, NotesWhatIsNotShown) {
  gltf.root("a", gltf.triangle_mesh());
  first_primitive()["attributes"]["COLOR_0"] = 0;
  gltf.json["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 1}, {"znear", 1}}}}};
  gltf.json["animations"] = Json::array({gltf.animation(0, "translation", {0}, 0)});
  EXPECT_THAT(load().notes,
              ElementsAre(HasSubstr("has 1 cameras; ignored"), HasSubstr("plays no animation")));
}

TEST_F(GltfFiles, ReadsBuffersBeside) {
  gltf.root("a", gltf.triangle_mesh());
  Json json = Json::parse(saved("test.gltf"));
  const std::vector<glm::vec3> positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const auto bytes = GltfWriter::bytes_of(positions);
  session::write_content(directory / "data.bin", {bytes.begin(), bytes.end()});
  const auto error_from = [&](const char* uri) {
    json["buffers"][0]["uri"] = uri;
    return error_of(json.dump());
  };
  EXPECT_EQ(error_from("data.bin"), "");
  for (const char* lost : {"lost.bin", "/dev/zero"})
    EXPECT_THAT(error_from(lost), HasSubstr(std::string("buffer 0 \"") + lost +
                                            "\": not found; put it beside the file"));
}

TEST_F(GltfFiles, NamesFilesThatAreNoGltf) {
  const std::string file = (directory / "raw").string();
  EXPECT_THAT(error_of_file(directory / "missing.glb"),
              HasSubstr("missing.glb: cannot be opened: file not found"));
  EXPECT_THAT(error_of_file(directory.path()), HasSubstr("it is not a regular file"));
  EXPECT_THAT(error_of(""), HasSubstr(file + ": is not a valid glTF file"));
  EXPECT_THAT(error_of("hello there"), HasSubstr(file + ": is not a valid glTF file"));
  EXPECT_THAT(error_of(R"({"asset": {"version": "1.0"}})"), HasSubstr("is glTF 1.0"));
  EXPECT_THAT(error_of(R"({"scenes": []})"), HasSubstr("asset"));
  EXPECT_THAT(error_of(std::string(129, '[')), HasSubstr("nested more than 128 levels deep"));
  std::string deep = R"({"asset": {"version": "2.0", "extras": )";
  deep += std::string(129, '[') + std::string(129, ']') + "}}";
  EXPECT_THAT(error_of(deep), HasSubstr("nested more than 128 levels deep"));
}

TEST_F(GltfFiles, RefusesBinaryFilesThatAreCutShort) {
  gltf.root("a", gltf.triangle_mesh());
  const std::string whole = saved("test.glb");
  ASSERT_EQ(error_of(whole), "");
  EXPECT_THAT(error_of(whole.substr(0, 16)), HasSubstr("at least 20 bytes"));
  EXPECT_THAT(error_of(whole.substr(0, whole.size() - 1)), HasSubstr("is cut short"));
  // The binary chunk eight bytes longer than what is there: within the file's length by the sum
  // that tinygltf makes.
  std::string longer = whole;
  const std::size_t json_length =
      static_cast<unsigned char>(whole[12]) | static_cast<unsigned char>(whole[13]) << 8;
  longer[20 + json_length] = static_cast<char>(longer[20 + json_length] + 8);
  EXPECT_THAT(error_of(longer), HasSubstr("runs past the end of the file"));
}

}  // namespace previz::test::gltf_file_test
