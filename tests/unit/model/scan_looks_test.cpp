// Scans: the colours that their files have, and scans in glTF.
#include "daemon/tools/model/scan_read.hpp"

#include <fmt/format.h>

#include <csignal>
#include <glm/geometric.hpp>

#include "daemon/tools/model/glb.hpp"
#include "daemon/tools/model/scan_mesh.hpp"
#include "drivers/box/in_child.hpp"
#include "tests/support/gltf_compressed.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"
#include "tests/unit/model/scan_files.hpp"
#include "tests/unit/model/scan_read_fixture.hpp"

namespace previz::test {
namespace {

using Json = GltfWriter::Json;

// Texture coordinates and colours that a scan of one triangle has; (0, 0) is the lower left.
struct Looks {
  std::vector<glm::vec2> uvs;
  std::vector<int> luma;
  int source = model::colourless;
  std::string picture;
};

Looks looks_of(const std::filesystem::path& path) {
  const model::ScanFile file = model::read_scan(path, model::Colouring::read);
  Looks looks;
  EXPECT_EQ(file.colours.sources.size(), file.mesh.triangles());
  EXPECT_EQ(file.colours.uvs.size(), file.mesh.positions.size());
  for (const unsigned i : file.mesh.indices) {
    looks.uvs.push_back(file.colours.uvs[i]);
    looks.luma.push_back(file.colours.luma[i]);
  }
  looks.source = file.colours.sources.at(0);
  if (looks.source >= 0)
    looks.picture = file.colours.pictures.at(static_cast<std::size_t>(looks.source)).name;
  return looks;
}

class ScanLooks : public ScanRead {
 protected:
  ScanLooks() { write_png("red.png"); }

  void write_png(const std::string& name) {
    const std::vector<unsigned char> bytes = png(1, 1, {255, 0, 0, 255});
    std::ofstream(folder_ / name, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
  }

  Looks looks(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return looks_of(folder_ / name);
  }

  const std::vector<glm::vec2> uvs_{{0, 0}, {1, 0}, {0.25f, 0.75f}};
};

TEST_F(ScanLooks, OfObjAreThoseOfItsMaterial) {
  const std::string obj =
      "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0.25 0.75\nf 1/1 2/2 3/3\n";
  for (const auto& [library, used, mtl] :
       {std::tuple("mtllib a.mtl", "usemtl red", "newmtl red\nmap_Kd red.png\n"),
        std::tuple("mtllib a.mtl", "usemtl RED", "newmtl red\nKd 1 0 0\nmap_Kd red.png\n"),
        std::tuple("mtllib the materials.mtl", "usemtl my red",
                   "newmtl my red\n\tmap_Kd -blendu on -mm 0 1 -clamp on red.png\n"),
        std::tuple("mtllib b.mtl c.mtl", "usemtl red",
                   "\xef\xbb\xbfnewmtl red\r\nMAP_KD -o 0 0 0 -s 1 1 1 red.png\r\n"),
        std::tuple("mtllib C:\\scans\\missing.mtl", "usemtl red",
                   "newmtl red\nmap_Kd \"C:\\scans\\red.png\"\n"),
        std::tuple("mtllib \"a.mtl\"", "usemtl red",
                   "newmtl red\nmap_Kd -colorspace sRGB -s 1 red.png # wood\n"),
        std::tuple("mtllib A.MTL", "usemtl red", "newmtl red\nmap_Ke RED.png\n")}) {
    for (const char* name : {"a.mtl", "c.mtl", "the materials.mtl"})
      std::ofstream(folder_ / name, std::ios::binary) << mtl;
    const Looks found = looks("a.obj", fmt::format("{}\n{}\n{}", library, used, obj));
    EXPECT_EQ(found.source, 0) << mtl;
    EXPECT_EQ(found.uvs, uvs_) << mtl;
  }
  std::ofstream(folder_ / "a.mtl") << "newmtl red\nmap_Kd -s 2 2 red.png\n";
  std::ofstream(folder_ / "a.obj") << "mtllib a.mtl\nusemtl red\n" << obj;
  EXPECT_THAT(error_of([&] { looks_of(folder_ / "a.obj"); }),
              HasSubstr("a.obj: its texture \"red.png\" is moved or scaled on its faces"));
}

// The texture's picture lies beside the file, or is in it.
TEST_F(ScanLooks, OfFbxAreThoseOfItsMaterial) {
  std::string text = fbx_text;
  const auto insert = [&](const std::string& before, const std::string& more) {
    text.insert(text.find(before), more);
  };
  insert("    GeometryVersion: 124", R"(    LayerElementUV: 0 {
      Version: 101
      Name: "UV"
      MappingInformationType: "ByPolygonVertex"
      ReferenceInformationType: "IndexToDirect"
      UV: *8 {
        a: 0,0,1,0,0.25,0.75,0,1
      }
      UVIndex: *4 {
        a: 0,1,2,3
      }
    }
    LayerElementMaterial: 0 {
      Version: 101
      Name: ""
      MappingInformationType: "AllSame"
      ReferenceInformationType: "IndexToDirect"
      Materials: *1 {
        a: 0
      }
    }
    Layer: 0 {
      Version: 100
      LayerElement:  {
        Type: "LayerElementUV"
        TypedIndex: 0
      }
      LayerElement:  {
        Type: "LayerElementMaterial"
        TypedIndex: 0
      }
    }
)");
  insert("  Model: 2000", R"(  Material: 3000, "Material::m", "" {
    Version: 102
    ShadingModel: "phong"
    MultiLayer: 0
  }
  Texture: 4000, "Texture::t", "" {
    Type: "TextureVideoClip"
    Version: 202
    TextureName: "Texture::t"
    FileName: "C:/scans/red.png"
    RelativeFilename: "C:/scans/red.png"
  }
)");
  insert("  C: \"OO\",1000,2000",
         "  C: \"OO\",3000,2000\n  C: \"OP\",4000,3000, \"DiffuseColor\"\n");
  const Looks found = looks("a.fbx", text);
  EXPECT_EQ(found.picture, "C:/scans/red.png");
  EXPECT_EQ(std::vector(found.uvs.begin(), found.uvs.begin() + 3), uvs_);
  std::filesystem::remove(folder_ / "red.png");
  EXPECT_THAT(error_of([&] { looks_of(folder_ / "a.fbx"); }),
              HasSubstr("its texture \"C:/scans/red.png\" is missing"));
}

TEST_F(ScanLooks, FilesOfOtherNamesAreSaid) {
  std::ofstream(folder_ / "a.mtl") << "newmtl red\nmap_Kd RED.PNG\n";
  std::ofstream(folder_ / "a.obj")
      << "mtllib a.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n";
  EXPECT_THAT(model::read_scan(folder_ / "a.obj", model::Colouring::read).notes,
              ElementsAre(HasSubstr("is read from red.png")));
}

// As MeshLab and OpenMVS write them (assimp #5010): two faces that share two points, and no
// texture coordinates.
TEST_F(ScanLooks, OfPlyAreSplitWhereFacesDiffer) {
  const Looks found = looks(
      "a.ply",
      "ply\nformat ascii 1.0\ncomment TextureFile red.png\nelement vertex 4\nproperty float x\n"
      "property float y\nproperty float z\nelement face 2\nproperty list uchar int "
      "vertex_indices\nproperty list uchar float texcoord\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 "
      "0\n3 0 1 2 6 0 0 1 0 0.25 0.75\n3 0 2 3 6 0.5 0 0.25 0.75 0 1\n");
  EXPECT_EQ(found.source, 0);
  EXPECT_EQ(found.uvs, (std::vector<glm::vec2>{
                           {0, 0}, {1, 0}, {0.25f, 0.75f}, {0.5f, 0}, {0.25f, 0.75f}, {0, 1}}));
  EXPECT_EQ(model::read_scan(folder_ / "a.ply", model::Colouring::read).mesh.positions.size(), 5u);
}

TEST_F(ScanLooks, OfPlyChooseAmongItsTextures) {
  write_png("green.png");
  const Looks found = looks(
      "a.ply",
      "ply\nformat ascii 1.0\ncomment TextureFile red.png\ncomment TextureFile green.png\n"
      "element vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
      "property list uchar int vertex_indices\nproperty list uchar float texcoord\nproperty int "
      "texnumber\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0 1 0 0.25 0.75 1\n");
  EXPECT_EQ(found.picture, "green.png");
  EXPECT_EQ(found.uvs, uvs_);
}

// A single texture is that of all faces, whatever their number says; a missing one is said.
TEST_F(ScanLooks, OfPlyWithWrongNumbersAreSaid) {
  const std::string rest =
      "element vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
      "property list uchar int vertex_indices\nproperty list uchar float texcoord\nproperty int "
      "texnumber\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0 1 0 0.25 0.75 7\n";
  for (const char* name : {"comment TextureFile red.png\n", "comment TextureFile: red.png\n",
                           "comment texturefile \"red.png\"\n"})
    EXPECT_EQ(looks("a.ply", std::string("ply\nformat ascii 1.0\n") + name + rest).picture,
              "red.png");
  write_png("green.png");
  std::ofstream(folder_ / "a.ply") << "ply\nformat ascii 1.0\ncomment TextureFile red.png\ncomment "
                                      "TextureFile green.png\n" +
                                          rest;
  EXPECT_THAT(model::read_scan(folder_ / "a.ply", model::Colouring::read).notes,
              ElementsAre(HasSubstr("faces whose texnumber has no texture")));
}

// The luma of (255, 128, 0) by Rec. 709: 0.2126 * 255 + 0.7152 * 128 = 145.76.
TEST_F(ScanLooks, OfPlyHaveColoursByAnyName) {
  struct Colours {
    const char* properties;
    const char* values;
    int luma = 146;
  };
  for (const Colours& colours :
       {Colours{"uchar red,uchar green,uchar blue", "255 128 0"},
        Colours{"uchar diffuse_red,uchar diffuse_green,uchar diffuse_blue", "255 128 0"},
        Colours{"uint8 r,uint8 g,uint8 b,uint8 alpha", "255 128 0 255"},
        Colours{"uchar vertex_red,uchar vertex_green,uchar vertex_blue", "255 128 0"},
        Colours{"ushort red,ushort green,ushort blue", "65535 32896 0"},
        Colours{"float red,float green,float blue", "1 0.50196 0"},
        Colours{"float32 Red,float32 Green,float32 Blue", "255 128 0"},
        Colours{"uchar blue,uchar green,uchar red", "0 128 255"},
        Colours{"uchar intensity", "146"}}) {
    std::string header =
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty "
        "float z\nproperty ";
    for (const char c : std::string(colours.properties))
      header += c == ',' ? "\nproperty " : std::string(1, c);
    const std::string v = colours.values;
    const Looks found = looks(
        "a.ply", header + "\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n" +
                     "0 0 0 " + v + "\n1 0 0 " + v + "\n0 1 0 " + v + "\n3 0 1 2\n");
    EXPECT_EQ(found.source, model::from_vertices) << colours.properties;
    EXPECT_EQ(found.luma, std::vector<int>(3, colours.luma)) << colours.properties;
  }
}

class GltfScanRead : public ScanRead {
 protected:
  model::ScanFile read(const GltfWriter& gltf, const char* name = "a.glb") {
    gltf.save(folder_ / name);
    return model::read_scan(folder_ / name, model::Colouring::read);
  }
};

// Draco keeps 14 bits of positions, whose extent is 2: a corner is off by 6e-5 along each axis, a
// triangle's sides of 0.25 and more by at most 5e-4 of themselves, and its area by twice that.
TEST_F(GltfScanRead, CompressedMeshesAreThoseOfPlainOnes) {
  const std::vector<glm::dvec3> plain = scan_corners(read(plain_grid()));
  ASSERT_EQ(plain.size(), grid().indices.size());
  const double area = area_of(read(plain_grid()));
  for (const GltfWriter& gltf : {meshopt_grid(), draco_grid()}) {
    const model::ScanFile file = read(gltf);
    EXPECT_EQ(file.mesh.indices.size(), plain.size());
    EXPECT_NEAR(area_of(file), area, 1e-3 * area);
  }
}

// Positions in shorts, scaled by the node; coordinates in normalised shorts (PR #6765 of assimp).
TEST_F(GltfScanRead, QuantisedMeshesAreRead) {
  GltfWriter gltf;
  const int positions = gltf.values<std::uint16_t>(5123, "VEC3", {0, 0, 0, 1000, 0, 0, 0, 1000, 0});
  gltf.json["accessors"][0]["count"] = 3;
  const int uvs = gltf.values<std::uint16_t>(5123, "VEC2", {0, 65535, 65535, 65535, 0, 0}, true);
  gltf.json["accessors"][1]["count"] = 3;
  const int texture = gltf.texture(1, 1, {9, 9, 9, 255});
  const int material = gltf.add(
      "materials", {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", texture}}}}}});
  gltf.json["extensionsUsed"] = gltf.json["extensionsRequired"] = {"KHR_mesh_quantization"};
  gltf.root("scan",
            gltf.mesh({{"attributes", {{"POSITION", positions}, {"TEXCOORD_0", uvs}}},
                       {"material", material}}),
            {{"scale", {1e-3, 2e-3, 1}}});
  const model::ScanFile file = read(gltf);
  EXPECT_NEAR(area_of(file), 1, 1e-6);
  EXPECT_EQ(file.colours.sources, std::vector<int>{0});
  EXPECT_EQ(file.colours.uvs, (std::vector<glm::vec2>{{0, 0}, {1, 0}, {0, 1}}));
}

TEST_F(GltfScanRead, CopiesAndMirroredNodesAreThere) {
  GltfWriter gltf;
  const int places = gltf.positions({{0, 0, 0}, {3, 0, 0}, {0, 0, 5}});
  gltf.json["extensionsUsed"] = gltf.json["extensionsRequired"] = {"EXT_mesh_gpu_instancing"};
  gltf.root(
      "scan", gltf.triangle_mesh(),
      {{"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", places}}}}}}},
       {"scale", {-1, 1, 1}}});
  const model::ScanFile file = read(gltf);
  EXPECT_NEAR(area_of(file), 1.5, 1e-6);
  // The front stays in front (glTF 2.0, 3.7.4).
  for (std::size_t t = 0; t < 3; ++t) {
    const std::vector<glm::dvec3> p = scan_corners(file);
    EXPECT_GT(glm::cross(p[3 * t + 1] - p[3 * t], p[3 * t + 2] - p[3 * t]).z, 0);
  }
}

// Two texels, (0, 51, 255) and (10, 11, 128), without loss; their luma is 0.299 R + 0.587 G +
// 0.114 B, in 256ths.
TEST_F(GltfScanRead, TexturesInWebpAreRead) {
  GltfWriter gltf;
  gltf.add("images", {{"uri",
                       "data:image/webp;base64,UklGRiIAAABXRUJQVlA4TBYAAAAvAQAAEA/wGexReOD/"
                       "g/6DBxWI6H8A"}});
  const int texture =
      gltf.add("textures", {{"extensions", {{"EXT_texture_webp", {{"source", 0}}}}}});
  const int material = gltf.add(
      "materials", {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", texture}}}}}});
  gltf.root("scan", gltf.triangle_mesh(material));
  EXPECT_THAT(read(gltf).colours.pictures.at(0).luma, ElementsAre(58, 23));
}

// A hidden node and its children are no part of the model (KHR_node_visibility).
TEST_F(GltfScanRead, HiddenNodesAreLeftOut) {
  GltfWriter gltf;
  const int mesh = gltf.triangle_mesh();
  const int child = gltf.add("nodes", {{"mesh", mesh}});
  gltf.root("scan", mesh);
  gltf.root(
      "helper", mesh,
      {{"children", {child}}, {"extensions", {{"KHR_node_visibility", {{"visible", false}}}}}});
  gltf.json["extensionsUsed"] = {"KHR_node_visibility"};
  EXPECT_NEAR(area_of(read(gltf)), 0.5, 1e-6);
  gltf.json["extensionsRequired"] = {"KHR_node_visibility"};
  EXPECT_NEAR(area_of(read(gltf)), 0.5, 1e-6);
}

TEST_F(GltfScanRead, AnUnknownExtensionThatIsRequiredIsRefused) {
  GltfWriter gltf;
  gltf.root("scan", gltf.triangle_mesh());
  gltf.json["extensionsUsed"] = gltf.json["extensionsRequired"] = {"ACME_voxels"};
  EXPECT_THAT(error_of([&] { read(gltf); }),
              HasSubstr("requires the extension \"ACME_voxels\", which is not supported"));
}

// Seventy textures of one image are decoded once: more would be too many.
TEST_F(GltfScanRead, TexturesOfOneImageAreOnePicture) {
  GltfWriter gltf;
  const int texture = gltf.texture(1, 1, {9, 9, 9, 255});
  const int other = gltf.add("textures", gltf.json["textures"][0]);
  for (const int t : {texture, other}) {
    const int material =
        gltf.add("materials", {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", t}}}}}});
    const int positions = gltf.positions({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}});
    const int uvs = gltf.uvs({{0, 0}, {1, 0}, {0, 1}});
    gltf.root("scan", gltf.mesh({{"attributes", {{"POSITION", positions}, {"TEXCOORD_0", uvs}}},
                                 {"material", material}}));
  }
  const model::ScanFile file = read(gltf);
  EXPECT_EQ(file.colours.pictures.size(), 1u);
  EXPECT_EQ(file.colours.sources, (std::vector<int>{0, 0}));
}

}  // namespace
}  // namespace previz::test
