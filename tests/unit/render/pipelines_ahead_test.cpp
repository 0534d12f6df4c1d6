// What buttons can reach is compiled before they are pressed, once, and by a thread that stops when
// it is told to.
#include "daemon/core/render/passes/pipelines_ahead.hpp"

#include "daemon/core/render/device/device.hpp"
#include "daemon/core/render/world/feature.hpp"
#include "tests/support/pixels_by_hand.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::test::pipelines_ahead_test {

constexpr int width = 24, height = 18;

// A virtual glass ball on a floor, so that there are photons where light shines.
View glass_on_floor() {
  View view = empty_view({0, -0.8, 1}, {0, 0, 0.05}, pinhole(width, height, 0.8), glm::vec3(0.1f));
  add(view.scene, rectangle_mesh({2, 2}), diffuse(glm::vec3(0.5f)));
  add(view.scene, icosphere_mesh(0.2, 1), glass(1.5f), at({0, 0, 0.25}), scene::world_mixed);
  return view;
}

void compile_all(const std::shared_ptr<render::Device>& device, const set::Set& set,
                 const View& view) {
  const render::PipelinesAhead ahead(
      device, [&] { return render::reachable_bits(set, view.scene, false); });
  ASSERT_TRUE(wait_until("all pipelines are made", [&] { return ahead.is_done(); }));
}

// Presses what changes the pipelines: averaging, the estimator, and the light's mode, in which a
// lamp comes and goes.
class Crew {
 public:
  Crew(const View& view, const set::Estimation& estimation,
       const std::shared_ptr<render::Device>& device)
      : renderer_(view, estimation, set::LightSampling::importance, device) {}

  void press_everything() {
    for (const bool finds_lamps : {false, true}) {
      if (finds_lamps) renderer_.set_sources({sphere_lamp({0.3, 0, 1}, 0.1, glm::dvec3(2))});
      for (const set::Estimator estimator : both_estimators) {
        renderer_.use(estimator);
        for (const bool accumulates : {false, true, true}) frame(accumulates);
      }
    }
    renderer_.set_sources({});
    frame(true);
  }

 private:
  void frame(bool accumulates) {
    renderer_.begin({.plate = plate_,
                     .exposure = 0.5,
                     .world_from_camera = renderer_.world_from_camera,
                     .accumulates = accumulates});
    renderer_.render(1);
    renderer_.show(accumulates);
  }

  SetRenderer renderer_;
  PlatePtr plate_ = std::make_shared<const Plate>(random_plate(width, height, 8));
};

class PipelinesAheadOf : public ::testing::TestWithParam<set::RealRadiance> {};
INSTANTIATE_TEST_SUITE_P(RealRadiance, PipelinesAheadOf,
                         ::testing::Values(set::RealRadiance::traced, set::RealRadiance::camera));

TEST_P(PipelinesAheadOf, ASetAreThoseThatItsButtonsReach) {
  const auto device = render::open_device({.validation = true, .name = ""});
  const View view = glass_on_floor();
  set::Set set;
  set.estimation.real_radiance = GetParam();
  set.estimation.max_depth = 2;
  compile_all(device, set, view);
  const std::uint64_t made = device->made().programs;
  EXPECT_EQ(render::work_of(*device).pipelines_ahead, made);
  Crew(view, set.estimation, device).press_everything();
  EXPECT_EQ(render::work_of(*device).pipelines_awaited, 0u);
  EXPECT_EQ(device->made().programs, made);
  EXPECT_EQ(render::validation_messages(*device), 0u);
}

TEST(PipelinesAhead, AreOnlyThoseThatTheSetCanHave) {
  const View view = glass_on_floor();
  set::Set set;
  const auto reachable = [&] { return render::reachable_bits(set, view.scene, false); };
  const std::vector<std::uint32_t> all = reachable();
  ASSERT_EQ(all.size(), 4u) << "two estimators, and lamps or none in the light";
  EXPECT_EQ(all[1], all[0] | gpu::FEATURE_DIFFERENCE);
  EXPECT_EQ(all[2], all[0] | gpu::FEATURE_LIGHTS | gpu::FEATURE_VISIBLE_LIGHTS);
  EXPECT_EQ(all[3], all[1] | all[2]);

  set.lighting.mode = set::LightMode::sources;
  EXPECT_THAT(reachable(), ElementsAre(all[2], all[3]));
  set.estimation.estimator = set::Estimator::difference;
  EXPECT_THAT(reachable(), ElementsAre(all[3], all[2]));
  set.estimation.composite = set::Composite::ratio;
  EXPECT_THAT(reachable(), ElementsAre(all[2]));
  set.lighting.mode = set::LightMode::image;
  set.lighting.from = set::LightFrom::set;  // without an environment
  EXPECT_EQ(reachable().size(), 1u);
}

// A word whose address stands for a shader.
constexpr std::uint32_t shader = 0, other_shader = 0;

TEST(PipelinesAhead, ThatAPictureNeedsMeanwhileAreMadeOnceAndHoldUpNoOther) {
  const auto device = render::open_device({});
  const auto make = [] { return std::make_shared<const render::Program>(); };
  std::promise<void> begun, is_to_end;
  const std::jthread ahead([&] {
    device->programs().ahead(&shader, {}, [&] {
      begun.set_value();
      is_to_end.get_future().wait();
      return make();
    });
  });
  begun.get_future().wait();
  device->programs().ahead(&shader, {}, make);  // which returns at once
  EXPECT_TRUE(device->programs().get(&other_shader, {}, make));
  std::future<render::Programs::Ptr> waits =
      std::async(std::launch::async, [&] { return device->programs().get(&shader, {}, make); });
  EXPECT_TRUE(
      wait_until("both are awaited", [&] { return device->work().pipelines_awaited == 2; }));
  is_to_end.set_value();
  const render::Programs::Ptr waited_for = waits.get();
  EXPECT_EQ(waited_for, device->programs().get(&shader, {}, make));
  EXPECT_EQ(device->made().programs, 2u);
  EXPECT_EQ(device->work().pipelines_awaited, 2u);
}

TEST(PipelinesAhead, ThatCouldNotBeMadeAreMadeByThePictureThatWaits) {
  const auto device = render::open_device({});
  std::promise<void> begun, is_to_fail;
  const std::jthread ahead([&] {
    const auto fail = [&]() -> render::Programs::Ptr {
      begun.set_value();
      is_to_fail.get_future().wait();
      throw Error("no memory");
    };
    EXPECT_EQ(error_of([&] { device->programs().ahead(&shader, {}, fail); }), "no memory");
  });
  begun.get_future().wait();
  std::future<render::Programs::Ptr> waits = std::async(std::launch::async, [&] {
    return device->programs().get(&shader, {},
                                  [] { return std::make_shared<const render::Program>(); });
  });
  EXPECT_TRUE(wait_until("it is awaited", [&] { return device->work().pipelines_awaited == 1; }));
  is_to_fail.set_value();
  EXPECT_TRUE(waits.get());
  EXPECT_EQ(device->made().programs, 1u);
}

TEST(PipelinesAhead, StopBetweenTwoOfThem) {
  const auto device = render::open_device({});
  // Hours of them.
  const auto many = [] {
    std::vector<std::uint32_t> features(1u << 20);
    std::iota(features.begin(), features.end(), 0u);
    return features;
  };
  {
    const render::PipelinesAhead ahead(device, many);
    EXPECT_TRUE(wait_until("one is made", [&] { return device->made().programs > 0; }));
    EXPECT_FALSE(ahead.is_done());
  }
  EXPECT_LT(device->made().programs, 1000u);
}

TEST(PipelinesAhead, ThatCannotBeMadeAreSaidOnceAndHarmNothing) {
  const auto device = render::open_device({});
  testing::internal::CaptureStdout();
  {
    const render::PipelinesAhead ahead(
        device, []() -> std::vector<std::uint32_t> { throw std::runtime_error("no memory"); });
    EXPECT_TRUE(wait_until("it has ended", [&] { return ahead.is_done(); }));
  }
  EXPECT_THAT(testing::internal::GetCapturedStdout(),
              HasSubstr("a shader could not be compiled ahead, so that a button may hold up the "
                        "picture: no memory"));
}

}  // namespace previz::test::pipelines_ahead_test
