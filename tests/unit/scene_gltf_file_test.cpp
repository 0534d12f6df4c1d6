#include <fstream>

#include "tests/support/gltf_test.hpp"

namespace previz::test {
namespace scene_gltf_file_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Json = GltfWriter::Json;

class GltfFiles : public GltfTest {
 protected:
  std::string error_of(const std::string& bytes) {
    std::ofstream(directory / "raw", std::ios::binary) << bytes;
    set::Set set;
    set.objects.resize(1);
    set.objects[0].file = directory / "raw";
    try {
      scene::load_scene(set);
    } catch (const Error& thrown) {
      return thrown.what();
    }
    return "";
  }
  std::string saved(const char* name) {
    gltf.save(directory / name);
    std::ifstream stream(directory / name, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
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
  gltf.json["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  EXPECT_EQ(error(), (directory / "test.gltf").string() +
                         ": requires the extension \"KHR_draco_mesh_compression\", which is not "
                         "supported; export the file without compression of meshes, or "
                         "decompress it: gltf-transform copy IN OUT");
  gltf.json["extensionsRequired"] = {"EXT_texture_webp"};
  EXPECT_THAT(error(), HasSubstr("textures in PNG or JPEG"));
}

TEST_F(GltfFiles, NotesWhatIsNotShown) {
  gltf.root("a", gltf.triangle_mesh());
  gltf.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = 0;
  gltf.json["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 1}, {"znear", 1}}}}};
  gltf.json["animations"] = {
      {{"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}},
       {"samplers", {{{"input", 0}, {"output", 0}}}}}};
  EXPECT_THAT(load().notes, ElementsAre(HasSubstr("has 1 cameras; ignored"),
                                        HasSubstr("none of its 1 animations")));
}

TEST_F(GltfFiles, ReadsBuffersBeside) {
  gltf.root("a", gltf.triangle_mesh());
  std::string text = saved("test.gltf");
  Json json = Json::parse(text);
  const std::vector<glm::vec3> positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const auto bytes = GltfWriter::bytes_of(positions);
  std::ofstream(directory / "data.bin", std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<long>(bytes.size()));
  json["buffers"][0]["uri"] = "data.bin";
  EXPECT_EQ(error_of(json.dump()), "");
  json["buffers"][0]["uri"] = "lost.bin";
  EXPECT_THAT(error_of(json.dump()), HasSubstr("lost.bin"));
  json["buffers"][0]["uri"] = "/dev/zero";
  EXPECT_THAT(error_of(json.dump()), HasSubstr("is not a valid glTF file"));
}

TEST_F(GltfFiles, NamesFilesThatAreNoGltf) {
  const std::string file = (directory / "raw").string();
  object.file = directory / "missing.glb";
  set::Set set;
  set.objects = {object};
  EXPECT_THROW(
      try { scene::load_scene(set); } catch (const Error& thrown) {
        EXPECT_THAT(thrown.what(),
                    HasSubstr("missing.glb: cannot be opened: there is no such file"));
        throw;
      },
      Error);
  set.objects[0].file = directory.path();
  EXPECT_THROW(
      try { scene::load_scene(set); } catch (const Error& thrown) {
        EXPECT_THAT(thrown.what(), HasSubstr("it is not a regular file"));
        throw;
      },
      Error);
  EXPECT_THAT(error_of(""), HasSubstr(file + ": is not a valid glTF file"));
  EXPECT_THAT(error_of("hello there"), HasSubstr(file + ": is not a valid glTF file"));
  EXPECT_THAT(error_of(R"({"asset": {"version": "1.0"}})"), HasSubstr("only version 2"));
  EXPECT_THAT(error_of(R"({"scenes": []})"), HasSubstr("asset"));
  EXPECT_THAT(error_of(std::string(300000, '[')), HasSubstr("nested more than 128 levels deep"));
  std::string deep = R"({"asset": {"version": "2.0", "extras": )";
  deep += std::string(100000, '[') + std::string(100000, ']') + "}}";
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

}  // namespace scene_gltf_file_test
}  // namespace previz::test
