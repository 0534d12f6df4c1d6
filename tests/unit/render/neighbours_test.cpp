// A frame among its neighbours in time: noise falls as their samples add up, nothing that is only
// in a neighbour is seen, and the picture depends on these frames alone.
#include "daemon/core/render/picture/neighbours.hpp"

#include "tests/support/averaged_frames.hpp"
#include "tests/support/pixels_by_hand.hpp"

namespace previz::test::neighbours_test {

TEST(Neighbours, AreVisitedOnceInHopsOfAtMostTwoFrames) {
  for (int before = 0; before <= 7; ++before)
    for (int after = 0; after <= 7; ++after) {
      const std::vector<int> order = render::order_of_neighbours(before, after);
      std::set<int> expected;
      for (int i = -before; i <= after; ++i) expected.insert(i);
      EXPECT_EQ(order.size(), expected.size());
      EXPECT_EQ(std::set<int>(order.begin(), order.end()), expected);
      EXPECT_EQ(order.back(), 0);
      for (std::size_t i = 1; i < order.size(); ++i)
        EXPECT_LE(std::abs(order[i] - order[i - 1]), 2) << before << ", " << after;
    }
}

constexpr int width = averaged_width, height = averaged_height;

using Stage = BoxAboveFloor;

// A frame of a take: where the camera and the box are.
struct Moment {
  glm::dmat4 world_from_camera{1.0};
  glm::dvec3 box{0, 0, 0.3};
  int samples = 1;
};

void begin(SetRenderer& renderer, const Stage& stage, const Moment& moment, std::uint32_t seed) {
  std::vector<scene::Instance> instances = stage.view.scene.instances;
  instances[stage.box].world_from_object = at(moment.box);
  renderer.move(instances, stage.view.scene.lights);
  renderer.begin({gray_plate(), 0.5, moment.world_from_camera, seed});
}

render::KeptFramePtr kept(SetRenderer& renderer, const Stage& stage, const Moment& moment,
                          std::uint32_t seed) {
  begin(renderer, stage, moment, seed);
  renderer.render(moment.samples);
  expect_clean(renderer.counters());
  return renderer.keep();
}

using Take = std::map<int, Moment>;  // by frame; the picture is that of frame 0

// Returns the take's frames in the order of the chain, each with a seed of its own.
std::vector<render::KeptFramePtr> chain(SetRenderer& renderer, const Stage& stage, const Take& take,
                                        std::uint32_t first_seed = 100) {
  std::map<int, render::KeptFramePtr> frames;
  for (const auto& [frame, moment] : take)
    frames[frame] =
        kept(renderer, stage, moment, first_seed + static_cast<std::uint32_t>(frame + 10));
  std::vector<render::KeptFramePtr> order;
  for (const int frame : render::order_of_neighbours(-take.begin()->first, take.rbegin()->first))
    order.push_back(frames.at(frame));
  return order;
}

Take moving_camera() {
  Take take;
  for (int i = -2; i <= 2; ++i) take[i] = {look_at({0.02 * i, -2, 1.4 + 0.008 * i}, {0, 0, 0})};
  return take;
}

Take moving_box() {
  Take take;
  for (int i = -2; i <= 2; ++i)
    take[i] = {look_at({0, -2, 1.4}, {0, 0, 0}), {0.004 * i, 0.002 * i, 0.3}};
  return take;
}

Truth truth_of(const Stage& stage, const Moment& moment, int samples = 512,
               const set::Estimation& estimation = {}) {
  SetRenderer renderer(stage.view, estimation);
  begin(renderer, stage, moment, 1);
  renderer.render(samples);
  return {renderer.show(false), renderer.layers().mask};
}

// The rms over the picture of what a and b are off each other, in codes.
double rms_between(const Plate& a, const Plate& b) {
  double off = 0;
  for (std::size_t i = 0; i < a.samples.size(); ++i)
    off += std::pow(a.samples[i] - double(b.samples[i]), 2);
  return std::sqrt(off / static_cast<double>(a.samples.size()));
}

class FrameAmongNeighbours : public ::testing::TestWithParam<int> {
 protected:
  Stage stage;
  Take take = GetParam() == 0 ? moving_camera() : moving_box();
};
INSTANTIATE_TEST_SUITE_P(ACameraOrABoxMoves, FrameAmongNeighbours, ::testing::Values(0, 1));

// Five frames of independent samples have sqrt(5) = 2.24 times less noise where all of them show a
// pixel. Some do not, at the picture's border and beside the box, and what the box has hidden or
// shadowed is averaged less.
TEST_P(FrameAmongNeighbours, HasLessNoiseThanAlone) {
  const Plate truth = truth_of(stage, take[0]).picture;
  SetRenderer renderer(stage.view);
  double alone = 0, among = 0;
  for (std::uint32_t run = 0; run < 4; ++run) {
    const auto frames = chain(renderer, stage, take, 100 * run);
    alone += std::pow(rms_between(renderer.show_among({frames.back()}, false), truth), 2);
    among += std::pow(rms_between(renderer.show_among(frames, false), truth), 2);
  }
  EXPECT_GT(std::sqrt(alone / among), 1.6);
}

// A denoised picture also has less error among its neighbours than alone, at outlines and
// elsewhere: of what 1 / sqrt(5) = 0.45 takes away at least a half.
TEST_P(FrameAmongNeighbours, IsBetterDenoisedThanAlone) {
  for (auto& [frame, moment] : take) moment.samples = 4;
  const Truth truth = truth_of(stage, take[0]);
  SetRenderer renderer(stage.view);
  const auto frames = chain(renderer, stage, take);
  const Plate alone = renderer.show_among({frames.back()}, true);
  const Plate among = renderer.show_among(frames, true);
  const auto is_elsewhere = [](float mask) { return !is_outline(mask); };
  EXPECT_LT(off_where(is_outline, among, truth), 0.72 * off_where(is_outline, alone, truth));
  EXPECT_LT(off_where(is_elsewhere, among, truth), 0.72 * off_where(is_elsewhere, alone, truth));
}

// Returns whether the 5x5 pixels around show the same world at all of their samples.
bool is_far_from_outlines(std::span<const float> mask, int x, int y) {
  for (int v = y - 2; v <= y + 2; ++v)
    for (int u = x - 2; u <= x + 2; ++u)
      if (const float there = mask[static_cast<std::size_t>(v * width + u)];
          (there > 0 && there < 1) || there != mask[static_cast<std::size_t>(y * width + x)])
        return false;
  return true;
}

// The mean of many pictures of independent samples is the truth, within four standard errors as the
// pictures themselves scatter, over the box and over the floor. Outlines are left out, and so are 8
// pixels at the border, into which neighbours are interpolated from one side only.
TEST_P(FrameAmongNeighbours, IsNotBiased) {
  const Truth truth = truth_of(stage, take[0]);
  SetRenderer renderer(stage.view);
  constexpr int runs = 16, border = 8;
  double sums[2] = {}, squares[2] = {};  // over the floor and the box
  for (std::uint32_t run = 0; run < runs; ++run) {
    const Plate picture = renderer.show_among(chain(renderer, stage, take, 100 * run), false);
    double off[2] = {}, counted[2] = {};
    for (int y = border; y + border < height; ++y)
      for (int x = border; x + border < width; ++x) {
        if (!is_far_from_outlines(truth.mask, x, y)) continue;
        const auto i = static_cast<std::size_t>(y * width + x);
        const int part = truth.mask[i] > 0 ? 1 : 0;
        off[part] += picture.samples[3 * i + 1] - double(truth.picture.samples[3 * i + 1]);
        ++counted[part];
      }
    for (const int part : {0, 1}) {
      ASSERT_GT(counted[part], 0);
      off[part] /= counted[part];
      sums[part] += off[part];
      squares[part] += off[part] * off[part];
    }
  }
  for (const int part : {0, 1}) {
    const double mean = sums[part] / runs;
    const double error = std::sqrt((squares[part] / runs - mean * mean) / (runs - 1));
    EXPECT_LT(std::abs(mean), 4 * error) << part;
  }
}

// The picture is the same to the last bit from an object that got the frames in another order after
// other work, and from one that has rendered none of them. With glass there is light of photons.
TEST_P(FrameAmongNeighbours, IsTheSameWhoeverRenderedThem) {
  for (const bool of_glass : {false, true}) {
    if (of_glass) stage.make_glass(60);
    SetRenderer first(stage.view), second(stage.view), idle(stage.view);
    const auto frames = chain(first, stage, take);
    for (int i = 0; i < 3; ++i) {
      second.begin(
          {.plate = nullptr, .world_from_camera = take[1].world_from_camera, .accumulates = true});
      second.render(2);
      second.show(true);
    }
    std::map<int, render::KeptFramePtr> others;
    for (const int frame : {2, 0, -2, 1, -1})
      others[frame] = kept(second, stage, take[frame], 110 + static_cast<std::uint32_t>(frame));
    std::vector<render::KeptFramePtr> order;
    for (const int frame : render::order_of_neighbours(2, 2)) order.push_back(others.at(frame));
    for (const bool denoise : {false, true}) {
      const Plate expected = first.show_among(frames, denoise);
      EXPECT_EQ(first.show_among(frames, denoise).samples, expected.samples);
      EXPECT_EQ(second.show_among(order, denoise).samples, expected.samples);
      EXPECT_EQ(idle.show_among(frames, denoise).samples, expected.samples);
    }
  }
}

// The floor and the light of photons on it, denoised, must be better for the neighbours, too.
TEST(NeighboursOfGlass, TakeNoiseFromPhotonsLight) {
  Stage stage;
  stage.make_glass(60);
  Take take = moving_camera();
  const Truth truth = truth_of(stage, take[0], 256);
  SetRenderer renderer(stage.view);
  const auto frames = chain(renderer, stage, take);
  const Plate alone = renderer.show_among({frames.back()}, true);
  const Plate among = renderer.show_among(frames, true);
  EXPECT_LT(off_where(is_uncovered, among, truth), 0.8 * off_where(is_uncovered, alone, truth));
}

// A frame alone is what show() makes of it, and layers are what show() makes of them. Nothing of it
// is left in the frames that follow, accumulated or not.
TEST(NeighboursOfNone, ShowTheFrameAsItIs) {
  const Stage stage;
  Take take = moving_camera();
  SetRenderer renderer(stage.view), fresh(stage.view);
  for (const bool denoise : {false, true}) {
    const render::KeptFramePtr frame = kept(renderer, stage, take[0], 7);
    render::Layers expected_layers = renderer.layers(), layers = expected_layers;
    const Plate expected = renderer.show(denoise, &expected_layers);
    const auto frames = chain(renderer, stage, take);
    renderer.show_among(frames, denoise);
    EXPECT_EQ(renderer.show_among({frame}, denoise, &layers).samples, expected.samples);
    EXPECT_EQ(layers.composite, expected_layers.composite);
    EXPECT_EQ(layers.denoised, denoise);
  }
  const auto last = [&](SetRenderer& which) {
    Plate picture;
    for (int i = 0; i < 3; ++i) {
      which.begin(
          {.plate = nullptr, .world_from_camera = take[i].world_from_camera, .accumulates = true});
      which.render(1);
      picture = which.show(true);
    }
    return picture.samples;
  };
  EXPECT_EQ(last(renderer), last(fresh));
}

// The layers have the composite of the picture, the share that the box covers included. Codes are
// linear, and differ by the rounding of a code and of single precision: by one at most.
TEST(NeighboursInLayers, AreInTheCompositeAsInThePicture) {
  const Stage stage;
  Take take = moving_camera();
  SetRenderer renderer(stage.view);
  const auto frames = chain(renderer, stage, take);
  renderer.show_among({frames.back()}, false);
  render::Layers layers = renderer.layers();
  const Plate picture = renderer.show_among(frames, true, &layers);
  EXPECT_TRUE(layers.denoised);
  for (std::size_t i = 0; i < picture.samples.size(); ++i) {
    const double code = layers.composite[i / 3][static_cast<int>(i % 3)] * 65535 / layers.white;
    ASSERT_NEAR(picture.samples[i], code, 1) << i;
  }
}

// Of frames that show the same the picture is the mean with the weights of their numbers of
// samples. Those of 1 and of 6 samples, and the mean, are rounded to codes: it may be one off. Only
// at outlines the samples of the two sides are apart: so for nearly all pixels.
TEST(NeighboursOfOtherNumbers, CountAsTheirSamples) {
  const Stage stage;
  const glm::dmat4 pose = stage.view.world_from_camera;
  SetRenderer renderer(stage.view);
  for (const int of_last : {1, 6}) {
    const int of_first = 7 - of_last;
    const auto frames = chain(renderer, stage,
                              {{-1, {.world_from_camera = pose, .samples = of_first}},
                               {0, {.world_from_camera = pose, .samples = of_last}}});
    const Plate first = renderer.show_among({frames[0]}, false);
    const Plate last = renderer.show_among({frames[1]}, false);
    const Plate picture = renderer.show_among(frames, false);
    int others = 0;
    for (std::size_t i = 0; i < picture.samples.size(); ++i) {
      const double mean = (of_first * first.samples[i] + of_last * last.samples[i]) / 7.0;
      others += std::abs(picture.samples[i] - mean) > 1 ? 1 : 0;
    }
    EXPECT_LT(others, 0.02 * 3 * width * height) << of_last;
  }
}

// Where numbers of samples differ within a frame, the weights are those of the largest: the frames
// have the same one here, though in half of the blocks the first has half of the samples.
TEST(NeighboursOfOtherNumbers, CountAsTheLargestOfTheirFrame) {
  const Stage stage;
  const Moment moment{.world_from_camera = stage.view.world_from_camera, .samples = 4};
  SetRenderer renderer(stage.view);
  begin(renderer, stage, moment, 1);
  constexpr std::size_t blocks = (width / gpu::SAMPLED_BLOCK) * (height / gpu::SAMPLED_BLOCK);
  static_assert(width % gpu::SAMPLED_BLOCK == 0 && height % gpu::SAMPLED_BLOCK == 0);
  std::vector<std::uint32_t> limits(blocks, 4);
  for (std::size_t i = 0; i < blocks; i += 2) limits[i] = 2;
  renderer.limit_samples(limits);
  renderer.render(4);
  const render::KeptFramePtr limited = renderer.keep(), whole = kept(renderer, stage, moment, 2);
  const Plate first = renderer.show_among({limited}, false);
  const Plate last = renderer.show_among({whole}, false);
  const Plate picture = renderer.show_among({limited, whole}, false);
  int others = 0;
  for (std::size_t i = 0; i < picture.samples.size(); ++i)
    others += std::abs(picture.samples[i] - 0.5 * (first.samples[i] + last.samples[i])) > 1 ? 1 : 0;
  EXPECT_LT(others, 0.02 * 3 * width * height);
}

// A lamp, a shadow, and a jump of what throws it: just before the frame, just after it, or there
// and back. Light comes straight and is not reflected further, so a frame has no noise but at
// outlines, and a ghost would be seen beside that.
class NeighboursAfter : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(AJump, NeighboursAfter, ::testing::Values(0, 1, 2));

TEST_P(NeighboursAfter, ShowNoGhost) {
  Stage stage;
  stage.view.environment = uniform_environment(glm::vec3(0.2f));
  stage.view.scene.lights = {point_lamp({1, 0, 3}, glm::dvec3(3))};
  Take take;
  for (int i = -2; i <= 2; ++i) {
    const bool is_here = GetParam() == 0 ? i >= 0 : GetParam() == 1 ? i <= 0 : i == 0;
    take[i] = {stage.view.world_from_camera,
               is_here ? glm::dvec3(0, 0, 0.3) : glm::dvec3(-0.5, 0.3, 0.3), 4};
  }
  const Plate truth = truth_of(stage, take[0], 512, up_to_depth(1)).picture;
  SetRenderer renderer(stage.view, up_to_depth(1));
  const auto frames = chain(renderer, stage, take);
  const Plate alone = renderer.show_among({frames.back()}, false);
  const Plate among = renderer.show_among(frames, false);
  EXPECT_LT(rms_between(among, truth), 1.3 * rms_between(alone, truth));
}

}  // namespace previz::test::neighbours_test
