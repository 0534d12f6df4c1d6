// Compressed glTF meshes against the same meshes uncompressed, and what is refused of them.
#include <meshoptimizer.h>

#include "tests/support/gltf_compressed.hpp"
#include "tests/support/gltf_test.hpp"

namespace previz::test::gltf_compression_test {

using ::testing::SizeIs;

using Corners = std::array<std::uint32_t, 3>;

// Codecs may begin a triangle at another of its corners: here the least is the first.
Corners turned(Corners corners) {
  std::rotate(corners.begin(), std::ranges::min_element(corners), corners.end());
  return corners;
}

std::vector<Corners> triangles_of(const scene::Mesh& mesh) {
  std::vector<Corners> triangles;
  for (const glm::uvec3& triangle : mesh.triangles)
    triangles.push_back(turned({triangle.x, triangle.y, triangle.z}));
  return triangles;
}

std::vector<Corners> triangles_of(const Grid& grid) {
  std::vector<Corners> triangles;
  for (std::size_t i = 0; i < grid.indices.size(); i += 3)
    triangles.push_back(turned({grid.indices[i], grid.indices[i + 1], grid.indices[i + 2]}));
  return triangles;
}

class GltfCompression : public GltfTest {
 protected:
  scene::Mesh mesh(const char* name = "test.gltf") { return load(name).meshes.at(0); }
};

TEST_F(GltfCompression, OfMeshoptIsWithoutLoss) {
  gltf = plain_grid();
  const scene::Mesh plain = mesh();
  gltf = meshopt_grid();
  for (const char* name : {"test.gltf", "test.glb"}) {
    const scene::Mesh decoded = mesh(name);
    EXPECT_EQ(decoded.positions, plain.positions);
    EXPECT_EQ(decoded.normals, plain.normals);
    EXPECT_EQ(decoded.uvs, plain.uvs);
    EXPECT_EQ(triangles_of(decoded), triangles_of(plain));
  }
  EXPECT_THAT(load().notes, IsEmpty());
}

TEST_F(GltfCompression, OfIndicesInAnyOrder) {
  gltf = meshopt_grid();
  const Grid given = grid();
  std::vector<unsigned char> bytes(
      meshopt_encodeIndexSequenceBound(given.indices.size(), given.positions.size()));
  bytes.resize(meshopt_encodeIndexSequence(bytes.data(), bytes.size(), given.indices.data(),
                                           given.indices.size()));
  const int view = meshopt_view(gltf, bytes, "INDICES", given.indices.size(), 2);
  first_primitive()["indices"] = gltf.accessor(view, 5123, "SCALAR", given.indices.size());
  EXPECT_EQ(triangles_of(mesh()), triangles_of(given));
}

// Octahedral coordinates of 8 bits are half a step of 1/127 off at most, and the third component by
// both: (1/254, 1/254, 1/127). The vector before it is normalised is no shorter than 1/sqrt(3), so
// the direction is off by sqrt(3) sqrt(6) / 254 = 0.0167; rounding it to 8 bits adds sqrt(3) / 254.
TEST_F(GltfCompression, OfFilteredNormals) {
  gltf = meshopt_grid();
  const Grid given = grid();
  const std::size_t count = given.normals.size();
  std::vector<glm::vec4> normals;
  for (const glm::vec3& normal : given.normals) normals.emplace_back(normal, 0);
  std::vector<std::int8_t> filtered(4 * count);
  meshopt_encodeFilterOct(filtered.data(), count, 4, 8, &normals[0].x);
  const int view = meshopt_view(gltf, meshopt_vertices(filtered.data(), count, 4), "ATTRIBUTES",
                                count, 4, "OCTAHEDRAL");
  first_primitive()["attributes"]["NORMAL"] = gltf.accessor(view, 5120, "VEC3", count, true);
  const scene::Mesh decoded = mesh();
  for (std::size_t i = 0; i < count; ++i)
    EXPECT_LT(glm::distance(decoded.normals[i], given.normals[i]), 0.0235f) << i;
}

// A mantissa of 15 bits with its sign is half a step off, and steps are 2^-13 of the power of two
// above the largest component, which is 1 or less.
TEST_F(GltfCompression, OfFilteredPositions) {
  gltf = meshopt_grid();
  const Grid given = grid();
  const std::size_t count = given.positions.size();
  std::vector<std::uint32_t> filtered(3 * count);
#if MESHOPTIMIZER_VERSION >= 190
  meshopt_encodeFilterExp(filtered.data(), count, 12, 15, &given.positions[0].x,
                          meshopt_EncodeExpSharedVector);
#else
  meshopt_encodeFilterExp(filtered.data(), count, 12, 15, &given.positions[0].x);
#endif
  const int view = meshopt_view(gltf, meshopt_vertices(filtered.data(), count, 12), "ATTRIBUTES",
                                count, 12, "EXPONENTIAL");
  first_primitive()["attributes"]["POSITION"] = gltf.accessor(view, 5126, "VEC3", count);
  const scene::Mesh decoded = mesh();
  for (std::size_t i = 0; i < count; ++i)
    for (int k = 0; k < 3; ++k)
      EXPECT_NEAR(decoded.positions[i][k], given.positions[i][k], std::ldexp(1, -13)) << i;
}

// A quarter turn about Z. Components of 12 bits are half a step of sqrt(1/2) / 2047 off, which
// turns a unit vector by twice the error of the quaternion, 2 sqrt(3) 0.000173 and as much for the
// fourth.
TEST_F(GltfCompression, OfFilteredRotations) {
  gltf = meshopt_grid();
  const std::vector<glm::vec4> turns(2, {0, 0, std::sqrt(0.5f), std::sqrt(0.5f)});
  std::vector<std::int16_t> filtered(4 * turns.size());
  meshopt_encodeFilterQuat(filtered.data(), turns.size(), 8, 12, &turns[0].x);
  const int view = meshopt_view(gltf, meshopt_vertices(filtered.data(), turns.size(), 8),
                                "ATTRIBUTES", turns.size(), 8, "QUATERNION");
  gltf.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["ROTATION"] =
      gltf.accessor(view, 5122, "VEC4", turns.size(), true);
  const scene::Scene loaded = load();
  ASSERT_THAT(loaded.instances, SizeIs(2));
  // glTF's X goes to its Y, which is the world's Z.
  EXPECT_LT(glm::distance(glm::dvec3(loaded.instances[1].world_from_object[0]), {0, 0, 1}), 0.0012);
}

// Draco puts vertices in another order: each is the one of the grid that it is nearest to. Its
// steps are the largest extent, 2 and 1, over 2^bits - 1; it is half a step off in each direction.
TEST_F(GltfCompression, OfDracoIsWithinItsSteps) {
  gltf = draco_grid();
  const Grid given = grid();
  const auto half_step = [](double extent, int bits) {
    return extent / (std::ldexp(1, bits) - 1) / 2 + 1e-6;  // and the rounding of floats
  };
  const double position_step = half_step(2, draco_position_bits),
               uv_step = half_step(1, draco_uv_bits);
  for (const char* name : {"test.gltf", "test.glb"}) {
    const scene::Mesh decoded = mesh(name);
    ASSERT_EQ(decoded.positions.size(), given.positions.size());
    std::vector<std::uint32_t> place;
    for (std::size_t i = 0; i < decoded.positions.size(); ++i) {
      const auto at = std::ranges::min_element(given.positions, {}, [&](const glm::vec3& position) {
        return glm::distance(position, decoded.positions[i]);
      });
      place.push_back(static_cast<std::uint32_t>(at - given.positions.begin()));
      for (int k = 0; k < 3; ++k) EXPECT_NEAR(decoded.positions[i][k], (*at)[k], position_step);
      for (int k = 0; k < 2; ++k) EXPECT_NEAR(decoded.uvs[i][k], given.uvs[place[i]][k], uv_step);
      // As in OfFilteredNormals with 10 bits, whose step is 1/511, without the second rounding.
      EXPECT_LT(glm::distance(decoded.normals[i], given.normals[place[i]]), 0.0042f);
    }
    std::vector<Corners> triangles, expected = triangles_of(given);
    for (const glm::uvec3& triangle : decoded.triangles)
      triangles.push_back(turned({place[triangle.x], place[triangle.y], place[triangle.z]}));
    std::ranges::sort(triangles);
    std::ranges::sort(expected);
    EXPECT_EQ(triangles, expected);
  }
}

TEST_F(GltfCompression, DoesNotMatterWhereThereIsUncompressedDataToo) {
  gltf = plain_grid();
  const scene::Mesh plain = mesh();
  first_primitive()["extensions"]["KHR_draco_mesh_compression"] = {
      {"bufferView", 0}, {"attributes", {{"POSITION", 0}}}};
  gltf.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"] = {{"buffer", 0}};
  gltf.json["extensionsUsed"] = {"EXT_meshopt_compression", "KHR_draco_mesh_compression"};
  first_primitive().erase("indices");
  first_primitive()["indices"] = 3;
  EXPECT_EQ(mesh().positions, plain.positions);
}

TEST_F(GltfCompression, OfMeshoptIsRefusedWhereItMakesNoSense) {
  gltf = meshopt_grid();
  const std::string view = "test.gltf: buffer view 0, EXT_meshopt_compression";
  const std::string meshopt = "/bufferViews/0/extensions/EXT_meshopt_compression/";
  EXPECT_THAT(error_with(meshopt + "filter", "COLOR"), HasSubstr(view));
  expect_refused({
      {meshopt + "mode", "POINTS", "its mode \"POINTS\" is not ATTRIBUTES"},
      {meshopt + "filter", "COLOR", "its filter \"COLOR\" is not supported"},
      {meshopt + "byteStride", 0, "a stride of 0 bytes and a count of 81"},
      {meshopt + "byteStride", 10, "are not possible in mode ATTRIBUTES"},
      {meshopt + "count", 1ull << 53, "bytes cannot hold its 9"},
      {meshopt + "buffer", 7, "no such buffer"},
      {meshopt + "byteLength", 1 << 20, "reaches outside its buffer"},
      {meshopt + "byteLength", 60, "cannot be decoded; the file is damaged"},
      {meshopt + "byteOffset", 4, "does not begin as compressed ATTRIBUTES do"},
  });
  gltf.json["bufferViews"][0].erase("extensions");
  EXPECT_THAT(error(), HasSubstr("buffer view 0: its buffer 1 has no data; it stands in for"));
}

TEST_F(GltfCompression, OfANewerMeshoptIsRefusedByItsVersion) {
  gltf = meshopt_grid();
  const Grid given = grid();
  const std::size_t count = given.positions.size();
  std::vector<unsigned char> bytes = meshopt_vertices(given.positions.data(), count, 12);
  bytes[0] = 0xa2;
  const int view = meshopt_view(gltf, bytes, "ATTRIBUTES", count, 12);
  EXPECT_THAT(error(), HasSubstr("buffer view " + std::to_string(view) +
                                 ", EXT_meshopt_compression: is compressed with version 2 of the "
                                 "codec; up to "));
}

// Each of many views asks for what one may: together they would be a bomb.
TEST_F(GltfCompression, DecodesNothingTwice) {
  gltf = meshopt_grid();
  const Json view = gltf.json["bufferViews"][0];
  for (int i = 0; i < 100; ++i) gltf.add("bufferViews", view);
  EXPECT_THAT(error(), HasSubstr("more is compressed than its buffers hold"));
}

TEST_F(GltfCompression, OfDracoIsRefusedWhereItDoesNotFitTheFile) {
  gltf = draco_grid();
  const std::string primitive = "test.gltf: mesh 0, primitive 0, KHR_draco_mesh_compression";
  EXPECT_THAT(error_with("/accessors/3/count", 9), HasSubstr(primitive));
  EXPECT_THAT(error_with("/bufferViews/0/byteLength", 100), HasSubstr(primitive));
  const std::string draco = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression/";
  const Json no_draco = {
      {"buffer", 0}, {"byteLength", 48}, {"byteOffset", gltf.json["bufferViews"].size()}};
  expect_refused({
      {"/accessors/3/count", 9, "has 128 compressed triangles where its indices are 9"},
      {"/accessors/0/count", 80, "has 81 compressed vertices where its accessor has 80"},
      {"/accessors/0/type", "VEC2", "has 3 compressed components"},
      {draco + "attributes/POSITION", 9, "POSITION: its Draco data has no such attribute"},
      {draco + "attributes", nullptr, "lists no attributes"},
      {draco + "bufferView", 5, "no buffer view 5"},
      {"/meshes/0/primitives/0/mode", 5, "only lists of triangles"},
      {"/bufferViews/0/byteOffset", 1, "reaches outside its buffer"},
      {"/bufferViews/0/byteLength", 100, "cannot be decoded: "},
      {"/bufferViews/0", no_draco, "is not Draco data"},
  });
}

// The head of the data says one triangle more than 2000 for each of its bytes.
TEST_F(GltfCompression, OfDracoCannotAskForMuch) {
  gltf = {};
  std::vector<unsigned char> bytes = {'D', 'R', 'A', 'C', 'O', 2, 2, 1, 0, 0, 0};
  for (int i = 0; i < 2; ++i)  // triangles and vertices, 7 bits a byte
    bytes.insert(bytes.end(), {0xc1, 0x9a, 0x0c});
  bytes.resize(100);
  const int view = gltf.view(bytes);
  const Json compressed = {{"bufferView", view}, {"attributes", {{"POSITION", 0}}}};
  add_mesh({{"POSITION", gltf.accessor(-1, 5126, "VEC3", 3)}},
           {{"extensions", {{"KHR_draco_mesh_compression", compressed}}}});
  EXPECT_THAT(error(), HasSubstr("100 bytes cannot hold 200001 triangles"));
}

}  // namespace previz::test::gltf_compression_test
