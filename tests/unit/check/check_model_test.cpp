// What `previzd check` says of a take in which a card is real, and drawn exactly.
#include "daemon/core/check/check.hpp"
#include "daemon/core/session/session.hpp"
#include "tests/support/small_take.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"
#include "tests/support/tracking_synthetic.hpp"

namespace previz::check::check_model_test {

constexpr double focal_px = 800, half_side_m = 0.15;
constexpr int frames = 5;

constexpr double small_half_m = 0.075, small_right_px = -220;

// A card of 0.3 m, seen from a metre above; a small one may lie left of it.
Frame picture_of_card(double card_light, bool has_small) {
  test::LinearPicture light{640, 480, std::vector<double>(std::size_t{640} * 480, 0.3)};
  constexpr double half = focal_px * half_side_m;
  add_polygon(light,
              {{319.5 - half, 239.5 - half},
               {319.5 + half, 239.5 - half},
               {319.5 + half, 239.5 + half},
               {319.5 - half, 239.5 + half}},
              card_light - 0.3);
  if (has_small) {
    constexpr double x = 319.5 + small_right_px, s = focal_px * small_half_m;
    add_polygon(light,
                {{x - s, 239.5 - s}, {x + s, 239.5 - s}, {x + s, 239.5 + s}, {x - s, 239.5 + s}},
                0.3);
  }
  std::mt19937 random(1);
  return expose(light, test::Sensor{}, random);
}

class CheckModel : public testing::Test {
 protected:
  static constexpr int every_frame = -2;
  // Frame `lost` has no pose.
  void write_take(const std::string& object, double card_light = 0.7, int lost = -1) {
    const std::filesystem::path card = directory_ / "card.gltf";
    test::write_square(card, 2 * half_side_m, 0);
    session::SessionInfo info;
    info.set_text =
        "[set]\nname = 'card'\n[tracking]\nenabled = false\n[[object]]\nname = 'card'\n"
        "file = 'card.gltf'\n" +
        object;
    info.observer.emplace();
    info.observer->intrinsics = lens_;
    session::SessionWriter writer(take_, info);
    writer.add_asset("card.gltf", card);
    if (has_small_) {
      test::write_square(directory_ / "small.gltf", 2 * small_half_m, 0);
      writer.add_asset("small.gltf", directory_ / "small.gltf");
    }
    Frame light;
    light.source = "light";
    light.width = light.height = 16;
    light.bytes.resize(frame_bytes(light.format, light.width, light.height));
    writer.write(light);
    Frame frame = picture_of_card(card_light, has_small_);
    frame.source = "observer";
    for (int i = 0; i < frames; ++i) {
      frame.timestamp_ns = 1'000'000 + i * test::small_take_interval_ns;
      writer.write(frame);
      session::TrackRecord record;
      record.frame = static_cast<std::uint64_t>(i);
      record.timestamp_ns = frame.timestamp_ns;
      record.tracked = i != lost && lost != every_frame;
      record.world_from_camera = {{1, 0, 0, 0}, {0, -1, 0, 0}, {0, 0, -1, 0}, {0, 0, 1, 1}};
      writer.write(record);
    }
    writer.close();
  }

  std::string checked(const std::optional<std::filesystem::path>& set_file = {}) {
    std::ostringstream out;
    EXPECT_EQ(check_set({take_, set_file}, out), 0) << out.str();
    return out.str();
  }

  // A phantom that is so many pixels right of the card, and as many below it.
  static std::string phantom(double off_px) {
    return "presence = 'phantom'\nposition_m = [" + std::to_string(off_px / focal_px) + ", " +
           std::to_string(-off_px / focal_px) + ", 0.0]\n";
  }

  // The small card's phantom, which is so many pixels right of it and as many below it.
  static std::string small_phantom(double off_px) {
    return "[[object]]\nname = 'small card'\nfile = 'small.gltf'\npresence = 'phantom'\n"
           "position_m = [" +
           std::to_string((small_right_px + off_px) / focal_px) + ", " +
           std::to_string(-off_px / focal_px) + ", 0.0]\n";
  }

  bool has_small_ = false;  // in pictures, and as a file
  PinholeIntrinsics lens_ = test::plain_lens(640, 480, focal_px);
  test::TemporaryDirectory directory_;
  const std::filesystem::path take_ = directory_ / "take";
};

// The sides of the card are 240 px long: six pieces each.
TEST_F(CheckModel, SaysHowFarItIsFromThePictures) {
  write_take(phantom(0));
  const std::string said = checked();
  EXPECT_THAT(said, testing::StartsWith("card (the set recorded with the take) is valid\n"));
  EXPECT_THAT(said, HasSubstr("\nmodel: 120 of 120 pieces of edges in 5 frames are 0.0"));
  EXPECT_THAT(said, HasSubstr(" px off in the median, and 90 % of them by at most 0.0"));
  EXPECT_THAT(said, Not(HasSubstr("beside the pictures' edges")));
}

TEST_F(CheckModel, SaysWhatToDoIfItIsOff) {
  write_take(phantom(3));
  const std::string said = checked();
  EXPECT_THAT(said, HasSubstr("are 3.00 px off in the median, and 90 % of them by at most 3.0"));
  EXPECT_THAT(said, HasSubstr("worth checking"));
  // 3 px to the right and 3 px down are 4.2.
  EXPECT_THAT(said, HasSubstr("the model of what is real is 4.2 px beside the pictures' edges"));
  EXPECT_THAT(said, HasSubstr("action `guides`"));
  EXPECT_THAT(said, HasSubstr("`previz calibrate tags`"));
}

// As after `previz model --write`, which changes the set file and not the take.
TEST_F(CheckModel, ASetFileTakesThePlaceOfTheTakesOwn) {
  write_take(phantom(3));
  const auto file = directory_ / "now.toml";
  std::ofstream(file)
      << "[set]\nname = 'now'\n[tracking]\nenabled = false\n[[object]]\nname = 'card'\n"
         "file = 'card.gltf'\n" +
             phantom(0);
  const std::string said = checked(file);
  EXPECT_THAT(said, testing::StartsWith("now (" + file.string() + ") is valid\n"));
  EXPECT_THAT(said, HasSubstr("pieces of edges in 5 frames are 0.0"));
  std::ostringstream out;
  EXPECT_THAT(test::error_of([&] { check_set({file, file}, out); }), HasSubstr("is not a session"));
}

TEST_F(CheckModel, SaysThatTheLensIsOfPicturesOfAnotherSize) {
  lens_ = test::plain_lens(1280, 960, 2 * focal_px);
  write_take(phantom(0));
  EXPECT_THAT(checked(), HasSubstr("no figure for how far it is off: the pictures have 640x480 "
                                   "pixels, and the lens is calibrated for 1280x960"));
}

// The small card's sides are 120 px long: three pieces each, in five frames.
TEST_F(CheckModel, NamesTheThingThatIsOffWhileTheRestFits) {
  has_small_ = true;
  write_take(phantom(0) + small_phantom(3));
  const std::string said = checked();
  EXPECT_THAT(said, HasSubstr("model: 180 of 180 pieces of edges in 5 frames are 0.0"));
  EXPECT_THAT(said, HasSubstr("\"small card\" is 4.2 px beside the pictures' edges, by 60 pieces "
                              "of edges of it, while the rest of the model fits: it was moved, or "
                              "its place in the model is wrong"));
  EXPECT_THAT(said, Not(HasSubstr("the model of what is real is")));
  EXPECT_THAT(said, Not(HasSubstr("\"card\" is")));
  EXPECT_THAT(said, Not(HasSubstr("not judged")));
}

TEST_F(CheckModel, NamesTheThingsThatThePicturesDoNotShow) {
  has_small_ = true;
  write_take(phantom(0) + small_phantom(-500));
  EXPECT_THAT(checked(), HasSubstr("\n  not judged, because too few of their edges can be seen: "
                                   "\"small card\"\n"));
}

TEST_F(CheckModel, NamesNoThingIfAllFitOrAllAreOff) {
  has_small_ = true;
  write_take(phantom(0) + small_phantom(0));
  EXPECT_THAT(checked(), Not(HasSubstr("beside the pictures' edges")));
  std::filesystem::remove_all(take_);
  write_take(phantom(3) + small_phantom(3));
  const std::string said = checked();
  EXPECT_THAT(said, HasSubstr("the model of what is real is 4.2 px beside the pictures' edges"));
  EXPECT_THAT(said, Not(HasSubstr("card\" is")));
}

TEST_F(CheckModel, SaysWhatToDoIfThePicturesDoNotShowIt) {
  write_take(phantom(0), 0.3);
  const std::string said = checked();
  EXPECT_THAT(said, HasSubstr("model: no figure for how far it is off: the pictures have edges of "
                              "light at too few of the model's (0 pieces"));
  EXPECT_THAT(said, HasSubstr("the pictures have edges at 0 of 120 pieces of edges of the model"));
}

TEST_F(CheckModel, LeavesOutFramesThatAreLostOrCannotBeRead) {
  write_take(phantom(0), 0.7, 1);
  test::make_unreadable(take_, 3);
  EXPECT_THAT(checked(), HasSubstr("model: 72 of 72 pieces of edges in 3 frames"));
}

TEST_F(CheckModel, SaysThatNoPictureHasAPose) {
  write_take(phantom(0), 0.7, every_frame);
  EXPECT_THAT(checked(),
              HasSubstr("no figure for how far it is off: none of the pictures looked at "
                        "has a pose"));
}

// A take without a track is valid, and its model cannot be judged.
TEST_F(CheckModel, OfATakeWithoutATrackHasNoFigure) {
  write_take(phantom(0));
  std::filesystem::remove(take_ / "track.jsonl");
  EXPECT_THAT(checked(), HasSubstr("no figure for how far it is off: "));
  EXPECT_THAT(checked(), HasSubstr("the session recorded no poses"));
}

TEST_F(CheckModel, SaysNothingWhereNothingIsReal) {
  write_take("presence = 'virtual'\n");
  EXPECT_THAT(checked(), Not(HasSubstr("model:")));
}

}  // namespace previz::check::check_model_test
