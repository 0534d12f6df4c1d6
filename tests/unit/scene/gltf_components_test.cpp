// Which types the numbers of a glTF file may have, and what colours of vertices are.
#include "daemon/scene/gltf_accessor.hpp"
#include "tests/support/gltf_test.hpp"

namespace previz::test::gltf_components_test {

constexpr int byte = 5120, ubyte = 5121, short_ = 5122, ushort_ = 5123, uint_ = 5125;

class GltfComponents : public GltfTest {
 protected:
  // A triangle whose attribute has these integers, 4 (or fewer) a vertex in 4 of their type.
  template <typename T>
  void triangle(const char* attribute, int type, const char* shape, const std::vector<T>& values,
                bool normalized) {
    gltf = {};
    gltf.root("a", gltf.triangle_mesh());
    const int view = gltf.view(GltfWriter::bytes_of(values), 4 * sizeof(T));
    first_primitive()["attributes"][attribute] = gltf.accessor(view, type, shape, 3, normalized);
  }
};

TEST_F(GltfComponents, OfPositionsAreFloatsOrSmallIntegers) {
  triangle<std::uint32_t>("POSITION", uint_, "VEC3", {0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0}, false);
  EXPECT_THAT(error(),
              HasSubstr("positions: its numbers are unsigned ints; they must be floats, or "
                        "with KHR_mesh_quantization integers of 1 or 2 bytes"));
  triangle<std::uint16_t>("POSITION", ushort_, "VEC3", {0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0}, false);
  EXPECT_THAT(load().notes,
              ElementsAre(HasSubstr("POSITION of unsigned shorts needs KHR_mesh_quantization, "
                                    "which the file does not name in extensionsUsed")));
  gltf.json["extensionsUsed"] = {"KHR_mesh_quantization"};
  EXPECT_THAT(load().notes, IsEmpty());
}

TEST_F(GltfComponents, OfNormalsHaveASign) {
  triangle<std::uint8_t>("NORMAL", ubyte, "VEC3", std::vector<std::uint8_t>(12, 1), true);
  EXPECT_THAT(error(), HasSubstr("normals: its numbers are normalized unsigned bytes"));
  triangle<std::int8_t>("NORMAL", byte, "VEC3", {0, 0, 9, 0, 0, 0, 9, 0, 0, 0, 9, 0}, false);
  const scene::Scene loaded = load();
  EXPECT_THAT(loaded.notes, Contains(HasSubstr("NORMAL of bytes is not glTF; read as")));
  EXPECT_EQ(loaded.meshes[0].normals[0], glm::vec3(0, 0, 1));
}

TEST_F(GltfComponents, OfTextureCoordinates) {
  triangle<std::uint16_t>("TEXCOORD_0", ushort_, "VEC2",
                          {65535, 0, 0, 0, 0, 65535, 0, 0, 0, 0, 0, 0}, true);
  EXPECT_EQ(load().meshes[0].uvs[0], glm::vec2(1, 0));
  triangle<std::uint32_t>("TEXCOORD_0", uint_, "VEC2", std::vector<std::uint32_t>(12, 1), false);
  EXPECT_THAT(error(), HasSubstr("texture coordinates: its numbers are unsigned ints"));
}

TEST_F(GltfComponents, OfAnimationsAreFloatsOrNormalized) {
  gltf.root("a", gltf.triangle_mesh());
  const std::vector<std::int16_t> turns = {0, 0, 0, 32767, 0, 0, 32767, 0};
  const auto error_of = [&](bool normalized) {
    const int view = gltf.view(GltfWriter::bytes_of(turns));
    animate(0, "rotation", {0, 1}, gltf.accessor(view, short_, "VEC4", 2, normalized));
    return error();
  };
  EXPECT_EQ(error_of(true), "");
  EXPECT_THAT(error_of(false), HasSubstr("output: its numbers are shorts; they must be floats or "
                                         "normalized integers of 1 or 2 bytes"));
}

// The colours that an accessor of these bytes stands for.
std::vector<glm::vec4> read(const std::vector<unsigned char>& bytes, int component_type, int type,
                            bool normalized) {
  tinygltf::Model model;
  model.buffers.emplace_back().data = bytes;
  tinygltf::BufferView& view = model.bufferViews.emplace_back();
  view.buffer = 0;
  view.byteLength = bytes.size();
  tinygltf::Accessor& accessor = model.accessors.emplace_back();
  accessor.bufferView = 0;
  accessor.componentType = component_type;
  accessor.type = type;
  accessor.normalized = normalized;
  accessor.count = 1;
  return scene::read_colors(model, 0, "colours");
}

TEST(VertexColors, AreReadOfEveryTypeThatGltfHasForThem) {
  const auto floats = GltfWriter::bytes_of(std::vector<float>{0.25f, 2, 0.5f});
  EXPECT_THAT(read(floats, TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_VEC3, false),
              ElementsAre(glm::vec4(0.25f, 2, 0.5f, 1)));
  const auto words = GltfWriter::bytes_of(std::vector<std::uint16_t>{65535, 0, 65535, 0});
  EXPECT_THAT(read(words, TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, TINYGLTF_TYPE_VEC4, true),
              ElementsAre(glm::vec4(1, 0, 1, 0)));
  for (const bool normalized : {true, false})
    EXPECT_THAT(read({255, 0, 51, 0}, TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE, TINYGLTF_TYPE_VEC4,
                     normalized),
                ElementsAre(glm::vec4(1, 0, 0.2f, 0)));
  EXPECT_THROW(read({1, 2, 3}, TINYGLTF_COMPONENT_TYPE_BYTE, TINYGLTF_TYPE_VEC3, true), Error);
  EXPECT_THROW(read(floats, TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_VEC2, false), Error);
}

}  // namespace previz::test::gltf_components_test
