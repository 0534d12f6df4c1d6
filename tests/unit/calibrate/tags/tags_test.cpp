// The map of tags from a walk whose truth is known: corners made by the test, then pictures.
#include <glm/gtc/matrix_transform.hpp>
#include <glm/gtc/quaternion.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "daemon/core/set/load.hpp"
#include "daemon/tools/calibrate/calibrate.hpp"
#include "daemon/tools/calibrate/tags/moved_tags.hpp"
#include "daemon/tools/calibrate/tags/tag_survey.hpp"
#include "daemon/tools/calibrate/tags/tag_tables.hpp"
#include "daemon/tools/calibrate/tags/tag_walk.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/tag_walks.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/tracking_synthetic.hpp"
#include "tests/support/units.hpp"

namespace previz::calibrate::tags_test {

using test::degree;

constexpr double noise_px = 0.1;

PinholeIntrinsics walk_lens() {
  PinholeIntrinsics lens = test::plain_lens(1280, 720, 900);
  lens.k1 = -0.12, lens.k2 = 0.04, lens.p1 = 0.001, lens.p2 = -0.0007;
  return lens;
}

TagWalk walk_past(const std::function<std::vector<set::Tag>(int)>& tags_at, unsigned seed = 1,
                  double noise = noise_px, int pictures = 40) {
  std::mt19937 random(seed);
  return test::walk_of(walk_lens(), test::walk_through_a_room(pictures), tags_at, noise, random);
}

std::vector<set::Tag> still(int) {
  return test::tags_of_a_room();
}

const set::Tag& true_tag(const std::vector<set::Tag>& tags, int id) {
  return *std::ranges::find(tags, id, &set::Tag::id);
}

// The motion along the tag's own axes from its true place to the one found.
cv::Vec6d error_of(const SurveyedTag& tag, const set::Tag& truth) {
  const glm::dmat4 d = glm::inverse(truth.world_from_tag) * tag.world_from_tag;
  glm::dquat q = glm::normalize(glm::quat_cast(glm::dmat3(d)));
  if (q.w < 0) q = -q;
  const glm::dvec3 w = 2.0 * glm::dvec3(q.x, q.y, q.z);  // of a small rotation
  return {w.x, w.y, w.z, d[3][0], d[3][1], d[3][2]};
}

void expect_within_sigmas(const TagSurvey& survey, const std::vector<set::Tag>& truth,
                          double sigmas) {
  for (const SurveyedTag& tag : survey.tags) {
    if (tag.position_sigma_m == 0) continue;  // the origin
    const cv::Vec6d e = error_of(tag, true_tag(truth, tag.id));
    const double shift = std::hypot(e[3], e[4], e[5]), turn = std::hypot(e[0], e[1], e[2]);
    EXPECT_LT(shift, sigmas * tag.position_sigma_m) << "tag " << tag.id;
    EXPECT_LT(turn, sigmas * tag.rotation_sigma_rad) << "tag " << tag.id;
    EXPECT_LT(tag.position_sigma_m, 0.001) << "tag " << tag.id;
  }
}

// A distance in three dimensions whose largest deviation is sigma exceeds 5 sigma less than once in
// 100 000: sqrt(2 / pi) 5 exp(-25 / 2) + erfc(5 / sqrt(2)) = 1.5e-5.
TEST(TagSurvey, FindsEveryTagOfARoom) {
  const TagSurvey survey = survey_tags(walk_past(still), walk_lens(), {});
  EXPECT_EQ(survey.tags.size(), 10u);
  EXPECT_TRUE(survey.moved.empty()) << words_of(survey.moved.front());
  EXPECT_TRUE(survey.apart.empty());
  EXPECT_EQ(survey.sightings_used, survey.sightings);
  expect_within_sigmas(survey, still(0), 5);
  EXPECT_THAT(missing_of_tags(survey, {0, 13, 20}, 0), IsEmpty());
}

// The error of a tag against its covariance is a chi-square of 6 degrees: over 8 walks of 9 tags
// its mean is 6 to within 4 sqrt(12 / 8) = 4.9 if the tags of a walk were one, and 4 sqrt(12 / 72)
// = 1.6 if none had to do with another. They share the origin, so between those.
TEST(TagSurvey, ErrorsAreAsLargeAsStated) {
  double sum = 0;
  int count = 0;
  for (unsigned seed = 1; seed <= 8; ++seed) {
    const TagSurvey survey = survey_tags(walk_past(still, seed), walk_lens(), {});
    for (const SurveyedTag& tag : survey.tags) {
      if (tag.position_sigma_m == 0) continue;
      const cv::Vec6d e = error_of(tag, true_tag(still(0), tag.id));
      const cv::Matx66d covariance(tag.covariance.data());
      sum += e.dot(covariance.solve(e, cv::DECOMP_CHOLESKY));
      ++count;
    }
  }
  EXPECT_EQ(count, 72);
  EXPECT_GT(sum / count, 6 - 4.9);
  EXPECT_LT(sum / count, 6 + 4.9);
}

// Small tags, seen coarsely: many single pictures prefer the mirrored pose.
TEST(TagSurvey, MirroredPosesOfSinglePicturesDoNotLast) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const TagSurvey survey = survey_tags(walk_past(still, seed, 0.8), walk_lens(), {});
    EXPECT_EQ(survey.tags.size(), 10u);
    for (const SurveyedTag& tag : survey.tags) {
      const cv::Vec6d e = error_of(tag, true_tag(still(0), tag.id));
      EXPECT_LT(std::hypot(e[0], e[1], e[2]), 3 * degree) << "tag " << tag.id << " seed " << seed;
    }
  }
}

// A tag is pushed a centimetre along the table in the middle of the walk.
std::vector<set::Tag> bumped(int picture, int id, int when = 22) {
  std::vector<set::Tag> tags = still(0);
  if (picture >= when)
    std::ranges::find(tags, id, &set::Tag::id)->world_from_tag[3] += glm::dvec4(0.006, 0.008, 0, 0);
  return tags;
}

TEST(TagSurvey, ATagBumpedByACentimetreIsFoundAndNamed) {
  for (const int id : {1, 7, 20}) {
    SCOPED_TRACE(id);
    const TagWalk walk = walk_past([id](int picture) { return bumped(picture, id); });
    const TagSurvey survey = survey_tags(walk, walk_lens(), {});
    ASSERT_EQ(survey.moved.size(), 1u);
    EXPECT_EQ(survey.moved[0].id, id);
    EXPECT_NEAR(survey.moved[0].distance_m, 0.01, 0.001);
    // Between the two pictures of it around the bump.
    const auto number = [](const std::string& name) { return std::stoi(name.substr(8)); };
    EXPECT_LT(number(survey.moved[0].until), 22);
    EXPECT_GE(number(survey.moved[0].since), 22);
    EXPECT_EQ(survey.tags.size(), 9u);
    expect_within_sigmas(survey, still(0), 5);
    EXPECT_THAT(
        missing_of_tags(survey, {}, 0),
        ElementsAre(HasSubstr("tag " + std::to_string(id) + " again, once it is fixed in place")));
  }
}

TEST(TagSurvey, ATagThatSwingsIsLeftOut) {
  const TagWalk walk = walk_past([](int picture) {
    std::vector<set::Tag> tags = still(0);
    tags[8].world_from_tag[3].x += 0.02 * std::sin(2.4 * picture);
    return tags;
  });
  const TagSurvey survey = survey_tags(walk, walk_lens(), {});
  ASSERT_EQ(survey.moved.size(), 1u);
  EXPECT_EQ(survey.moved[0].id, 13);
  expect_within_sigmas(survey, still(0), 5);
}

std::string refusal(const TagWalk& walk, const TagSurveyOptions& options,
                    const PinholeIntrinsics& lens = walk_lens()) {
  return test::error_of([&] { survey_tags(walk, lens, options); });
}

TEST(TagSurvey, AnOriginThatMovedIsRefused) {
  const TagWalk walk = walk_past([](int picture) { return bumped(picture, 0); });
  const std::string said = refusal(walk, {});
  EXPECT_THAT(said, HasSubstr("tag 0, which defines the world, did not stay in place (moved by "));
  EXPECT_THAT(said, HasSubstr("--origin"));
  EXPECT_THAT(refusal(walk, {.origin = 99, .stated = {}}), HasSubstr("tag 99 is in no picture"));
}

TEST(TagSurvey, ATagOfAnotherSizeThanStatedIsMeasured) {
  for (const int id : {0, 9}) {
    SCOPED_TRACE(id);
    TagWalk walk = walk_past(still);
    const auto t = std::size_t(std::ranges::find(walk.ids, id) - walk.ids.begin());
    const double true_size = walk.sizes_m[t];
    walk.sizes_m[t] *= 1.1;
    const TagSurvey survey = survey_tags(walk, walk_lens(), {});
    EXPECT_EQ(survey.tags.size(), 10u);
    EXPECT_TRUE(survey.moved.empty());
    for (const SurveyedTag& tag : survey.tags) {
      const double size_m = tag.id == id ? true_size : tag.stated_size_m;
      const double sigma_m = tag.id == id ? tag.size_sigma * true_size : 0;
      EXPECT_NEAR(tag.size_m, size_m, 5 * sigma_m + 1e-4) << tag.id;
    }
  }
}

TEST(TagSurvey, AStatedDistanceGivesAllLengths) {
  TagWalk walk = walk_past(still);
  for (double& size : walk.sizes_m) size *= 1.03;  // printed smaller than was meant
  const std::vector<set::Tag> truth = still(0);
  TagSurveyOptions options;
  options.stated = {
      7, 1,
      glm::distance(true_tag(truth, 7).world_from_tag[3], true_tag(truth, 1).world_from_tag[3])};
  const TagSurvey survey = survey_tags(walk, walk_lens(), options);
  EXPECT_NEAR(survey.size_factor, 1 / 1.03, 1e-3);
  for (const SurveyedTag& tag : survey.tags) {
    EXPECT_NEAR(tag.size_m, true_tag(truth, tag.id).size_m, 1e-4);
    EXPECT_LT(glm::distance(tag.world_from_tag[3], true_tag(truth, tag.id).world_from_tag[3]),
              0.001);
  }
  options.stated->a = 99;
  EXPECT_THAT(refusal(walk, options), HasSubstr("tag 99 of --distance"));
}

TEST(TagSurvey, TheSetSaysWhereTheOriginIs) {
  TagSurveyOptions options;
  options.origin = 7;
  options.world_from_origin = true_tag(still(0), 7).world_from_tag;
  const TagSurvey survey = survey_tags(walk_past(still), walk_lens(), options);
  for (const SurveyedTag& tag : survey.tags) {
    const cv::Vec6d e = error_of(tag, true_tag(still(0), tag.id));
    EXPECT_LT(std::hypot(e[3], e[4], e[5]), 0.001) << tag.id;
  }
}

TEST(TagSurvey, SaysWhichPicturesAreMissing) {
  TagWalk walk = walk_past(still, 1, noise_px, 160);
  const auto cameras = test::walk_through_a_room(160);
  const glm::dvec3 middle(true_tag(still(0), 4).world_from_tag[3]);
  const auto direction = [&](std::size_t picture) {
    return glm::normalize(glm::dvec3(cameras[picture][3]) - middle);
  };
  // Tags 7 to 9 in pictures of their own, tag 20 in three pictures, tag 4 from one side.
  int of_20 = 0;
  std::erase_if(walk.sightings, [&](const TagSighting& seen) {
    const int id = walk.ids[seen.tag];
    const bool wall = id >= 7 && id <= 9;
    if (wall != (seen.picture % 2 == 0)) return true;
    if (id == 20) return ++of_20 > 3;
    return id == 4 && glm::dot(direction(81), direction(seen.picture)) < std::cos(6 * degree);
  });
  const TagSurvey survey = survey_tags(walk, walk_lens(), {});
  EXPECT_THAT(missing_of_tags(survey, {0, 31}, 0),
              AllOf(Contains(HasSubstr("tag 31, together with another tag")),
                    Contains(HasSubstr("tags 7, 8 and 9 together with others: step back")),
                    Contains(HasSubstr("tag 20 in more pictures: 3 are usable")),
                    Contains(HasSubstr("tag 4 from further to the side: walk around it"))));
}

TEST(TagSurvey, TheLensOfAnotherCameraIsSuspected) {
  PinholeIntrinsics other = walk_lens();
  other.fx *= 1.25, other.fy *= 0.8, other.k1 = 0.5;
  EXPECT_THAT(refusal(walk_past(still), {}, other),
              HasSubstr("is the lens calibration the one for this camera"));
}

// Pictures of one tag, as many as are asked for, whose number nobody knows before.
class Video : public PictureSource {
 public:
  explicit Video(int pictures) : left_(pictures) {
    test::TagScene scene;
    scene.lens = lens();
    scene.tags = {test::flat_tag(1, 0.08, {0, 0, 0})};
    scene.world_from_camera = test::camera_looking({0, -0.2, 0.3}, {0, 0, 0});
    std::mt19937 random(1);
    frame_ = std::make_shared<const Frame>(
        test::expose(test::render(scene), {.full_well_e = 20000, .response = {}}, random));
  }
  static PinholeIntrinsics lens() { return test::plain_lens(160, 120, 150); }
  std::optional<NamedFrame> next() override {
    if (left_-- == 0) return std::nullopt;
    return NamedFrame{frame_, std::to_string(left_)};
  }

 private:
  int left_;
  FramePtr frame_;
};

TEST(GatherWalk, TakesAllOfAShortVideoAndAtMostAHundredAndFiftyOfALongOne) {
  const auto taken = [](int pictures) {
    Video video(pictures);
    WalkOptions options;
    options.sizes.common_m = 0.08;
    return int(gather_walk(video, Video::lens(), {}, options, [](const auto&) {}).pictures.size());
  };
  EXPECT_EQ(taken(24), 24);
  EXPECT_EQ(taken(149), 149);
  const int of_many = taken(700);
  EXPECT_GE(of_many, 75);
  EXPECT_LT(of_many, 150);
}

TEST(TagSizes, AreReadAsWritten) {
  const TagSizes sizes = parse_tag_sizes("80mm,7:12cm");
  EXPECT_EQ(sizes.of(3), 0.08);
  EXPECT_EQ(sizes.of(7), 0.12);
  EXPECT_FALSE(parse_tag_sizes("7:12cm").of(3));
  EXPECT_FALSE(parse_tag_sizes("").of(3));
  for (const char* wrong : {"80", "x:80mm", "7:", "-1:80mm", "80mm,,"})
    EXPECT_THROW(parse_tag_sizes(wrong), Error) << wrong;
}

TagSurvey two_tags() {
  TagSurvey survey;
  survey.tags.resize(2);
  survey.tags[0].id = 3, survey.tags[1].id = 5;
  for (SurveyedTag& tag : survey.tags) {
    tag.size_m = 0.08, tag.pictures = 12;
    tag.world_from_tag = glm::translate(glm::dmat4(1.0), glm::dvec3(0.1234567, -0.2, 0));
  }
  survey.tags[1].position_sigma_m = 0.0001, survey.tags[1].rotation_sigma_rad = 0.001;
  return survey;
}

TEST(TagTables, AreAsTheSetFileHasThem) {
  EXPECT_EQ(tag_tables(two_tags()),
            "# defines the world; in 12 pictures\n"
            "[[tag]]\nid = 3\nsize_m = 0.08\nposition_m = [0.123457, -0.2, 0.0]\n"
            "rotation_deg = [0.0, 0.0, 0.0]\n\n"
            "# accurate to 0.10 mm, 0.057 degrees, from 12 pictures\n"
            "[[tag]]\nid = 5\nsize_m = 0.08\nposition_m = [0.123457, -0.2, 0.0]\n"
            "rotation_deg = [0.0, 0.0, 0.0]\n");
}

TEST(TagTables, AreWrittenIntoTheSetFileWhoseCommentsStay) {
  const std::string text =
      "[set]\nname = \"stage\"  # the attic\n\n"
      "[[tag]]\nid = 9  # on the stick\nsize_m = 0.03\ncarrier = \"stick\"\n\n"
      "[[tag]]\nid = 5  # on the wall\nsize_m = 0.081\n"
      "position_m = [1, 2, 3]  # by tape\n";
  EXPECT_EQ(with_tags(text, two_tags()),
            "[set]\nname = \"stage\"  # the attic\n\n"
            "[[tag]]\nid = 9  # on the stick\nsize_m = 0.03\ncarrier = \"stick\"\n\n"
            "[[tag]]\nid = 5  # on the wall\nsize_m = 0.08\n"
            "position_m = [0.123457, -0.2, 0.0]  # by tape\n"
            "rotation_deg = [0.0, 0.0, 0.0]\n\n"
            "[[tag]]\nid = 3\nsize_m = 0.08\nposition_m = [0.123457, -0.2, 0.0]\n"
            "rotation_deg = [0.0, 0.0, 0.0]\n");
  const std::string corners =
      "[[tag]]\nid = 5\ncorners_m = [[0, 0, 0], [0.08, 0, 0], [0.08, 0.08, 0], [0, 0.08, 0]]\n";
  const set::Set set = set::parse_set(with_tags(corners, two_tags()), "stage.toml");
  ASSERT_EQ(set.tracking.tags.size(), 2u);
  EXPECT_NEAR(set.tracking.tags[0].size_m, 0.08, 1e-5);
  EXPECT_NEAR(set.tracking.tags[0].world_from_tag[3].x, 0.123457, 1e-6);
}

// The whole command, on a folder of pictures: a tag is bumped by a centimetre on the way.
class TagCommand : public testing::Test {
 protected:
  static constexpr int pictures = 14, bump = 8;

  TagCommand() {
    std::filesystem::create_directory(folder / "walk");
    test::TagScene scene;
    scene.lens = test::plain_lens(640, 480, 600);
    std::mt19937 random(5);
    for (int i = 0; i < pictures; ++i) {
      scene.tags = tags_at(i);
      const double angle = (-40 + 80.0 * i / (pictures - 1)) * degree;
      scene.world_from_camera = test::camera_looking(
          {0.75 * std::sin(angle), -0.75 * std::cos(angle), 0.55 + 0.1 * (i % 3)}, {0.02, 0.02, 0});
      const Frame frame =
          test::expose(test::render(scene), {.full_well_e = 20000, .response = {}}, random);
      cv::Mat picture(frame.height, frame.width, CV_8UC3,
                      const_cast<std::uint8_t*>(frame.bytes.data()));
      const std::string number = std::to_string(10000 + i).substr(1);
      cv::imwrite((folder / "walk" / (number + ".png")).string(), picture);
    }
    std::ofstream(set_file()) << "# The attic\n"
                                 "[observer.intrinsics]\nwidth = 640\nheight = 480\nfx = 600.0\n"
                                 "fy = 600.0\ncx = 319.5\ncy = 239.5\n"
                                 "[[tag]]  # in the middle\nid = 1\nsize_m = 0.08\n"
                                 "position_m = [0.0, 0.0, 0.0]\n";
    options.footage = folder / "walk";
    options.set_file = set_file();
    options.sizes = "80mm,4:60mm";
  }

  static std::vector<set::Tag> tags_at(int picture) {
    std::vector<set::Tag> tags{test::flat_tag(1, 0.08, {0, 0, 0}),
                               test::flat_tag(2, 0.08, {0.2, 0.05, 0}, 0.3),
                               test::flat_tag(3, 0.08, {-0.19, 0.1, 0}, -0.5),
                               test::flat_tag(4, 0.06, {0.04, 0.22, 0}, 1)};
    if (picture >= bump) tags[3].world_from_tag[3].x += 0.01;
    return tags;
  }
  std::filesystem::path set_file() const { return folder / "stage.toml"; }
  std::string text_of_set() const { return test::content_of(set_file()); }
  std::string said() {
    std::ostringstream out;
    const std::string error = test::error_of([&] { calibrate_tags(options, out); });
    return error.empty() ? out.str() : error;
  }

  test::TemporaryDirectory folder;
  TagsOptions options;
};

TEST_F(TagCommand, RefusesAWalkWithABumpUnlessForcedAndWritesTheRest) {
  const std::string refused = said();
  EXPECT_THAT(refused, HasSubstr("tag 4 again, once it is fixed in place: moved by 1"));
  EXPECT_THAT(refused, HasSubstr("0007.png and "));
  options.force = options.write = true;
  const std::string done = said();
  EXPECT_THAT(done, HasSubstr("stage.toml.1.old"));
  const set::Set set = set::load_set(set_file());
  ASSERT_EQ(set.tracking.tags.size(), 3u) << done;
  const std::vector<set::Tag> truths = tags_at(0);
  for (const set::Tag& tag : set.tracking.tags) {
    const set::Tag& truth = true_tag(truths, tag.id);
    // The bound of the synthetic sets that tests/truth has, which are 640 px wide, too.
    EXPECT_LT(glm::distance(tag.world_from_tag[3], truth.world_from_tag[3]), 0.0003) << tag.id;
  }
  EXPECT_THAT(text_of_set(),
              AllOf(StartsWith("# The attic\n"), HasSubstr("[[tag]]  # in the middle\n")));
}

// Whoever opens the set file next week sees that the map was forced; a good one takes that away.
TEST_F(TagCommand, AForcedMapSaysSoInTheSetFile) {
  options.force = options.write = true;
  said();
  const std::string forced = text_of_set();
  EXPECT_THAT(forced.substr(0, forced.find("[[tag]]")),
              HasSubstr("# UNRELIABLE: accepted with --force although"));
  EXPECT_THAT(forced, HasSubstr("# tag 4 again"));
  said();
  EXPECT_EQ(text_of_set(), forced);
  EXPECT_THAT(with_tags(forced, two_tags(), ""),
              AllOf(Not(HasSubstr("UNRELIABLE")), Not(HasSubstr("# tag 4"))));
}

// Each picture links two neighbours of a row of tags: their errors add up.
TEST(TagSurvey, AChainOfPairsIsNamed) {
  TagSurvey survey;
  for (int id = 0; id < 8; ++id) {
    SurveyedTag& tag = survey.tags.emplace_back();
    tag.id = id;
    tag.pictures = 10;
    tag.views_rad = 1;
    tag.position_sigma_m = 0.004 * id;
  }
  survey.pictures = 40;
  survey.pictures_of_pairs = 37;
  EXPECT_THAT(
      missing_of_tags(survey, {}, 0),
      ElementsAre(AllOf(HasSubstr("37 of 40 pictures show two only, and a chain of pairs bends"),
                        HasSubstr("tag 7, the worst, to 28 mm"))));
  survey.pictures_of_pairs = 3;
  EXPECT_EQ(missing_of_tags(survey, {}, 0).size(), 7u);
}

// A short clip past two tags that are large in the picture: 8 degrees, and noise leaves little.
TEST(TagSurvey, FewViewsAreEnoughForATagThatIsCertain) {
  TagSurvey survey;
  survey.tags.resize(2);
  SurveyedTag& tag = survey.tags[1];
  tag.id = 1;
  tag.pictures = 24;
  tag.views_rad = 8 * degree;
  tag.world_from_tag[3].x = 0.34;
  tag.position_sigma_m = 0.39e-3;
  tag.rotation_sigma_rad = 0.029 * degree;
  EXPECT_THAT(missing_of_tags(survey, {}, 0), IsEmpty());
  tag.position_sigma_m = 1e-3;
  EXPECT_THAT(missing_of_tags(survey, {}, 0), ElementsAre(HasSubstr("its pictures span only 8")));
}

// Tag 2 lies there twice in the last pictures, which keep the others.
TEST_F(TagCommand, NamesATagThatIsThereTwice) {
  for (int i = 0; i < 2; ++i) {
    const std::string file =
        (folder / "walk" / (std::to_string(10000 + i).substr(1) + ".png")).string();
    test::TagScene scene;
    scene.lens = test::plain_lens(640, 480, 600);
    scene.tags = tags_at(i);
    scene.tags.push_back(test::flat_tag(2, 0.08, {-0.1, -0.1, 0}));
    const double angle = (-40 + 80.0 * i / (pictures - 1)) * degree;
    scene.world_from_camera = test::camera_looking(
        {0.75 * std::sin(angle), -0.75 * std::cos(angle), 0.55 + 0.1 * (i % 3)}, {0.02, 0.02, 0});
    std::mt19937 random(5);
    const Frame frame =
        test::expose(test::render(scene), {.full_well_e = 20000, .response = {}}, random);
    cv::imwrite(file, cv::Mat(frame.height, frame.width, CV_8UC3,
                              const_cast<std::uint8_t*>(frame.bytes.data())));
  }
  options.force = true;
  const std::string words = said();
  EXPECT_THAT(words, HasSubstr("tag 2 is there twice in 2 pictures: printed twice"));
  EXPECT_THAT(words, HasSubstr("tag 2: 12 pictures"));
  EXPECT_THAT(words, HasSubstr("tag 3: 14 pictures"));
}

TEST_F(TagCommand, SaysWhatThePicturesHoldInPlaceOfTags) {
  options.family = "tag25h9";
  EXPECT_THAT(said(), AllOf(HasSubstr("none of the 14 pictures examined shows a tag of tag25h9"),
                            HasSubstr("the pictures hold tags of tag36h11: tags 1, 2, 3 and 4"),
                            HasSubstr("--family tag36h11")));
}

TEST_F(TagCommand, SaysWhatItLacks) {
  options.sizes = "";
  EXPECT_THAT(said(), HasSubstr("the size of tags 2, 3 and 4 is unknown: give --size"));
  options.sizes = "80mm";
  options.set_file.reset();
  EXPECT_THAT(said(), HasSubstr("the film camera has no lens calibration"));
  options.write = true;
  EXPECT_THAT(said(), HasSubstr("--write needs --set"));
  options.write = false;
  options.set_file = set_file();
  options.distance = "1-1:2m";
  EXPECT_THAT(said(), HasSubstr("distance \"1-1:2m\" is not valid"));
}

}  // namespace previz::calibrate::tags_test
