// Scans that are placed by the tags of the set that their own colours show.
#include "daemon/tools/model/scans.hpp"

#include "tests/support/content_of.hpp"
#include "tests/support/gltf_writer.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"
#include "tests/support/tracking_synthetic.hpp"
#include "tests/unit/model/scan_files.hpp"
#include "tests/unit/model/tagged_scan.hpp"

namespace previz::test {
namespace {

constexpr double texel_m = 1e-3;

class ScanTags : public testing::Test {
 protected:
  ScanTags() {
    parts_.file = folder_ / "model.toml";
    parts_.scans.push_back({.name = "set",
                            .file = folder_ / "set.obj",
                            .unit = model::LengthUnit::mm,
                            .up = model::UpAxis::y,
                            .error_m = 0,
                            .points = {}});
    tracking_.tags = tags_of(faces_);
  }

  // In millimetres, turned Y up and moved.
  static glm::dvec3 in_mm(const glm::dvec3& p) {
    return 1000.0 * (glm::dvec3(p.x, p.z, -p.y) + glm::dvec3(0.3, -0.1, 0.7));
  }

  // Writes set.obj of the faces.
  void write(const std::function<glm::dvec3(const glm::dvec3&)>& scan_from_world = in_mm) {
    TaggedScan scan = textured_scan(faces_, texel_m);
    scan.move(scan_from_world);
    write_textured_obj(folder_ / "set.obj", scan);
  }

  std::vector<model::NamedMesh> placed() {
    std::ostringstream out;
    auto scans = model::place_scans(parts_, {}, {}, model::read_scans(parts_, tracking_, out), out);
    report_ = out.str();
    return scans;
  }

  std::string refusal() {
    return error_of([&] { placed(); });
  }

  // Returns how far the placed scan's vertices are from those of the truth, at most.
  double worst_of(const std::vector<model::NamedMesh>& scans, const TaggedScan& truth) const {
    const model::ShadedMesh& mesh = scans.at(0).mesh;
    EXPECT_EQ(mesh.indices.size(), truth.indices.size());
    double worst = 0;
    for (std::size_t i = 0; i < std::min(mesh.indices.size(), truth.indices.size()); ++i)
      worst = std::max(worst, double(glm::distance(mesh.positions[mesh.indices[i]],
                                                   truth.positions[truth.indices[i]])));
    return worst;
  }

  TemporaryDirectory folder_;
  std::vector<TaggedFace> faces_ = table_with_box();
  set::Tracking tracking_;
  model::Parts parts_;
  std::string report_;
};

// A corner is the crossing of edges that are eight cells of 10 pixels long, so that it is known to
// a fraction of a pixel; the scan ends at most 1.5 times as far from the centre of its tags as they
// do. One pixel is therefore a generous bound.
TEST_F(ScanTags, PlaceOneWhoseTextureHasThemInPieces) {
  write();
  const auto scans = placed();
  EXPECT_LT(worst_of(scans, textured_scan(faces_, texel_m)), texel_m);
  EXPECT_THAT(report_, HasSubstr("scan set: placed by tags 3, 5 and 7 (12 corners), rms 0."));
  EXPECT_THAT(report_, HasSubstr("times its size"));
  EXPECT_THAT(report_, Not(HasSubstr("tag 3 ")));
}

TEST_F(ScanTags, AreFoundInAGlbWithItsTexture) {
  TaggedScan scan = textured_scan(faces_, texel_m);
  scan.move([](const glm::dvec3& p) { return 1e-3 * in_mm(p); });
  write_textured_glb(folder_ / "set.glb", scan);
  parts_.scans[0].file = folder_ / "set.glb";
  parts_.scans[0].unit.reset();
  parts_.scans[0].up.reset();
  EXPECT_LT(worst_of(placed(), textured_scan(faces_, texel_m)), texel_m);
  EXPECT_THAT(report_, HasSubstr("placed by tags 3, 5 and 7"));
}

// As much as of a texture of 2 mm is shown by vertices that are 2 mm apart.
TEST_F(ScanTags, AreFoundInTheColoursOfVertices) {
  constexpr double step_m = 2e-3;
  const TaggedScan truth = vertex_coloured_scan(faces_, step_m);
  TaggedScan scan = truth;
  scan.move(in_mm);
  write_coloured_ply(folder_ / "set.ply", scan);
  parts_.scans[0].file = folder_ / "set.ply";
  EXPECT_LT(worst_of(placed(), truth), step_m);
  EXPECT_THAT(report_, HasSubstr("placed by tags 3, 5 and 7"));
}

TEST_F(ScanTags, GiveTheLikelyUnitAndAxis) {
  write();
  parts_.scans[0].unit.reset();
  parts_.scans[0].up.reset();
  const std::string missing = refusal();
  EXPECT_THAT(missing, HasSubstr("unit is missing, and set.obj does not give it; its tags fit best "
                                 "with unit = \"mm\""));
  EXPECT_THAT(missing, HasSubstr("its tags fit best with up = \"y\""));
  parts_.scans[0].unit = model::LengthUnit::m;
  parts_.scans[0].up = model::UpAxis::y;
  EXPECT_THAT(refusal(), HasSubstr("1000 times smaller: is its unit \"mm\"?"));
}

TEST_F(ScanTags, OfAMirroredScanAreRefused) {
  TaggedScan scan = textured_scan(faces_, texel_m);
  scan.move([](const glm::dvec3& p) { return in_mm({-p.x, p.y, p.z}); });
  write_textured_obj(folder_ / "set.obj", scan);
  EXPECT_THAT(refusal(), HasSubstr("tags fit to 0."));  // its faces are inside out
  EXPECT_THAT(refusal(), HasSubstr("mm if the scan is mirrored"));
  for (std::size_t i = 0; i < scan.indices.size(); i += 3)
    std::swap(scan.indices[i], scan.indices[i + 1]);
  write_textured_obj(folder_ / "set.obj", scan);
  EXPECT_THAT(refusal(), HasSubstr("scan \"set\", set.obj: is mirrored, or its faces are inside "
                                   "out"));
}

// Coordinates of UTM; those of the scan near the origin are rounded by as little.
TEST_F(ScanTags, OfAScanInCoordinatesOfACountryAreAsNear) {
  TaggedScan scan = textured_scan(faces_, texel_m);
  scan.move(in_mm);
  const glm::dvec3 far(446000500, 5418000250, 310750);  // mm
  write_textured_obj(folder_ / "set.obj", scan, far);
  EXPECT_LT(worst_of(placed(), textured_scan(faces_, texel_m)), texel_m);
  EXPECT_THAT(report_, HasSubstr("placed by tags 3, 5 and 7 (12 corners), rms 0."));
}

// At 5418 km single precision has steps of 0.5 m.
TEST_F(ScanTags, OfAScanThatLostItsShapeToSinglePrecisionAreNotLookedFor) {
  TaggedScan scan = textured_scan(faces_, texel_m);
  scan.move([](const glm::dvec3& p) { return p + glm::dvec3(446000.5, 5418000.25, 310.75); });
  write_textured_glb(folder_ / "set.glb", scan);
  parts_.scans[0].file = folder_ / "set.glb";
  parts_.scans[0].unit.reset();
  EXPECT_THAT(refusal(), HasSubstr("scan \"set\": set.glb keeps its coordinates in single "
                                   "precision, which as far from the origin as (446000."));
  EXPECT_THAT(refusal(), HasSubstr("has steps of 0.65 units"));
  EXPECT_THAT(refusal(), HasSubstr("subtract (446001, 5418000, 311) from its coordinates"));
}

TEST_F(ScanTags, NeedColours) {
  write_obj(folder_ / "set.obj", lump(6), 1e-3);
  EXPECT_THAT(refusal(), HasSubstr("set.obj: has no points, and neither a texture nor colours"));
  EXPECT_THAT(refusal(), HasSubstr("under [scan.points]"));
}

TEST_F(ScanTags, NeedTagsInTheSet) {
  write();
  tracking_.tags.clear();
  EXPECT_THAT(refusal(), HasSubstr("the set has no tag to place it by"));
}

TEST_F(ScanTags, OfTexturesThatCannotBeReadAreNamed) {
  write();
  std::filesystem::rename(folder_ / "set.png", folder_ / "other.png");
  EXPECT_THAT(refusal(), HasSubstr("set.obj: its texture \"set.png\" is missing; put it beside"));
  std::ofstream(folder_ / "set.png") << "junk";
  EXPECT_THAT(refusal(),
              HasSubstr("set.obj: its texture \"set.png\": is neither PNG, JPEG nor WebP"));
  std::string png(test::content_of(folder_ / "other.png"));
  std::ofstream(folder_ / "set.png", std::ios::binary) << png.substr(0, png.size() / 2);
  EXPECT_THAT(refusal(), HasSubstr("set.png\": is cut short"));
  png[18] = 0x7f;  // the third byte of the width
  std::ofstream(folder_ / "set.png", std::ios::binary) << png;
  EXPECT_THAT(refusal(), HasSubstr("; a side is at most 16384"));
}

TEST_F(ScanTags, AreFoundWhereAnotherComputerHadTheTexture) {
  write();
  std::ofstream(folder_ / "set.mtl") << "newmtl atlas\nmap_Kd C:\\scans\\set.png\n";
  placed();
  EXPECT_THAT(report_, HasSubstr("placed by tags 3, 5 and 7"));
}

TEST_F(ScanTags, OfWhichThereIsOneAreWarnedOf) {
  faces_[0].tags.pop_back();
  faces_[1].tags.clear();
  write();
  // As far from the tag as the table ends, the scan is off by more than at its corners.
  EXPECT_LT(worst_of(placed(), textured_scan(faces_, texel_m)), 5 * texel_m);
  EXPECT_THAT(report_, HasSubstr("placed by tag 3 (4 corners)"));
  EXPECT_THAT(report_,
              HasSubstr("warning: scan set: tag 3 is the only tag that can be used; 1 m from it"));
}

TEST_F(ScanTags, ThatAreThereTwiceAreIgnored) {
  faces_[5].tags = {tag_on(faces_[5], 5, 0.08, {0.1, 0.07})};
  write();
  placed();
  EXPECT_THAT(report_, HasSubstr("placed by tags 3 and 7 (8 corners)"));
  EXPECT_THAT(report_, HasSubstr("warning: scan set: tag 5 is on the scan at 2 places; ignored"));
  tracking_.tags = {tracking_.tags[1]};
  EXPECT_THAT(refusal(), HasSubstr("no tag on it can be used: tag 5 is on the scan at 2 places"));
}

TEST_F(ScanTags, OfOtherSetsAreIgnored) {
  write();
  const std::vector<set::Tag> all = tracking_.tags;
  tracking_.tags = {all[0], all[2]};
  placed();
  EXPECT_THAT(report_, HasSubstr("placed by tags 3 and 7"));
  EXPECT_THAT(report_, HasSubstr("shows tag 5, which the set does not have fixed in the world"));
  tracking_.tags = {flat_tag(11, 0.08, {0, 0, 0})};
  EXPECT_THAT(refusal(), HasSubstr("shows tags 3, 5 and 7 and no tag that the set has"));
}

TEST_F(ScanTags, OfAnotherSizeAreIgnored) {
  write();
  tracking_.tags[1].size_m = 0.1;
  placed();
  EXPECT_THAT(report_, HasSubstr("placed by tags 3 and 7"));
  EXPECT_THAT(report_, HasSubstr("tag 5 is 0.80 times as large as the set's other tags make it"));
}

TEST_F(ScanTags, ThatWereMovedAreNamed) {
  write();
  tracking_.tags[1].world_from_tag[3].x += 0.05;
  EXPECT_THAT(refusal(), testing::ContainsRegex("tag 5 is (49|50)\\.[0-9] mm from where the other "
                                                "tags put it; if one was moved"));
}

TEST_F(ScanTags, TooSmallForTheTextureAreCounted) {
  TaggedScan scan = textured_scan(faces_, 16e-3);
  scan.move(in_mm);
  write_textured_obj(folder_ / "set.obj", scan);
  EXPECT_THAT(refusal(), HasSubstr("a tag of 80 mm has 5 pixels along a side, and 24 are needed"));
}

// One tag that cannot be read among the many pixels of a fine texture is not the texture's fault.
TEST_F(ScanTags, ThatAreFineEnoughButMissingAreNotTheTexturesFault) {
  for (TaggedFace& face : faces_) face.tags.clear();
  write();
  const std::string none = refusal();
  EXPECT_THAT(none, HasSubstr("that can be read, although a tag of 80 mm has 80 pixels along a "
                              "side; check that tags were in view"));
  EXPECT_THAT(none, Not(HasSubstr("larger textures")));
}

// A cell of 10 mm has 3.03 pixels.
TEST_F(ScanTags, OfAsManyPixelsAsAreNeededAreFound) {
  constexpr double coarse_m = 3.3e-3;
  TaggedScan scan = textured_scan(faces_, coarse_m);
  scan.move(in_mm);
  write_textured_obj(folder_ / "set.obj", scan);
  EXPECT_LT(worst_of(placed(), textured_scan(faces_, coarse_m)), coarse_m);
}

// A hole that was filled has one point of the texture, a damaged face far more than all of it.
TEST_F(ScanTags, AreFoundBesideFacesWithoutUsefulCoordinates) {
  TaggedScan scan = textured_scan(faces_, texel_m);
  for (const float far : {0.0f, 1e6f}) {
    const auto first = static_cast<unsigned>(scan.positions.size());
    for (const glm::vec2 corner : {glm::vec2(0, 0), {1, 0}, {0, 1}}) {
      scan.positions.emplace_back(0.7f + 3 * corner.x, 3 * corner.y, 0);
      scan.uvs.push_back(far * corner);
    }
    scan.indices.insert(scan.indices.end(), {first, first + 1, first + 2});
  }
  scan.move(in_mm);
  write_textured_obj(folder_ / "set.obj", scan);
  placed();
  EXPECT_THAT(report_, HasSubstr("placed by tags 3, 5 and 7"));
}

// The strip of tag 3 has two triangles; one faces away from its neighbours.
TEST_F(ScanTags, AreFoundOnFacesThatAreTurned) {
  TaggedScan scan = textured_scan(faces_, texel_m);
  std::swap(scan.indices[9], scan.indices[10]);
  scan.move(in_mm);
  write_textured_obj(folder_ / "set.obj", scan);
  placed();
  EXPECT_THAT(report_, HasSubstr("placed by tags 3, 5 and 7"));
  EXPECT_THAT(report_, HasSubstr("1 faces turned"));
}

TEST_F(ScanTags, OfTexturesOutsideOfTheScansFolderAreNotLookedAt) {
  write();
  const auto inside = folder_ / "inside";
  std::filesystem::create_directory(inside);
  std::filesystem::rename(folder_ / "set.obj", inside / "set.obj");
  parts_.scans[0].file = inside / "set.obj";
  const std::string outside = std::filesystem::absolute(folder_ / "set.png").string();
  for (const std::string& path :
       {std::string("../set.png"), std::string("x/../../set.png"), outside}) {
    std::ofstream(inside / "set.mtl") << "newmtl atlas\nmap_Kd " << path << '\n';
    EXPECT_THAT(refusal(), HasSubstr("set.png\" is missing; put it beside the scan")) << path;
  }
  std::filesystem::rename(folder_ / "set.png", inside / "set.png");
  placed();
  EXPECT_THAT(report_, HasSubstr("placed by tags 3, 5 and 7"));
}

class GltfScanTags : public ScanTags {
 protected:
  GltfScanTags() {
    scan_.move([](const glm::dvec3& p) { return 1e-3 * in_mm(p); });
    parts_.scans[0].file = file_;
    parts_.scans[0].unit.reset();
    parts_.scans[0].up.reset();
  }

  // Writes the scan with its description changed.
  void write_changed(const std::function<void(GltfWriter::Json&)>& change) {
    write_textured_glb(file_, scan_);
    GltfWriter::Json json = GltfWriter::Json::parse(test::content_of(file_));
    change(json);
    std::ofstream(file_) << json;
  }

  const std::filesystem::path file_ = folder_ / "set.gltf";
  TaggedScan scan_ = textured_scan(faces_, texel_m);
};

TEST_F(GltfScanTags, AreFoundInAPictureBesideIt) {
  write_changed([](GltfWriter::Json& json) { json["images"][0] = {{"uri", "the%20atlas.png"}}; });
  EXPECT_THAT(refusal(), HasSubstr("image 0 \"the%20atlas.png\""));
  const std::vector<unsigned char> png = png_of(scan_);
  std::ofstream(folder_ / "the atlas.png", std::ios::binary)
      .write(reinterpret_cast<const char*>(png.data()), static_cast<std::streamsize>(png.size()));
  placed();
  EXPECT_THAT(report_, HasSubstr("placed by tags 3, 5 and 7"));
}

// The transform takes back what was done to the coordinates (KHR_texture_transform).
TEST_F(GltfScanTags, AreFoundInATransformedTexture) {
  for (glm::vec2& uv : scan_.uvs) uv = {2 * uv.x - 0.25f, uv.y};
  write_changed([](GltfWriter::Json& json) {
    json["extensionsUsed"] = GltfWriter::Json::array({"KHR_texture_transform"});
    json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] = {
        {"KHR_texture_transform", {{"offset", {0.125, 0}}, {"scale", {0.5, 1}}}}};
  });
  placed();
  EXPECT_THAT(report_, HasSubstr("placed by tags 3, 5 and 7"));
}

// The last face has no tag; a picture repeats itself beyond its borders.
TEST_F(GltfScanTags, AreFoundByCoordinatesBeyondTheTexture) {
  for (glm::vec2& uv : scan_.uvs) uv += glm::vec2(2, -3);
  scan_.uvs.back() = glm::vec2(std::numeric_limits<float>::quiet_NaN());
  write_textured_glb(file_, scan_);
  placed();
  EXPECT_THAT(report_, HasSubstr("placed by tags 3, 5 and 7"));
}

TEST_F(GltfScanTags, AreFoundInTheColoursOfVertices) {
  scan_ = vertex_coloured_scan(faces_, 2e-3);
  scan_.move([](const glm::dvec3& p) { return 1e-3 * in_mm(p); });
  write_coloured_glb(file_, scan_);
  placed();
  EXPECT_THAT(report_, HasSubstr("placed by tags 3, 5 and 7"));
}

}  // namespace
}  // namespace previz::test
