// A picture that stays in the card's memory is shown from there, and is the one that comes down.
#include "daemon/core/render/device/card_pictures.hpp"
#include "drivers/headless/headless_display.hpp"
#include "tests/support/pixels_by_hand.hpp"

namespace previz::test::card_picture_test {

// A sky and a ball before a plate of chance, on a CPU device that is treated as a card. OpenGL ES
// on a computer without a card is the same driver's.
class CardPictures : public ::testing::Test {
 protected:
  void make(int width, int height, bool as_gpu = true) {
    device_ = render::open_device(
        {.validation = true, .name = "", .as_gpu = as_gpu, .synchronization = true});
    view_ = empty_view({0, -0.8, 1}, {0, 0, 0.05}, pinhole(width, height, 0.8), glm::vec3(0.3f));
    add(view_.scene, icosphere_mesh(0.2, 1), diffuse(glm::vec3(0.7f)), at({0, 0, 0.25}),
        scene::world_mixed);
    renderer_.emplace(view_, set::Estimation{.max_depth = 1}, set::LightSampling::importance,
                      device_);
    display_ = open_headless({"", DisplayMode{width, height, 0}, DisplayScale::one_to_one});
  }

  render::Showing::Shown picture(const render::ShowTo& to, int bits = 8) {
    const PinholeIntrinsics& lens = view_.calibration.intrinsics;
    renderer_->begin(
        {.plate = std::make_shared<const Plate>(random_plate(lens.width, lens.height, bits)),
         .exposure = 0.5,
         .world_from_camera = look_at({0.02 * ++frames_, -0.8, 1}, {0, 0, 0.05})});
    renderer_->render(1);
    return renderer_->show_later(false, to).finish();
  }
  std::uint64_t bytes_down() const { return render::work_of(*device_).bytes_down; }

  static std::vector<std::uint16_t> in_8_bits(const Plate& plate) {
    std::vector<std::uint16_t> result = plate.samples;
    if (plate.bits == 16)
      for (std::uint16_t& code : result)
        code = static_cast<std::uint16_t>((code * 255u + 32767u) / 65535u);
    return result;
  }
  void expect_shown(const CardPicturePtr& on_card, const Plate& plate) {
    ASSERT_TRUE(on_card);
    EXPECT_TRUE(std::holds_alternative<Shown>(display_->show({nullptr, {}, on_card})));
    EXPECT_TRUE(display_->read_back().samples == in_8_bits(plate));
  }
  void TearDown() override {
    if (!device_) return;
    EXPECT_EQ(render::validation_messages(*device_), 0u);
  }

  std::shared_ptr<render::Device> device_;
  View view_;
  std::optional<SetRenderer> renderer_;
  std::unique_ptr<Display> display_;
  int frames_ = 0;
};

constexpr render::ShowTo both{.computer = true, .card = true};
constexpr render::ShowTo card_alone{.computer = false, .card = true};

TEST_F(CardPictures, AreThoseThatComeDown) {
  make(61, 47);
  ASSERT_TRUE(renderer_->card());
  EXPECT_EQ(renderer_->card(), display_->card());
  for (const int bits : {8, 16}) {
    const render::Showing::Shown shown = picture(both, bits);
    expect_shown(shown.on_card, *shown.picture);
  }
}

TEST_F(CardPictures, OfSeveralBandsAreWhole) {
  make(2048, 1100);  // a band has 2^21 pixels at most
  const render::Showing::Shown shown = picture(both);
  expect_shown(shown.on_card, *shown.picture);
}

TEST_F(CardPictures, DoNotComeDownIfNobodyWantsThem) {
  make(320, 240);
  picture(card_alone);
  const std::uint64_t before = bytes_down();
  const render::Showing::Shown shown = picture(card_alone);
  EXPECT_FALSE(shown.picture);
  EXPECT_LT(bytes_down() - before, 1000u);  // what the frame counted
  EXPECT_GT(shown.counters.rays, 0u);
  picture({.computer = true, .card = false});
  EXPECT_GE(bytes_down() - before, 6u * 320 * 240);
}

TEST_F(CardPictures, StayAsTheyAreWhileTheyAreHeld) {
  make(64, 48);
  std::vector<render::Showing::Shown> held;
  for (std::size_t i = 0; i < render::CardPictures::most; ++i) held.push_back(picture(both));
  const render::Showing::Shown more = picture(card_alone);
  EXPECT_FALSE(more.on_card);
  ASSERT_TRUE(more.picture) << "it must come down instead";
  for (const render::Showing::Shown& each : held) expect_shown(each.on_card, *each.picture);
  held.erase(held.begin());
  const render::Showing::Shown next = picture(both);
  expect_shown(next.on_card, *next.picture);
}

TEST_F(CardPictures, OutliveTheirRendererAndDevice) {
  make(64, 48);
  const render::Showing::Shown shown = picture(both);
  renderer_.reset();
  device_.reset();
  expect_shown(shown.on_card, *shown.picture);
}

TEST_F(CardPictures, FollowTheSizeOfTheFrames) {
  make(64, 48);
  picture(card_alone);
  renderer_->resize(pinhole(32, 24, 0.8));
  view_.calibration = pinhole(32, 24, 0.8);
  display_.reset();  // its context is current in this thread
  display_ = open_headless({"", DisplayMode{32, 24, 0}, DisplayScale::one_to_one});
  const render::Showing::Shown shown = picture(both);
  expect_shown(shown.on_card, *shown.picture);
}

TEST_F(CardPictures, AreSharedByCardsAlone) {
  make(64, 48, /*as_gpu=*/false);
  if (!shared_device()->shares_host_memory()) GTEST_SKIP() << "the tests' device is a card";
  EXPECT_FALSE(renderer_->card());
  const render::Showing::Shown shown = picture(card_alone);
  EXPECT_FALSE(shown.on_card);
  EXPECT_TRUE(shown.picture);
}

// A display refuses what it cannot show, and goes on with plates.
TEST_F(CardPictures, OfAnotherCardAreRefusedInWords) {
  make(64, 48);
  const render::Showing::Shown shown = picture(both);
  auto memory = std::make_shared<CardMemory>();
  memory->card = shown.on_card->memory->card;
  memory->card.device[0] ^= 1;
  memory->id = 1'000'000;
  memory->width = 64;
  memory->height = 48;
  const auto foreign = std::make_shared<const CardPicture>(CardPicture{memory, 1'000'000});
  const DisplayEvent event = display_->show({nullptr, {}, foreign});
  ASSERT_TRUE(std::holds_alternative<DeviceTrouble>(event));
  EXPECT_THAT(std::get<DeviceTrouble>(event).what, HasSubstr("come down to the computer"));
  EXPECT_FALSE(std::get<DeviceTrouble>(event).lost);
  EXPECT_EQ(display_->card(), shown.on_card->memory->card) << "its own card's are still welcome";
  for (const CardPicturePtr& also : {CardPicturePtr(), CardPicturePtr(foreign)}) {
    display_->show(
        {shown.picture, {{.x = 0, .y = 0, .width = 1, .height = 1, .rgba = {9, 8, 7, 255}}}, also});
    Plate expected = *shown.picture;
    std::ranges::copy(std::array<std::uint16_t, 3>{9, 8, 7}, expected.samples.begin());
    EXPECT_TRUE(display_->read_back().samples == expected.samples);
  }
}

TEST_F(CardPictures, OfMemoryThatCannotBeImportedAreRefusedInWords) {
  make(64, 48);
  const render::Showing::Shown shown = picture(both);
  auto memory = std::make_shared<CardMemory>();
  memory->card = shown.on_card->memory->card;
  memory->id = 1'000'001;
  memory->bytes = 1 << 20;
  memory->width = 64;
  memory->height = 48;  // and no descriptor
  const auto broken = std::make_shared<const CardPicture>(CardPicture{memory, 1'000'001});
  ASSERT_TRUE(std::holds_alternative<DeviceTrouble>(display_->show({nullptr, {}, broken})));
  EXPECT_FALSE(display_->card());
}

}  // namespace previz::test::card_picture_test
