// Tests what a picture shows in place of hidden tags: the surface around them, continued.
#include "daemon/tools/model/under_tags.hpp"

#include <glm/geometric.hpp>

#include "daemon/core/tracking/tag_family.hpp"
#include "tests/support/scenes.hpp"
#include "tests/support/test.hpp"

namespace previz::test {
namespace {

// A tag of 80 mm lies in the middle of a table, and a camera looks down on it from 0.5 m.
class UnderTags : public testing::Test {
 protected:
  UnderTags() {
    parts_.planes = {{.name = "table", .tags = {3}}};
    shape_.planes = {{}};
    layout_.tags = {{&tag_, 1e-4, 0}};
    seen_.surfaces = {{"table", glm::dvec3(0.4)}};
    seen_.world_from_cameras = {look_at({0, 0, 0.5}, {0, 0, 0})};
    give_table(1);
  }
  void give_table(double half_m) {
    const double h = half_m;
    table_ = {"table", {{"face", {{-h, -h, 0}, {h, -h, 0}, {h, h, 0}, {-h, h, 0}}}}};
  }
  // Fills the picture with the plates' radiance over the rendered one, by the place on the table.
  // Nothing is seen of the table under the paper.
  template <class Ratio>
  void see(const glm::dvec2& half_paper_m, const Ratio& ratio) {
    seen_.pixels.clear();
    const glm::dmat3 turn(seen_.world_from_cameras[0]);
    for (int y = 0; y < lens_.height; ++y)
      for (int x = 0; x < lens_.width; ++x) {
        const glm::dvec3 ray =
            turn * glm::dvec3((x - lens_.cx) / lens_.fx, (y - lens_.cy) / lens_.fy, 1);
        const glm::dvec2 at = glm::dvec2(ray) * (0.5 / -ray.z);
        if (std::abs(at.x) < half_paper_m.x && std::abs(at.y) < half_paper_m.y) continue;
        seen_.pixels.push_back(
            {.plate = ratio(at), .rendered = glm::dvec3(1), .px = glm::dvec2(x, y)});
      }
  }
  model::UnderTag under() {
    const std::string family = "tag36h11";
    const model::Colours colours{{"table", glm::dvec3(0.4)}};
    const std::vector<model::Solid> solids{table_};
    return model::under_tags({family, parts_, layout_, shape_, solids, colours}, seen_, lens_)
        .at(0);
  }
  static glm::dvec2 reach(const model::NamedMesh& named) {
    glm::dvec2 most(0);
    for (const glm::vec3& p : named.mesh.positions) most = glm::max(most, glm::dvec2(p));
    return most;
  }

  set::Tag tag_{3, 0.08};
  model::Parts parts_;
  model::Layout layout_;
  model::Shape shape_;
  model::Solid table_;
  calibrate::SurfacePixels seen_;
  PinholeIntrinsics lens_ = pinhole(320, 240, 1).intrinsics;
};

constexpr double half_tag_m = 0.05;  // with its white border

// A table that is brighter towards +x: the middle has the mean, the borders what is beside them.
TEST_F(UnderTags, ContinueTheColoursAround) {
  see(glm::dvec2(half_tag_m), [](const glm::dvec2& at) { return glm::dvec3(1 + 2 * at.x); });
  const model::UnderTag found = under();
  EXPECT_EQ(found.mesh.name, "under tag 3");
  ASSERT_EQ(found.mesh.albedos.size(), found.mesh.mesh.positions.size());
  ASSERT_FALSE(found.mesh.albedos.empty());
  for (std::size_t i = 0; i < found.mesh.albedos.size(); ++i) {
    const glm::vec3 p = found.mesh.mesh.positions[i];
    // Slopes are held back by 2 % for each of two directions.
    EXPECT_NEAR(found.mesh.albedos[i].g, 0.4 * (1 + 2 * p.x), 0.04 * 0.4 * 2 * half_tag_m)
        << p.x << ' ' << p.y;
    EXPECT_GT(p.z, 0);
    EXPECT_LT(p.z, 2e-5);
  }
  // Half a cell of 10 mm beyond the paper.
  EXPECT_NEAR(reach(found.mesh).x, half_tag_m + 0.005, 1e-6);
}

TEST_F(UnderTags, EndHalfACellBeyondAPaperOfAGivenSize) {
  parts_.planes[0].tag_paper_m = {0.21, 0.297};
  see({0.105, 0.1485}, [](const glm::dvec2&) { return glm::dvec3(1); });
  const glm::dvec2 most = reach(under().mesh);
  EXPECT_NEAR(most.x, 0.105 + 0.005, 1e-6);
  EXPECT_NEAR(most.y, 0.1485 + 0.005, 1e-6);
}

// Far cameras tell less well what is above what.
TEST_F(UnderTags, LieHigherWhereACameraIsFarAway) {
  see(glm::dvec2(half_tag_m), [](const glm::dvec2&) { return glm::dvec3(1); });
  EXPECT_NEAR(under().mesh.mesh.positions[0].z, 1e-5, 1e-9);
  seen_.world_from_cameras.push_back(look_at({0, -30, 40}, {0, 0, 0}));
  EXPECT_NEAR(under().mesh.mesh.positions[0].z, 50e-5, 1e-9);
}

// On a cube that is as large as the paper nothing hangs over its edge.
TEST_F(UnderTags, EndAtTheEdgeOfTheFace) {
  give_table(0.054);
  see(glm::dvec2(half_tag_m), [](const glm::dvec2&) { return glm::dvec3(1); });
  EXPECT_NEAR(reach(under().mesh).x, 0.054, 1e-6);
}

// A pen beside the tag is no colour of the table.
TEST_F(UnderTags, LeaveOutWhatTheModelDoesNotHave) {
  see(glm::dvec2(half_tag_m),
      [](const glm::dvec2& at) { return glm::dvec3(at.x > 0.06 && at.x < 0.065 ? 0.1 : 1.0); });
  for (const glm::vec3& albedo : under().mesh.albedos) EXPECT_NEAR(albedo.g, 0.4, 1e-3);
}

// The ramp of a ring on one side alone is not carried on without end.
TEST_F(UnderTags, AreNoBrighterOrDarkerThanWhatIsAround) {
  see(glm::dvec2(half_tag_m), [](const glm::dvec2& at) { return glm::dvec3(1 + 4 * at.x); });
  std::erase_if(seen_.pixels,
                [](const calibrate::SurfacePixel& pixel) { return pixel.plate.g < 1.2; });
  for (const glm::vec3& albedo : under().mesh.albedos) EXPECT_GE(albedo.g, 0.4f * 1.2f - 1e-4f);
}

// A blue stage has no red light, which says nothing of the colour.
TEST_F(UnderTags, AreNumbersWithoutLightInAChannel) {
  see(glm::dvec2(half_tag_m), [](const glm::dvec2&) { return glm::dvec3(1); });
  for (calibrate::SurfacePixel& pixel : seen_.pixels) pixel.rendered.r = pixel.plate.r = 0;
  EXPECT_TRUE(under().mesh.mesh.positions.empty());
}

TEST_F(UnderTags, NeedPixelsAroundTheTag) {
  EXPECT_TRUE(under().mesh.mesh.positions.empty());
  see(glm::dvec2(10), [](const glm::dvec2&) { return glm::dvec3(1); });
  EXPECT_TRUE(under().mesh.mesh.positions.empty());
  EXPECT_EQ(under().pixels, 0u);
}

}  // namespace
}  // namespace previz::test
