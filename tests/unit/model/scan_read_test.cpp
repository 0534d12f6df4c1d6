// Scans: read from each kind of file, in each of its dialects.
#include "daemon/model/scan_read.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <glm/geometric.hpp>

#include "daemon/model/glb.hpp"
#include "daemon/model/in_child.hpp"
#include "daemon/model/scan_mesh.hpp"
#include "tests/support/gltf_compressed.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"
#include "tests/unit/model/scan_files.hpp"

namespace previz::test {
namespace {

using Json = GltfWriter::Json;

// This file is in inches, Z up, and its mesh is moved by a node.
constexpr const char* fbx_text = R"(; FBX 7.4.0 project file
FBXHeaderExtension:  {
  FBXHeaderVersion: 1003
  FBXVersion: 7400
}
GlobalSettings:  {
  Version: 1000
  Properties70:  {
    P: "UpAxis", "int", "Integer", "",2
    P: "UpAxisSign", "int", "Integer", "",1
    P: "FrontAxis", "int", "Integer", "",1
    P: "FrontAxisSign", "int", "Integer", "",-1
    P: "CoordAxis", "int", "Integer", "",0
    P: "CoordAxisSign", "int", "Integer", "",1
    P: "UnitScaleFactor", "double", "Number", "",2.54
  }
}
Definitions:  {
  Version: 100
  Count: 3
  ObjectType: "GlobalSettings" {
    Count: 1
  }
  ObjectType: "Model" {
    Count: 1
  }
  ObjectType: "Geometry" {
    Count: 1
  }
}
Objects:  {
  Geometry: 1000, "Geometry::", "Mesh" {
    Vertices: *12 {
      a: 0,0,0,1,0,0,1,2,0,0,2,3
    }
    PolygonVertexIndex: *4 {
      a: 0,1,2,-4
    }
    GeometryVersion: 124
  }
  Model: 2000, "Model::sheet", "Mesh" {
    Version: 232
    Properties70:  {
      P: "Lcl Translation", "Lcl Translation", "", "A",10,0,0
    }
  }
}
Connections:  {
  C: "OO",2000,0
  C: "OO",1000,2000
}
)";

class ScanRead : public testing::Test {
 protected:
  std::string refusal(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    return error_of([&] { model::read_scan(folder_ / name); });
  }

  TemporaryDirectory folder_;
};

TEST_F(ScanRead, EachFormatGivesTheSameMesh) {
  const model::TriangleMesh mesh = lump(6);
  write_obj(folder_ / "scan.obj", mesh);
  write_ply(folder_ / "scan.ply", mesh);
  write_stl(folder_ / "scan.STL", mesh);
  for (const char* name : {"scan.obj", "scan.ply", "scan.STL"}) {
    const model::ScanFile file = model::read_scan(folder_ / name);
    EXPECT_FALSE(file.unit_m) << name;
    EXPECT_FALSE(file.up) << name;
    ASSERT_EQ(file.mesh.indices.size(), mesh.indices.size()) << name;
    for (std::size_t i = 0; i < mesh.indices.size(); ++i)
      EXPECT_LT(
          glm::distance(file.mesh.positions[file.mesh.indices[i]], mesh.positions[mesh.indices[i]]),
          1e-7f)
          << name;
  }
}

TEST_F(ScanRead, GltfAndFbxGiveTheirUnitAndAxis) {
  std::ofstream(folder_ / "scan.glb", std::ios::binary)
      << model::glb_of({{"lump", model::shaded(lump(6))}}, {});
  const model::ScanFile glb = model::read_scan(folder_ / "scan.glb");
  EXPECT_EQ(glb.unit_m, 1.0);
  EXPECT_EQ(glb.up, glm::dvec3(0, 1, 0));
  EXPECT_EQ(glb.mesh.triangles(), lump(6).triangles());

  std::ofstream(folder_ / "scan.fbx") << fbx_text;
  const model::ScanFile fbx = model::read_scan(folder_ / "scan.fbx");
  ASSERT_TRUE(fbx.unit_m);
  EXPECT_NEAR(*fbx.unit_m, 0.0254, 1e-8);
  EXPECT_EQ(fbx.up, glm::dvec3(0, 0, 1));
  EXPECT_EQ(fbx.mesh.triangles(), 2u);
  for (const glm::vec3& p : fbx.mesh.positions) EXPECT_GE(p.x, 10);
}

TEST_F(ScanRead, WhatIsNotAMeshIsRefused) {
  const std::string points = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  EXPECT_THAT(refusal("nan.obj", points + "v 0 0 nan\nf 1 2 4\n"),
              HasSubstr("nan.obj: has a vertex whose coordinates are not finite numbers"));
  EXPECT_THAT(refusal("far.obj", points + "v 0 0 inf\nf 1 2 4\n"), HasSubstr("not finite"));
  EXPECT_THAT(refusal("points.obj", points), HasSubstr("points.obj: has no triangles"));
  EXPECT_THAT(
      refusal("lacking.ply",
              "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
              "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
              "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n"),
      HasSubstr("lacking.ply: has a face with a vertex that the file lacks"));
  EXPECT_THAT(refusal("junk.ply", "junk"), HasSubstr("junk.ply: cannot be read"));
  EXPECT_THAT(refusal("scan.e57", "junk"), HasSubstr("is a cloud of points; make a mesh of it"));
  EXPECT_THAT(refusal("scan.USDZ", "junk"),
              HasSubstr("is a USDZ file; export the scan in another format, or convert it, in "
                        "Blender for example; allowed: .obj, .ply"));
  EXPECT_THAT(refusal("scan.txt", "junk"), HasSubstr("is not a scan; allowed: .obj, .ply"));
  EXPECT_THAT(error_of([&] { model::read_scan(folder_ / "none.obj"); }),
              HasSubstr("none.obj: file not found"));
}

// A library that crashes costs an error; what it returns or throws comes back.
TEST(InChild, OnlyTheChildEnds) {
  EXPECT_EQ(model::in_child("a.fbx", [] { return std::string("a\0b", 3); }),
            std::string("a\0b", 3));
  EXPECT_EQ(model::in_child("a.fbx", [] { return std::string(1 << 22, 'x'); }).size(), 1u << 22);
  EXPECT_EQ(error_of([] {
              model::in_child("a.fbx", []() -> std::string { throw Error("a.fbx: is empty"); });
            }),
            "a.fbx: is empty");
  EXPECT_THAT(error_of([] {
                model::in_child("a.fbx", []() -> std::string {
                  std::raise(SIGSEGV);
                  return "";
                });
              }),
              HasSubstr("a.fbx: the library that reads this format was stopped by it"));
  EXPECT_THAT(error_of([] { model::in_child("a.fbx", []() -> std::string { std::_Exit(3); }); }),
              HasSubstr("a.fbx: the process that reads it ended without a result"));
}

// In UTM coordinates, zone 33; metres.
const glm::dvec3 country{446000.5, 5418000.25, 310.75};

// Returns the file's coordinates of all corners, triangle by triangle.
std::vector<glm::dvec3> corners_of(const model::ScanFile& file) {
  std::vector<glm::dvec3> corners;
  for (const unsigned i : file.mesh.indices)
    corners.push_back(glm::dvec3(file.mesh.positions[i]) + file.origin);
  return corners;
}

double area_of(const model::ScanFile& file) {
  double area = 0;
  const std::vector<glm::dvec3> p = corners_of(file);
  for (std::size_t i = 0; i < p.size(); i += 3)
    area += glm::length(glm::cross(p[i + 1] - p[i], p[i + 2] - p[i])) / 2;
  return area;
}

// A triangle of millimetres; each of the formats that can keep its place does.
class FarScanRead : public ScanRead {
 protected:
  const std::vector<glm::dvec3> corners_{country, country + glm::dvec3(0.001, 0, 0),
                                         country + glm::dvec3(0, 0.002, 0.0005)};

  void expect_kept(const std::string& name) {
    const model::ScanFile file = model::read_scan(folder_ / name);
    const std::vector<glm::dvec3> read = corners_of(file);
    ASSERT_EQ(read.size(), 3u) << name;
    // A double has steps of 1e-9 there; the mesh, whose coordinates are at most a few times as
    // large as the triangle, is rounded by 2^-24 of them.
    for (std::size_t k = 0; k < 3; ++k)
      EXPECT_LT(glm::distance(read[k], corners_[k]), 3e-9) << name;
  }
};

TEST_F(FarScanRead, OfDoublesIsKept) {
  std::ofstream obj(folder_ / "far.obj"), ply(folder_ / "far.ply"), stl(folder_ / "far.stl");
  ply << "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\n"
         "property double z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
  stl << "solid\nfacet normal 0 0 1\nouter loop\n";
  for (const glm::dvec3& p : corners_) {
    obj << fmt::format("v {} {} {}\n", p.x, p.y, p.z);
    ply << fmt::format("{} {} {}\n", p.x, p.y, p.z);
    stl << fmt::format("vertex {} {} {}\n", p.x, p.y, p.z);
  }
  obj << "f 1 2 3\n" << std::flush;
  ply << "3 0 1 2\n" << std::flush;
  stl << "endloop\nendfacet\nendsolid\n" << std::flush;
  for (const char* name : {"far.obj", "far.ply", "far.stl"}) expect_kept(name);
}

TEST_F(FarScanRead, OfBinaryDoublesIsKept) {
  for (const bool is_big : {false, true}) {
    std::ofstream ply(folder_ / "far.ply", std::ios::binary);
    ply << "ply\nformat binary_" << (is_big ? "big" : "little")
        << "_endian 1.0\nelement vertex 3\nproperty float64 x\nproperty float64 y\n"
           "property float64 z\nelement face 1\nproperty list uint8 uint8 vertex_index\n"
           "end_header\n";
    for (const glm::dvec3& p : corners_)
      for (glm::length_t k = 0; k < 3; ++k) {
        auto bytes = std::bit_cast<std::array<char, 8>>(p[k]);
        if (is_big) std::ranges::reverse(bytes);
        ply.write(bytes.data(), bytes.size());
      }
    ply.write("\3\0\1\2", 4);
    ply.close();
    expect_kept("far.ply");
  }
}

TEST_F(FarScanRead, ByANodeIsKept) {
  GltfWriter gltf;
  std::vector<glm::vec3> near;
  for (const glm::dvec3& p : corners_) near.emplace_back(p - country);
  gltf.root("scan", gltf.mesh({{"attributes", {{"POSITION", gltf.positions(near)}}}}),
            {{"translation", {country.x, country.y, country.z}}});
  gltf.save(folder_ / "far.glb");
  expect_kept("far.glb");
}

// Coordinates that are floats in the file have steps of 0.5 there, which is said with the scan.
TEST_F(FarScanRead, OfFloatsSaysItsSteps) {
  model::TriangleMesh mesh{{}, {0, 1, 2}};
  for (const glm::dvec3& p : corners_) mesh.positions.emplace_back(p);
  write_ply(folder_ / "far.ply", mesh);
  write_stl(folder_ / "far.stl", mesh);
  GltfWriter gltf;
  gltf.root("scan", gltf.mesh({{"attributes", {{"POSITION", gltf.positions(mesh.positions)}}}}));
  gltf.save(folder_ / "far.glb");
  for (const char* name : {"far.ply", "far.stl", "far.glb"})
    EXPECT_NEAR(model::read_scan(folder_ / name).step, country.y * 0x1p-23, 1e-3) << name;
}

TEST_F(ScanRead, NearTheOriginKeepsItsCoordinates) {
  write_obj(folder_ / "scan.obj", lump(6));
  EXPECT_EQ(model::read_scan(folder_ / "scan.obj").origin, glm::dvec3(0));
}

// A square of 2 x 2 with a reflex corner at (1, 1), whose area is 3.
constexpr const char* l_shape = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\n";

TEST_F(ScanRead, FacesOfAnyShapeBecomeTriangles) {
  for (const char* face : {"f 1 2 3 4 5 6\n", "f 4 5 6 1 2 3\n", "f 6 5 4 3 2 1\n"}) {
    std::ofstream(folder_ / "l.obj") << l_shape << face;
    const model::ScanFile file = model::read_scan(folder_ / "l.obj");
    EXPECT_EQ(file.mesh.triangles(), 4u) << face;
    EXPECT_NEAR(area_of(file), 3, 1e-6) << face;
  }
  std::ofstream(folder_ / "l.obj") << l_shape << "f 1 2 3 4\nf 1 4\nl 1 2 3\nf 1\n";
  EXPECT_EQ(model::read_scan(folder_ / "l.obj").mesh.triangles(), 2u);
}

// The Wavefront specification; what Assimp read, and assimp #6253.
TEST_F(ScanRead, DialectsOfObjAreTheSame) {
  const std::string mark = "\xef\xbb\xbf";
  for (const std::string& text :
       {std::string("v 0 0 0\nv 2 0 0\nv 0 1 0.5\nf 1 2 3\n"),
        std::string("v 0 0 0\r\nv 2 0 0\r\nv 0 1 0.5\r\nf 1 2 3\r\n"),
        std::string("v 0 0 0\rv 2 0 0\rv 0 1 0.5\rf 1 2 3\r"),
        mark + "v 0 0 0\nv 2 0 0\nv 0 1 0.5\nf 1 2 3\n",
        std::string("v 0,0 0,0 0\nv 2,0 0 0\nv 0 1,0 0,5\nf 1 2 3\n"),
        std::string("v 0 0 0 2\nv 4 0 0 2\nv 0 2 1 2\nf 1 2 3\n"),
        std::string("  v 0 0 0\n\tv 2.0e0 0 0\nv 0 +1 5e-1\n\nf  1//1 2//1\t3//1 # end\n"),
        std::string("v 0 0 \\\n0\nv 2 0 0\nv 0 1 0.5\nf 1 \\\r\n2 \\\n 3\n"),
        std::string("f 1 2 3\nv 0 0 0\nv 2 0 0\nv 0 1 0.5\n"),
        std::string("v 0 0 0 255 0 9\nv 2 0 0 1 1 1\nv 0 1 0.5 0 0 0\nf -3 -2 -1")}) {
    std::ofstream(folder_ / "a.obj", std::ios::binary) << text;
    EXPECT_EQ(corners_of(model::read_scan(folder_ / "a.obj")),
              (std::vector<glm::dvec3>{{0, 0, 0}, {2, 0, 0}, {0, 1, 0.5}}))
        << text;
  }
}

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
              testing::ElementsAre(HasSubstr("is read from red.png")));
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

TEST_F(ScanRead, HeadersOfPlyHaveManyForms) {
  const std::string mac =
      "ply\rformat ascii 1.0\relement vertex 3\rproperty float x\rproperty float y\rproperty "
      "float z\relement face 1\rproperty list uchar int vertex_indices\rend_header\r0 0 0\r2 0 "
      "0\r0 1 0.5\r3 0 1 2\r";
  std::string windows, unix_text = mac;
  std::ranges::replace(unix_text, '\r', '\n');
  for (const char c : mac) windows += c == '\r' ? "\r\n" : std::string(1, c);
  for (const std::string& text :
       {mac, windows, unix_text,
        std::string(
            "ply\nformat ascii 1.0\nobj_info scanned\ncomment x\n\nelement face 1\nproperty uchar "
            "flags\nproperty list uint8 uint32 vertex_index\nelement camera 1\nproperty float "
            "view_px\nelement vertex 3\nproperty float nx\nproperty double z\nproperty float y\n"
            "property short x\nelement edge 1\nproperty int vertex1\nend_header\n7 3 0 1 2\n0.5\n"
            "9 0 0 0\n9 0 0 2 77\n9 0.5 1 0\n3\n"),
        std::string(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty "
            "float z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 "
            "0\n2 0 0\n0 1 0.5\n4 0 1 2 -1\n")}) {
    std::ofstream(folder_ / "a.ply", std::ios::binary) << text;
    EXPECT_EQ(corners_of(model::read_scan(folder_ / "a.ply")),
              (std::vector<glm::dvec3>{{0, 0, 0}, {2, 0, 0}, {0, 1, 0.5}}))
        << text;
  }
}

// Each is refused with the file's name, and costs no more memory than the file has bytes.
TEST_F(ScanRead, PlyThatIsNotWhatItsHeaderSaysIsRefused) {
  const std::string vertex =
      "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
  const std::string face = "element face 1\nproperty list uchar int vertex_indices\n";
  const std::string points = "0 0 0\n1 0 0\n0 1 0\n";
  using Refused = std::pair<std::string, std::string>;
  for (const auto& [text, words] :
       {Refused("ply\n" + vertex + face + "end_header\n", "its header has no format"),
        Refused("ply\nformat ascii 1.0\n" + vertex + face, "its header has no end_header"),
        Refused("ply\nformat utf8 1.0\n" + vertex, "its format \"utf8\" is unknown"),
        Refused("ply\nformat ascii 1.0\nelement vertex many\n", "vertex has no number"),
        Refused("ply\nformat ascii 1.0\nproperty float x\n", "before an element"),
        Refused("ply\nformat ascii 1.0\n" + vertex + "property half s\n",
                "its type \"half\" is unknown"),
        Refused("ply\nformat ascii 1.0\n" + vertex + face + "end_header\n0 0 0\n", "is cut short"),
        Refused("ply\nformat ascii 1.0\n" + vertex + face + "end_header\n" + points +
                    "4000000000 0 1 2\n",
                "is cut short"),
        Refused("ply\nformat binary_little_endian 1.0\nelement vertex 999999999999\nproperty "
                "double x\nend_header\n" +
                    points,
                "is cut short"),
        Refused("ply\nformat ascii 1.0\n" + vertex + face + "end_header\n" + points + "3 0 1 -1\n",
                "a vertex that the file lacks"),
        Refused("ply\nformat ascii 1.0\n" + vertex + face + "end_header\n" + points + "3 0 1 nan\n",
                "a vertex that the file lacks")})
    EXPECT_THAT(refusal("a.ply", text), testing::AllOf(HasSubstr("a.ply: "), HasSubstr(words)));
}

TEST_F(ScanRead, StlIsKnownByItsBytes) {
  const std::string text =
      "SOLID facet\n FACET NORMAL 0 0 1\n  OUTER LOOP\n   VERTEX 0 0 0\n   VERTEX 2 0 0\n   VERTEX "
      "0 "
      "1 0.5\n  ENDLOOP\n ENDFACET\nENDSOLID facet\n";
  std::string lower = text;
  std::ranges::transform(lower, lower.begin(), [](unsigned char c) { return std::tolower(c); });
  for (const std::string& solid : {text, lower, lower + lower}) {
    std::ofstream(folder_ / "a.stl") << solid;
    const std::vector<glm::dvec3> read = corners_of(model::read_scan(folder_ / "a.stl"));
    ASSERT_GE(read.size(), 3u) << solid;
    EXPECT_EQ(read[2], glm::dvec3(0, 1, 0.5)) << solid;
  }
  write_stl(folder_ / "b.stl", lump(6));
  std::string binary = [&] {
    std::ifstream in(folder_ / "b.stl", std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), {});
  }();
  const std::string starts = "solid facet normal";
  binary.replace(0, starts.size(), starts);
  std::ofstream(folder_ / "b.stl", std::ios::binary) << binary;
  EXPECT_EQ(model::read_scan(folder_ / "b.stl").mesh.triangles(), lump(6).triangles());
  std::ofstream(folder_ / "b.stl", std::ios::binary) << "a name" << binary.substr(6, 300);
  EXPECT_THAT(error_of([&] { model::read_scan(folder_ / "b.stl"); }),
              HasSubstr("b.stl: cannot be read as STL: it is cut short"));
}

class GltfScanRead : public ScanRead {
 protected:
  model::ScanFile read(const GltfWriter& gltf, const char* name = "a.glb") {
    gltf.save(folder_ / name);
    return model::read_scan(folder_ / name, model::Colouring::read);
  }
};

// The codecs keep 14 bits of positions or all of them; the extent is 2.
TEST_F(GltfScanRead, CompressedMeshesAreThoseOfPlainOnes) {
  const std::vector<glm::dvec3> plain = corners_of(read(plain_grid()));
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
    const std::vector<glm::dvec3> p = corners_of(file);
    EXPECT_GT(glm::cross(p[3 * t + 1] - p[3 * t], p[3 * t + 2] - p[3 * t]).z, 0);
  }
}

// Two texels, (0, 51, 255) and (10, 11, 128), without loss; the luma is stb_image's.
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

}  // namespace
}  // namespace previz::test
