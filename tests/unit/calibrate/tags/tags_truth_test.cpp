// The map of tags on pictures whose tags are known: rendered sets, and photographs where they are
// there.
#include <nlohmann/json.hpp>

#include "daemon/core/session/session.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/tools/calibrate/calibrate.hpp"
#include "daemon/tools/calibrate/lens/source.hpp"
#include "daemon/tools/calibrate/tags/moved_tags.hpp"
#include "daemon/tools/calibrate/tags/tag_lens.hpp"
#include "daemon/tools/calibrate/tags/tag_survey.hpp"
#include "daemon/tools/calibrate/tags/tag_walk.hpp"
#include "tests/support/shared_data.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"
#include "tests/support/units.hpp"
#include "tests/truth/truth_set.hpp"

namespace previz::calibrate::tags_truth_test {

namespace fs = std::filesystem;

TagSurvey survey_of(const fs::path& footage, const ObserverCalibration& camera,
                    const WalkOptions& options, int origin) {
  const auto source = open_source(footage, "observer");
  const TagWalk walk =
      gather_walk(*source, camera.intrinsics, camera.response, options, [](const std::string&) {});
  TagSurveyOptions how;
  how.origin = origin;
  return survey_tags(walk, camera.intrinsics, how);
}

TagSurvey survey_of(const truth::TruthSet& set) {
  WalkOptions options;
  options.detector.family = set.tag_family;
  for (const set::Tag& tag : set.tags) options.sizes.by_id_m[tag.id] = tag.size_m;
  return survey_of(set.directory / "observer", set.observer, options, 0);
}

struct Errors {
  double shift_m = 0, turn_rad = 0;
};

Errors errors_of(const SurveyedTag& tag, const std::vector<set::Tag>& truth) {
  const set::Tag& exact = *std::ranges::find(truth, tag.id, &set::Tag::id);
  const Errors errors{
      glm::distance(tag.world_from_tag[3], exact.world_from_tag[3]),
      tracking::rotation_between(tracking::camera_from_world(tag.world_from_tag),
                                 tracking::camera_from_world(exact.world_from_tag))};
  std::printf(
      "tag %d: off by %.3f mm and %.4f degrees, stated %.3f mm and %.4f degrees, rms %.3f "
      "px over %d pictures\n",
      tag.id, 1000 * errors.shift_m, errors.turn_rad / test::degree, 1000 * tag.position_sigma_m,
      tag.rotation_sigma_rad / test::degree, tag.rms_px, tag.pictures);
  return errors;
}

void expect_within(const TagSurvey& survey, const std::vector<set::Tag>& truth,
                   const std::function<Errors(const SurveyedTag&)>& most) {
  EXPECT_EQ(survey.tags.size(), truth.size());
  EXPECT_TRUE(survey.moved.empty()) << words_of(survey.moved.front());
  for (const SurveyedTag& tag : survey.tags) {
    const Errors errors = errors_of(tag, truth);
    EXPECT_LE(errors.shift_m, most(tag).shift_m) << "tag " << tag.id;
    EXPECT_LE(errors.turn_rad, most(tag).turn_rad) << "tag " << tag.id;
  }
}

// The aim for a table of half a metre: tags within 0.3 mm and 0.1 degrees.
void expect_places(const TagSurvey& survey, const std::vector<set::Tag>& truth) {
  expect_within(survey, truth, [](const SurveyedTag&) {
    return Errors{0.0003, 0.1 * test::degree};
  });
}

// Each error is within five times its largest deviation (tags_test.cpp derives it), and
// that is no excuse for any.
void expect_as_stated(const TagSurvey& survey, const std::vector<set::Tag>& truth) {
  expect_within(survey, truth, [](const SurveyedTag& tag) {
    return Errors{5 * tag.position_sigma_m + 1e-12, 5 * tag.rotation_sigma_rad + 1e-7};
  });
  for (const SurveyedTag& tag : survey.tags)
    EXPECT_LE(tag.position_sigma_m, 0.001) << "tag " << tag.id;
}

// Six pictures, of which three show tag 2.
TEST(TagMapOfTheDemo, IsAsCertainAsStated) {
  const fs::path demo = fs::path(PREVIZ_SOURCE_DIR) / "config/demo";
  const set::Set set = set::load_set(demo / "demo.toml");
  WalkOptions options;
  for (const set::Tag& tag : set.tracking.tags) options.sizes.by_id_m[tag.id] = tag.size_m;
  expect_as_stated(survey_of(demo / "session",
                             *session::open_session(demo / "session").info.observer, options, 0),
                   set.tracking.tags);
}

// Two tags, out of focus, seen from within 8 degrees: less certain than the aim.
TEST(TagMapOfStatues, IsAsCertainAsStated) {
  const fs::path directory = test::shared_data("groundtruth/statues");
  PREVIZ_NEEDS(directory);
  const truth::TruthSet set = truth::load_truth_set(directory);
  expect_as_stated(survey_of(set), set.tags);
}

class TagMapSharedSets : public testing::TestWithParam<const char*> {};

TEST_P(TagMapSharedSets, WithinBounds) {
  const fs::path set = test::shared_data("groundtruth") / GetParam();
  PREVIZ_NEEDS(set);
  const truth::TruthSet truth = truth::load_truth_set(set);
  expect_places(survey_of(truth), truth.tags);
}

INSTANTIATE_TEST_SUITE_P(Sets, TagMapSharedSets, ::testing::Values("desk", "glass"));

// The lens of the map beside the photographs, whose principal point counts from a pixel's corner.
// The curve is left out, as in that map's corners; it is not known.
ObserverCalibration camera_of(const fs::path& room) {
  const nlohmann::json map = nlohmann::json::parse(std::ifstream(room / "tag_map_derived.json"));
  ObserverCalibration camera;
  camera.response.kind = ResponseCurve::Kind::linear;
  PinholeIntrinsics& lens = camera.intrinsics;
  lens.width = 816, lens.height = 612;
  lens.fx = map["K"][0][0], lens.fy = map["K"][1][1];
  lens.cx = map["K"][0][2].get<double>() - 0.5, lens.cy = map["K"][1][2].get<double>() - 0.5;
  lens.k1 = map["dist_k1k2"][0], lens.k2 = map["dist_k1k2"][1];
  return camera;
}

// 48 photographs of a room with 20 tags in a ring of pairs, by a telephone. That map had 0.291 px,
// its lens adjusted with it to libapriltag's corners, without tag 13; a lens that was not adjusted
// with the map had 0.463 px, which bounds a map that has the lens as given. (Tag 13 was left out
// there for 6 to 19 px in six photographs. It stays where it is: all of its ten fit.)
TEST(RealTags, Room) {
  const fs::path room = test::shared_data("real/apriltag/room");
  PREVIZ_NEEDS(room);
  const ObserverCalibration camera = camera_of(room);
  WalkOptions options;
  options.sizes.common_m = 0.127;
  const TagSurvey survey = survey_of(room, camera, options, 0);
  std::printf("rms %.3f px over %zu tags, %zu of %zu sightings\n", survey.rms_px,
              survey.tags.size(), survey.sightings_used, survey.sightings);
  EXPECT_EQ(survey.tags.size(), 20u);
  for (const MovedTag& moved : survey.moved) ADD_FAILURE() << moved.id << ": " << words_of(moved);
  EXPECT_GE(survey.sightings_used, survey.sightings - 2);
  EXPECT_LE(survey.rms_px, 0.463);
  for (const SurveyedTag& tag : survey.tags) EXPECT_LE(tag.rms_px, 1) << "tag " << tag.id;
}

// The boards of the room reach 55 % of the way to the corners of the picture. By their lens alone
// the map has 0.43 px; 0.30 px is what the crew asks for.
TEST(RealTags, RoomByBoardsThatFilledHalfOfThePicture) {
  const fs::path room = test::shared_data("real/apriltag/room");
  PREVIZ_NEEDS(room);
  const test::TemporaryDirectory folder;
  LensOptions boards;
  boards.footage = room / "calibration";
  boards.board = "chessboard:7x5:30mm";
  boards.table_file = folder / "room.toml";
  std::ostringstream out;
  calibrate_observer(boards, out);
  const set::Observer camera = set::load_set(*boards.table_file).observer;
  WalkOptions options;
  options.sizes.common_m = 0.127;
  const auto source = open_source(room, "observer");
  const TagWalk walk =
      gather_walk(*source, camera.calibration->intrinsics, camera.calibration->response, options,
                  [](const std::string&) {});
  const RefinedLens refined =
      survey_tags_and_lens(walk, camera.calibration->intrinsics, {}, lens_prior(camera.lens_fit));
  std::printf("rms %.3f px, before %.3f px\n", refined.survey.rms_px, refined.rms_before_px);
  EXPECT_TRUE(refined.is_refined) << refined.why_not;
  EXPECT_LE(refined.survey.rms_px, 0.30);
  EXPECT_LT(refined.survey.rms_px, refined.rms_before_px);
}

}  // namespace previz::calibrate::tags_truth_test
