// The lens refined by tags, where boards filled the centre of the picture alone: made by the test
// from a lens that is known.
#include "daemon/tools/calibrate/tags/tag_lens.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/core/set/print.hpp"
#include "daemon/tools/calibrate/lens/observer.hpp"
#include "daemon/tools/calibrate/tags/tag_tables.hpp"
#include "tests/support/calibrate_pictures.hpp"
#include "tests/support/tag_walks.hpp"
#include "tests/support/tracking_synthetic.hpp"

namespace previz::calibrate::tag_lens_test {

constexpr double noise_px = 0.1;

PinholeIntrinsics true_lens() {
  PinholeIntrinsics lens = test::plain_lens(1280, 720, 900);
  lens.cx += 6, lens.cy -= 4;
  lens.k1 = -0.12, lens.k2 = 0.06, lens.p1 = 0.001, lens.p2 = -0.0007;
  return lens;
}

// Boards of 180 px about the centre, whose corners reach less than half of the way to the corners
// of the picture.
std::vector<test::Held> in_the_centre() {
  std::vector<test::Held> how;
  for (int i = 0; i < 14; ++i)
    how.push_back({35.0 * ((i % 3) - 1),
                   35.0 * ((i / 3) % 3 - 1),
                   20.0 * (i % 4),
                   {0.16 * ((i % 5) - 2) / 2, 0.1 * ((i % 4) - 1.5), 0.8 + 0.05 * (i % 3)}});
  return how;
}

ObserverFit by_boards(const std::vector<test::Held>& how, unsigned seed) {
  return fit_observer(test::hold(how, true_lens(), noise_px, seed));
}

LensPrior prior_of(const ObserverFit& boards) {
  return lens_prior(lens_fit_table(LensVector(boards.whole_lens.data()),
                                   LensMatrix(boards.whole_covariance.data())));
}

TagWalk walk(int pictures, unsigned seed) {
  std::mt19937 random(seed);
  return test::walk_of(
      true_lens(), test::walk_through_a_room(pictures), [](int) { return test::tags_of_a_room(); },
      noise_px, random);
}

// A distance in the plane whose longer deviation is sigma exceeds 3 sigma in one of 90 cases:
// exp(-9 / 2) = 0.011.
TEST(TagLens, TagsAtTheRimDetermineWhatBoardsInTheCentreLeaveOpen) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    SCOPED_TRACE(seed);
    const ObserverFit boards = by_boards(in_the_centre(), seed);
    EXPECT_LT(boards.reach, 0.6);
    const RefinedLens refined =
        survey_tags_and_lens(walk(60, seed), boards.intrinsics, {}, prior_of(boards));
    ASSERT_TRUE(refined.is_refined) << refined.why_not;
    const double before = corner_difference_px(boards.intrinsics, true_lens());
    const double after = corner_difference_px(refined.survey.lens, true_lens());
    std::printf("corner off by %.3f px, before %.3f px; certain to %.3f px, before %.3f px\n",
                after, before, refined.sigma_px, refined.sigma_before_px);
    EXPECT_LT(after, before);
    EXPECT_LT(after, 3 * refined.sigma_px);
    EXPECT_LE(refined.survey.rms_px, refined.rms_before_px);
    EXPECT_LT(refined.sigma_px, refined.sigma_before_px / std::sqrt(2.0));
  }
}

// The variance of the change is that of the boards' lens less what is left, and less than the
// boards' own; three of their deviations as above.
TEST(TagLens, ALensThatBoardsDetermineStaysWithinWhatTheyAreCertainTo) {
  const ObserverFit boards = by_boards(test::careful_capture(), 4);
  const RefinedLens refined =
      survey_tags_and_lens(walk(40, 4), boards.intrinsics, {}, prior_of(boards));
  const double moved = corner_difference_px(boards.intrinsics, refined.survey.lens);
  std::printf("moved by %.3f px; certain to %.3f px, before %.3f px\n", moved, refined.sigma_px,
              refined.sigma_before_px);
  EXPECT_EQ(refined.boards_factor, 1);
  EXPECT_LE(moved, 3 * refined.sigma_before_px);
  EXPECT_LE(corner_difference_px(refined.survey.lens, true_lens()), 3 * refined.sigma_before_px);
}

// Boards that state a tenth of their deviations, as bent paper makes them do: they are widened
// until the tags do not contradict them, and the rim is as certain as is said.
TEST(TagLens, BoardsThatAreTooSureOfThemselvesCountForLess) {
  const ObserverFit boards = by_boards(in_the_centre(), 8);
  LensPrior prior = prior_of(boards);
  prior.information = prior.information * 100.0;
  const RefinedLens refined = survey_tags_and_lens(walk(60, 8), boards.intrinsics, {}, prior);
  ASSERT_TRUE(refined.is_refined) << refined.why_not;
  EXPECT_GT(refined.boards_factor, 1);
  EXPECT_LT(corner_difference_px(refined.survey.lens, true_lens()), 3 * refined.sigma_px);
}

TEST(TagLens, StaysWhereFewPicturesShowTags) {
  const ObserverFit boards = by_boards(in_the_centre(), 5);
  const RefinedLens refined =
      survey_tags_and_lens(walk(4, 5), boards.intrinsics, {}, prior_of(boards));
  EXPECT_FALSE(refined.is_refined);
  EXPECT_THAT(refined.why_not, HasSubstr("pictures show tags; 5 are needed"));
  EXPECT_EQ(lens_vector(refined.survey.lens), lens_vector(boards.intrinsics));
  EXPECT_EQ(with_lens("# as it is\n", boards.intrinsics, refined.survey.lens), "# as it is\n");
}

TEST(TagLens, StatisticsOfAnotherLensAreRecognised) {
  const ObserverFit boards = by_boards(test::careful_capture(), 6);
  EXPECT_EQ(why_not_of(prior_of(boards), boards.intrinsics), "");
  PinholeIntrinsics other = boards.intrinsics;
  other.fy *= 1.03;
  EXPECT_THAT(why_not_of(prior_of(boards), other), HasSubstr("fy"));
  other = boards.intrinsics;
  other.k4 = 0.1;
  EXPECT_THAT(why_not_of(prior_of(boards), other), HasSubstr("k4"));
}

TEST(TagLens, IsWrittenIntoItsTableAlone) {
  PinholeIntrinsics before = test::plain_lens(640, 480, 600), after = before;
  after.fx = 601.5, after.k1 = -0.1;
  const std::string text =
      "[observer]\ndriver = \"none\"  # off\n\n[observer.intrinsics]\nwidth = 640\nheight = 480\n"
      "fx = 600.0  # mine\nfy = 600.0\ncx = 319.5\ncy = 239.5\n\n[[tag]]\nid = 1\n";
  EXPECT_EQ(with_lens(text, before, after),
            "[observer]\ndriver = \"none\"  # off\n\n[observer.intrinsics]\nwidth = 640\nheight = "
            "480\nfx = 601.5  # mine\nfy = 600.0\ncx = 319.5\ncy = 239.5\nk1 = -0.1\n\n[[tag]]\nid "
            "= 1\n");
}

std::string refusal(const std::string& table) {
  ObserverCalibration camera;
  camera.intrinsics = test::plain_lens(640, 480, 600);
  return test::error_of(
      [&] { set::parse_set(set::intrinsics_toml(camera) + table, "stage.toml"); });
}

// The coefficients are correlated to more than 0.99, and 12 digits are written: the information
// comes back to within that, times the correlation's condition of about 1e6.
TEST(LensFit, IsReadAsItWasWritten) {
  const ObserverFit boards = by_boards(in_the_centre(), 7);
  const set::LensFit table = lens_fit_table(LensVector(boards.whole_lens.data()),
                                            LensMatrix(boards.whole_covariance.data()));
  EXPECT_EQ(refusal(set::lens_fit_toml(table)), "");
  const LensMatrix covariance(boards.whole_covariance.data());
  const LensMatrix unit = lens_prior(table).information * covariance;
  for (int r = 0; r < lens_size; ++r) EXPECT_NEAR(unit(r, r), 1, 1e-5);
}

TEST(LensFit, ThatIsNoneIsRefused) {
  set::LensFit table;
  table.values.assign(8, 0.0);
  table.covariance_root.assign(45, 0.0);
  const std::string said = refusal(set::lens_fit_toml(table));
  EXPECT_THAT(said, HasSubstr("observer.lens_fit.values: has 8 numbers; allowed: 9"));
  EXPECT_THAT(said, HasSubstr("observer.lens_fit.covariance_root: is not the root"));
}

}  // namespace previz::calibrate::tag_lens_test
