// Ground truth sets: read from disk, and refused where they are wrong. That they become sessions is
// shown by what is made of these (truth_picture_test.cpp, runner_test.sh).
#include "tests/truth/truth_set.hpp"
#include "tests/support/test.hpp"

#include <nlohmann/json.hpp>

#include "tests/truth/truth_take.hpp"

namespace previz::truth::truth_set_test {

namespace fs = std::filesystem;
using nlohmann::json;

const fs::path glass = fs::path(PREVIZ_SOURCE_DIR) / "tests/truth/data/glass";

// A copy of the bundled set whose set.json a test may change.
class ChangedSet : public testing::Test {
 protected:
  void SetUp() override {
    directory_ =
        fs::path(testing::TempDir()) /
        ("truth_set_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
    fs::remove_all(directory_);
    fs::copy(glass, directory_, fs::copy_options::recursive);
    std::ifstream(directory_ / "set.json") >> json_;
  }
  void TearDown() override { fs::remove_all(directory_); }

  TruthSet load() {
    std::ofstream(directory_ / "set.json") << json_;
    return load_truth_set(directory_);
  }
  std::string refusal() {
    return test::error_of([&] { load(); });
  }

  fs::path directory_;
  json json_;
};

TEST(TruthSet, ReadsTheBundledSet) {
  const TruthSet set = load_truth_set(glass);
  EXPECT_EQ(set.name, "glass");
  EXPECT_EQ(set.observer.intrinsics.width, 640);
  EXPECT_DOUBLE_EQ(set.observer.intrinsics.cx, 316.2);
  ASSERT_TRUE(set.observer.lens);
  EXPECT_DOUBLE_EQ(set.observer.lens->focal_length_m, 0.0235);
  EXPECT_DOUBLE_EQ(set.observer.lens->focus_distance_m, 0.78);
  EXPECT_DOUBLE_EQ(set.exposure, 1.1);
  EXPECT_EQ(set.frames.size(), 2u);
  EXPECT_EQ(set.truth_frames, (std::vector<int>{0, 12}));
  EXPECT_EQ(set.notes.size(), 1u) << "frame 23 is not bundled";
  EXPECT_EQ(set.light_frames.size(), 7u);
  EXPECT_TRUE(
      std::is_sorted(set.light_frames.begin(), set.light_frames.end(),
                     [](const auto& a, const auto& b) { return a.timestamp_ns < b.timestamp_ns; }));
  ASSERT_TRUE(set.light_camera);
  EXPECT_NEAR(set.light_camera->intrinsics.max_angle_rad, 100 * std::numbers::pi / 180, 1e-12);
  ASSERT_EQ(set.tags.size(), 3u);
  // Corner 2 (upper right) of a tag is half its size along its axes.
  const glm::dvec3 corner = set.tags[1].world_from_tag * glm::dvec4(0.04, 0.04, 0, 1);
  EXPECT_NEAR(corner.x, 0.32315704, 1e-7);
  EXPECT_NEAR(corner.y, -0.05065242, 1e-7);
}

TEST(TruthSet, ReadsTruthPicturesAndThePlate) {
  const TruthSet set = load_truth_set(glass);
  const TruthFrame truth = load_truth_frame(set, 12);
  double real = 0, mask = 0, plate = 0;
  const auto pixels = static_cast<double>(truth.mask.size());
  for (std::size_t i = 0; i < truth.mask.size(); ++i) {
    real += static_cast<double>(truth.real[i].x) / pixels;
    plate += static_cast<double>(truth.plate[i].x) / pixels;
    mask += static_cast<double>(truth.mask[i]) / pixels;
  }
  // set.json's own means; the pictures' mantissas are rounded to 7 bits, at most 0.4 %.
  EXPECT_NEAR(real, 0.24324, 0.004 * 0.24324);
  EXPECT_NEAR(mask, 0.05825, 2e-3);
  EXPECT_NEAR(plate / real, 1, 5e-3);  // 8-bit rounding and sensor noise average out
  EXPECT_NEAR(truth.diff_rmse.value(), 0.0021994, 1e-6);
  EXPECT_NEAR(truth.mixed_rmse_of_mean.value(), 0.036561, 1e-5);
}

TEST_F(ChangedSet, UnderstandsOtherResponses) {
  json_["observer"]["response"] = "value = floor(255*clip(signal)^(1/2.4)+0.5)";
  TruthSet set = load();
  EXPECT_EQ(set.observer.response.kind, ResponseCurve::Kind::gamma);
  EXPECT_DOUBLE_EQ(set.observer.response.gamma, 2.4);
  EXPECT_EQ(set.light_camera->response.kind, ResponseCurve::Kind::gamma) << "as observer";
  json_["observer"]["response"] = "linear";
  EXPECT_EQ(load().observer.response.kind, ResponseCurve::Kind::linear);
  json_["observer"]["response"] = "S-Log3";
  EXPECT_THAT(refusal(), HasSubstr("set.observer.response: 'S-Log3' is not understood"));
}

TEST_F(ChangedSet, MayBeOfAPinholeWithoutLightCameraTagsOrStatistics) {
  json_["observer"]["lens"] = nullptr;
  json_["observer"].erase("distortion");
  json_.erase("light_camera");
  json_.erase("tags");
  json_["truth"].erase("statistics");
  const TruthSet set = load();
  EXPECT_FALSE(set.observer.lens);
  EXPECT_EQ(set.observer.intrinsics.k1, 0);
  EXPECT_FALSE(set.light_camera);
  EXPECT_FALSE(load_truth_frame(set, 0).diff_rmse);
  EXPECT_THROW(write_take(set, {LightFrom::captured, PoseFrom::truth}, directory_ / "a"), Error);
  EXPECT_THROW(write_take(set, {LightFrom::truth, PoseFrom::tracked}, directory_ / "b"), Error);
}

TEST_F(ChangedSet, MayHaveLampsAndNoPictures) {
  json_["lamps"] = {{{"position", {1, 2, 3}}, {"radius_m", 0.05}, {"radiance", {9, 8, 7}}}};
  json_.erase("truth");
  json_["observer"].erase("timestamps");
  const TruthSet set = load();
  EXPECT_FALSE(set.has_pictures);
  EXPECT_EQ(set.truth_frames.size(), json_["observer"]["poses_world_from_camera"].size());
  const std::vector<set::Light> lamps = set_of(set).lights;
  ASSERT_EQ(lamps.size(), 1u);
  EXPECT_EQ(lamps[0].position, glm::dvec3(1, 2, 3));
  EXPECT_EQ(lamps[0].emission, glm::dvec3(9, 8, 7));
  EXPECT_EQ(lamps[0].gain_real, 1) << "a real lamp shines in both worlds";
  EXPECT_THAT(test::error_of([&] { write_take(set, {}, directory_ / "take"); }),
              HasSubstr("has no pictures"));
  EXPECT_THAT(set_file_text(set, {}), HasSubstr("type = \"sphere\"\nposition = [1."));
}

TEST_F(ChangedSet, RefusalsNameFileAndKey) {
  json_["observer"]["exposure"] = 0;
  EXPECT_THAT(refusal(), HasSubstr("set.json: set.observer.exposure: must be above 0"));
  json_["observer"]["exposure"] = 1.1;
  json_["observer"]["lens"].erase("focus_distance_m");
  EXPECT_THAT(refusal(), HasSubstr("set.observer.lens: has no 'focus_distance_m'"));
  json_["observer"]["lens"]["focus_distance_m"] = 1;
  json_["observer"]["vignetting"] = "cos4";
  EXPECT_THAT(refusal(), HasSubstr("set.observer.vignetting: vignetting is not supported"));
  json_["observer"]["vignetting"] = nullptr;
  json_["truth"]["frames"] = {23};
  EXPECT_THAT(refusal(), HasSubstr("no frame has both truth and picture"));
}

}  // namespace previz::truth::truth_set_test
