// Which types the numbers of a glTF file may have.
#include "tests/support/gltf_test.hpp"

namespace previz::test::gltf_components_test {

constexpr int byte = 5120, ubyte = 5121, short_ = 5122, ushort_ = 5123, uint_ = 5125, float_ = 5126;

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

using VertexColors = GltfComponents;

TEST_F(VertexColors, AreReadOfEveryTypeThatGltfHasForThem) {
  const std::vector<std::uint8_t> violet = {255, 0, 51, 0, 255, 0, 51, 0, 255, 0, 51, 0};
  for (const bool normalized : {true, false}) {
    triangle<std::uint8_t>("COLOR_0", ubyte, "VEC4", violet, normalized);
    EXPECT_EQ(load().meshes[0].colors[0], glm::vec4(1, 0, 0.2f, 0)) << normalized;
  }
  triangle<std::int8_t>("COLOR_0", byte, "VEC3", std::vector<std::int8_t>(12, 1), true);
  EXPECT_NE(error(), "");
  triangle<float>("COLOR_0", float_, "VEC2", std::vector<float>(12, 1), false);
  EXPECT_NE(error(), "");
}

}  // namespace previz::test::gltf_components_test
