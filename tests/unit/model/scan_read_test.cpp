// Scans: read from each kind of file, in each of its dialects.
#include "daemon/tools/model/scan_read.hpp"

#include <fmt/format.h>

#include <csignal>
#include <glm/geometric.hpp>

#include "daemon/tools/model/glb.hpp"
#include "daemon/tools/model/scan_mesh.hpp"
#include "drivers/box/in_child.hpp"
#include "tests/support/gltf_writer.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"
#include "tests/unit/model/scan_files.hpp"
#include "tests/unit/model/scan_read_fixture.hpp"

namespace previz::test {
namespace {

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
  EXPECT_EQ(box::in_child("a.fbx", [] { return std::string("a\0b", 3); }), std::string("a\0b", 3));
  EXPECT_EQ(box::in_child("a.fbx", [] { return std::string(1 << 22, 'x'); }).size(), 1u << 22);
  EXPECT_EQ(error_of([] {
              box::in_child("a.fbx", []() -> std::string { throw Error("a.fbx: is empty"); });
            }),
            "a.fbx: is empty");
  EXPECT_THAT(error_of([] {
                box::in_child("a.fbx", []() -> std::string {
                  std::raise(SIGSEGV);
                  return "";
                });
              }),
              HasSubstr("a.fbx: the library that reads this format was stopped by it"));
  EXPECT_THAT(error_of([] { box::in_child("a.fbx", []() -> std::string { std::_Exit(3); }); }),
              HasSubstr("a.fbx: the process that reads it ended without a result"));
}

// In UTM coordinates, zone 33; metres.
const glm::dvec3 country{446000.5, 5418000.25, 310.75};

// A triangle of millimetres; each of the formats that can keep its place does.
class FarScanRead : public ScanRead {
 protected:
  const std::vector<glm::dvec3> corners_{country, country + glm::dvec3(0.001, 0, 0),
                                         country + glm::dvec3(0, 0.002, 0.0005)};

  void expect_kept(const std::string& name) {
    const model::ScanFile file = model::read_scan(folder_ / name);
    const std::vector<glm::dvec3> read = scan_corners(file);
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
        std::string("# C:\\scans\\\nv 0 0 0#p\nv 2 0 0\nv 0 1 0.5\nf 1 2 3\n"),
        std::string("v 0 0 \\\n0\nv 2 0 0\nv 0 1 0.5\nf 1 \\\r\n2 \\\n 3 \\"),
        std::string("f 1 2 3\nv 0 0 0\nv 2 0 0\nv 0 1 0.5\n"),
        std::string("v 0 0 0 255 0 9\nv 2 0 0 1 1 1\nv 0 1 0.5 0 0 0\nf -3 -2 -1")}) {
    std::ofstream(folder_ / "a.obj", std::ios::binary) << text;
    EXPECT_EQ(scan_corners(model::read_scan(folder_ / "a.obj")),
              (std::vector<glm::dvec3>{{0, 0, 0}, {2, 0, 0}, {0, 1, 0.5}}))
        << text;
  }
}

// A square with a square hole, which a bridge joins to the border: 4 - 1 = 3.
TEST_F(ScanRead, FacesWithHolesKeepThem) {
  std::ofstream(folder_ / "a.obj")
      << "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nv .5 .5 0\nv .5 1.5 0\nv 1.5 1.5 0\nv 1.5 .5 0\n"
         "f 1 2 3 4 1 5 6 7 8 5\n";
  const model::ScanFile file = model::read_scan(folder_ / "a.obj");
  EXPECT_EQ(file.mesh.triangles(), 8u);
  EXPECT_NEAR(area_of(file), 3, 1e-6);
}

// Six digits at 5418 km leave metres; near the origin, and of whole numbers there, they are enough.
TEST_F(FarScanRead, OfFewDigitsSaysItsSteps) {
  for (const auto& [x, step] : {std::pair("446000.5", 0.1), {"446000.501", 1e-3}}) {
    std::ofstream(folder_ / "a.obj")
        << "v " << x << " 0 0\nv 446001 1 0\nv 446001.2 1 1\nf 1 2 3\n";
    EXPECT_DOUBLE_EQ(model::read_scan(folder_ / "a.obj").step, step) << x;
    EXPECT_TRUE(model::read_scan(folder_ / "a.obj").is_step_of_text);
    std::ofstream(folder_ / "a.ply")
        << "ply\nformat ascii 1.0\nelement vertex 3\nproperty double y\nproperty double "
           "x\nproperty "
           "double z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 "
        << x << " 0\n1 4.460010e5 0\n1 446001.2 1\n3 0 1 2\n";
    EXPECT_DOUBLE_EQ(model::read_scan(folder_ / "a.ply").step, step) << x;
  }
  std::ofstream(folder_ / "a.obj") << "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  EXPECT_EQ(model::read_scan(folder_ / "a.obj").step, 0);
}

// The front stays in front, as in glTF.
TEST_F(ScanRead, MirroredNodesOfFbxTurnTheirFaces) {
  std::string text = fbx_text;
  const std::string place = "      P: \"Lcl Translation\"";
  text.insert(text.find(place), "      P: \"Lcl Scaling\", \"Lcl Scaling\", \"\", \"A\",-1,1,1\n");
  std::ofstream(folder_ / "plain.fbx") << fbx_text;
  std::ofstream(folder_ / "mirrored.fbx") << text;
  const auto front = [&](const char* name) {
    const std::vector<glm::dvec3> p = scan_corners(model::read_scan(folder_ / name));
    glm::dvec3 sum(0);
    for (std::size_t i = 0; i < p.size(); i += 3)
      sum += glm::cross(p[i + 1] - p[i], p[i + 2] - p[i]);
    return sum;
  };
  const glm::dvec3 plain = front("plain.fbx"), mirrored = front("mirrored.fbx");
  EXPECT_GT(glm::length(plain), 1);
  EXPECT_LT(glm::distance(mirrored, glm::dvec3(-plain.x, plain.y, plain.z)), 1e-5);
}

TEST_F(ScanRead, AreKnownByTheirBytes) {
  write_ply(folder_ / "scan.obj", lump(6));
  EXPECT_EQ(model::read_scan(folder_ / "scan.obj").mesh.triangles(), lump(6).triangles());
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
    EXPECT_EQ(scan_corners(model::read_scan(folder_ / "a.ply")),
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
    EXPECT_THAT(refusal("a.ply", text), AllOf(HasSubstr("a.ply: "), HasSubstr(words)));
}

TEST_F(ScanRead, StlIsKnownByItsBytes) {
  const std::string text =
      "SOLID facet\n FACET NORMAL 0 0 1\n  OUTER LOOP\n   VERTEX 0 0 0\n   VERTEX 2 0 0\n   VERTEX "
      "0 "
      "1 0.5\n  ENDLOOP\n ENDFACET\nENDSOLID facet\n";
  std::string lower = text;
  std::ranges::transform(lower, lower.begin(), [](unsigned char c) { return std::tolower(c); });
  for (const std::string& solid : {text, lower, lower + lower, "\xef\xbb\xbf" + lower}) {
    std::ofstream(folder_ / "a.stl") << solid;
    const std::vector<glm::dvec3> read = scan_corners(model::read_scan(folder_ / "a.stl"));
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

}  // namespace
}  // namespace previz::test
