// Sums of a frame's samples that were made in ranges are those of the whole, to the last bit.
#include "daemon/core/render/picture/sample_sums.hpp"

#include <bit>
#include <cstring>
#include <limits>

#include "daemon/core/pipeline/refinement.hpp"
#include "tests/support/averaged_frames.hpp"

namespace previz::test::sample_sums_test {

using render::PixelSums, render::SampleRange, render::SampleSpan, render::SampleSums,
    render::SumTree;

// True if the memory of both has the same bytes: NaN, -0 and all.
template <class T>
bool same_bits(const render::Sheet<T>& a, const render::Sheet<T>& b) {
  return std::ranges::equal(std::as_bytes(std::span(a)), std::as_bytes(std::span(b)));
}
bool same_bits(const PixelSums& a, const PixelSums& b) {
  return same_bits(a.pixels, b.pixels) && same_bits(a.caustics, b.caustics);
}

TEST(SampleParts, AreSixteenAtMostAndOfSixtyFourSamplesOrMore) {
  EXPECT_EQ(render::part_count(1), 1);
  EXPECT_EQ(render::part_count(127), 1);
  EXPECT_EQ(render::part_count(128), 2);
  EXPECT_EQ(render::part_count(255), 2);
  EXPECT_EQ(render::part_count(256), 4);
  EXPECT_EQ(render::part_count(1023), 8);
  EXPECT_EQ(render::part_count(1024), 16);
  EXPECT_EQ(render::part_count(1'000'000), 16);
}

// Every range begins and ends where parts do, and ranges follow one another without a gap.
TEST(SampleRanges, ConsistOfWholePartsThatFollowOneAnother) {
  for (const int samples : {128, 129, 255, 256, 300, 1000, 1023, 1'000'000}) {
    const int parts = render::part_count(samples);
    for (int count = 1; count <= parts; count *= 2) {
      int next = 0;
      for (int index = 1; index <= count; ++index) {
        const SampleSpan range = render::samples_of({index, count}, samples);
        EXPECT_EQ(range.first, next);
        next = range.first + range.count;
        const int first_part = parts / count * (index - 1);
        EXPECT_EQ(range.first, render::samples_of({first_part + 1, parts}, samples).first);
      }
      EXPECT_EQ(next, samples);
    }
  }
}

constexpr float denormal = std::numeric_limits<float>::denorm_min();

// Values of all magnitudes and both signs, and two-float sums of them.
SampleSums random_sums(std::uint32_t seed) {
  std::mt19937 random(seed);
  const auto value = [&] {
    const std::uint32_t kind = random() % 8;
    if (kind == 0) return 0.0f;
    if (kind == 1) return denormal * static_cast<float>(random() % 100);
    const float magnitude = std::pow(10.0f, static_cast<float>(random() % 60) - 30);
    return (random() % 2 == 0 ? magnitude : -magnitude) * static_cast<float>(random() % 1000);
  };
  SampleSums sums{8, 4, 64, {}};
  sums.sums.pixels.resize(32);
  sums.sums.caustics.resize(32);
  for (std::size_t i = 0; i < 32; ++i) {
    gpu::GpuPixel& pixel = sums.sums.pixels[i];
    for (auto [high, low] : {std::pair{&pixel.mixed_high, &pixel.mixed_low},
                             {&pixel.diff_high, &pixel.diff_low},
                             {&pixel.uncovered_high, &pixel.uncovered_low},
                             {&pixel.square_high, &pixel.square_low}})
      for (int c = 0; c < 4; ++c) {
        (*high)[c] = value();
        (*low)[c] = (*high)[c] * 3e-8f;
      }
    for (int c = 0; c < 4; ++c) pixel.normal[c] = value();
    for (int c = 0; c < 4; ++c) pixel.albedo[c] = value();
    for (int c = 0; c < 4; ++c) sums.sums.caustics[i][c] = value();
  }
  sums.counters.rays = seed;
  return sums;
}

TEST(SumTree, OfRangesIsThatOfTheWholeToTheLastBit) {
  constexpr std::uint32_t parts = 16;
  SumTree whole;
  for (std::uint32_t part = 0; part < parts; ++part) whole.add(random_sums(part));
  const SampleSums expected = whole.take();
  EXPECT_EQ(expected.samples, 64 * parts);
  EXPECT_EQ(expected.counters.rays, parts * (parts - 1) / 2);
  for (std::uint32_t ranges = 1; ranges <= parts; ranges *= 2) {
    SumTree merged;
    for (std::uint32_t range = 0; range < ranges; ++range) {
      SumTree tree;
      for (std::uint32_t part = range * parts / ranges; part < (range + 1) * parts / ranges; ++part)
        tree.add(random_sums(part));
      merged.add(tree.take());
    }
    const SampleSums sums = merged.take();
    EXPECT_TRUE(same_bits(sums.sums, expected.sums)) << ranges;
    EXPECT_EQ(sums.samples, expected.samples);
    EXPECT_EQ(sums.counters.rays, expected.counters.rays);
  }
}

// Doubling is exact, as long as nothing overflows.
TEST(SumTree, OfEqualSumsIsExact) {
  const SampleSums one = random_sums(5);
  SumTree tree;
  for (int part = 0; part < 16; ++part) tree.add(one);
  const SampleSums sixteen = tree.take();
  for (std::size_t i = 0; i < one.sums.pixels.size(); ++i) {
    const gpu::GpuPixel &a = one.sums.pixels[i], &b = sixteen.sums.pixels[i];
    for (int c = 0; c < 4; ++c) {
      EXPECT_EQ(double(b.mixed_high[c]) + double(b.mixed_low[c]),
                16 * (double(a.mixed_high[c]) + double(a.mixed_low[c])));
      EXPECT_EQ(b.normal[c], 16 * a.normal[c]);
    }
    EXPECT_EQ(sixteen.sums.caustics[i], 16.0f * one.sums.caustics[i]);
  }
}

struct TwoFloats {
  float high, low;
};

TwoFloats merged(TwoFloats a, TwoFloats b) {
  const auto sums = [](TwoFloats value) {
    SampleSums one{1, 1, 64, {}};
    one.sums.pixels.resize(1);
    one.sums.pixels[0].diff_high.x = value.high;
    one.sums.pixels[0].diff_low.x = value.low;
    return one;
  };
  SampleSums sum = sums(a);
  render::add_to(sum, sums(b));
  return {sum.sums.pixels[0].diff_high.x, sum.sums.pixels[0].diff_low.x};
}

void expect_sum(TwoFloats a, TwoFloats b, TwoFloats sum) {
  for (const TwoFloats& found : {merged(a, b), merged(b, a)}) {
    EXPECT_EQ(std::bit_cast<std::uint32_t>(found.high), std::bit_cast<std::uint32_t>(sum.high))
        << found.high << " for " << sum.high;
    EXPECT_EQ(std::bit_cast<std::uint32_t>(found.low), std::bit_cast<std::uint32_t>(sum.low))
        << found.low << " for " << sum.low;
  }
}

TEST(TwoFloatSums, AreMergedWithoutLoss) {
  expect_sum({0, 0}, {0, 0}, {0, 0});
  expect_sum({1, 0}, {0, 0}, {1, 0});
  expect_sum({denormal, 0}, {denormal, 0}, {2 * denormal, 0});
  expect_sum({1e30f, 0}, {1e-30f, 0}, {1e30f, 1e-30f});
  expect_sum({1, 0}, {0x1p-30f, 0}, {1, 0x1p-30f});
  // Nothing is left but what the low parts hold.
  expect_sum({1e30f, 1e-30f}, {-1e30f, 0}, {1e-30f, 0});
  expect_sum({1, 0x1p-30f}, {-1, 0x1p-40f}, {0x1p-30f + 0x1p-40f, 0});
  expect_sum({3, 0x1p-30f}, {-3, -0x1p-30f}, {0, 0});
}

// The relative error of algorithm 6 is below 3 u^2 / (1 - 4 u), u = 2^-24, where the signs are
// equal. The exact sum of four floats of these magnitudes fits into a long double of 64 bits.
TEST(TwoFloatSums, OfOneSignAreMergedToTheirStatedError) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> unit(0.5f, 1.0f);
  for (int i = 0; i < 100'000; ++i) {
    const TwoFloats a{unit(random), unit(random) * 0x1p-26f},
        b{unit(random) * 0x1p-5f, unit(random) * 0x1p-31f};
    const TwoFloats sum = merged(a, b);
    const long double exact = static_cast<long double>(a.high) + a.low + b.high + b.low;
    const long double off = static_cast<long double>(sum.high) + sum.low - exact;
    ASSERT_LE(std::abs(off), 3.1L * 0x1p-48L * exact);
  }
}

// What a process that renders all or one range of a frame's samples has of it.
struct Rendered {
  SampleSums sums;
  render::Counters counters;
  render::Layers layers;
  Plate picture, denoised;
};

constexpr int frame_samples = 256;

Rendered shown(SetRenderer& renderer) {
  Rendered all;
  all.counters = renderer.counters();
  all.layers = renderer.layers();
  all.picture = renderer.show(false);
  all.denoised = renderer.show(true);
  all.sums = renderer.take_sums();
  return all;
}

class FrameInRanges : public ::testing::TestWithParam<bool> {
 protected:
  FrameInRanges() {
    if (GetParam()) stage_.make_glass(60);
    stage_.view.calibration = pinhole(16, 12, 0.9);
  }
  static PlatePtr plate() {
    return std::make_shared<const Plate>(
        Plate{16, 12, 16, std::vector<std::uint16_t>(3 * 16 * 12, 20000)});
  }
  void begin(SetRenderer& renderer) const {
    renderer.begin({.plate = plate(),
                    .exposure = 0.5,
                    .world_from_camera = stage_.view.world_from_camera,
                    .seed = 7});
  }
  BoxAboveFloor stage_;
};
INSTANTIATE_TEST_SUITE_P(WithPhotonsOrWithout, FrameInRanges, ::testing::Bool());

// Each range comes from a renderer of its own, as from a process of its own: half of the samples,
// and two quarters.
TEST_P(FrameInRanges, IsTheWholeFrameToTheLastBit) {
  SetRenderer one(stage_.view);
  begin(one);
  ASSERT_TRUE(pipeline::render_range(one, frame_samples, {}, {}, {}).whole);
  const Rendered expected = shown(one);
  EXPECT_EQ(expected.sums.sums.caustics.empty(), !GetParam());
  EXPECT_EQ(expected.layers.samples, frame_samples);
  EXPECT_EQ(expected.sums.samples, frame_samples);
  const auto sums_of = [&](SampleRange range) {
    SetRenderer renderer(stage_.view);
    begin(renderer);
    const auto refined = pipeline::render_range(renderer, frame_samples, range, {}, {});
    EXPECT_TRUE(refined.whole);
    EXPECT_EQ(refined.samples, frame_samples / range.count);
    const render::Counters counters = renderer.counters();
    expect_clean(counters);
    SampleSums sums = renderer.take_sums();
    sums.counters = counters;
    return sums;
  };
  const SampleSums fourth = sums_of({4, 4}), third = sums_of({3, 4}), first_half = sums_of({1, 2});
  SumTree last_half, tree;
  last_half.add(third);
  last_half.add(fourth);
  tree.add(first_half);
  tree.add(last_half.take());
  SetRenderer merging(stage_.view);
  begin(merging);
  merging.put_sums(tree.take());
  const Rendered merged = shown(merging);
  EXPECT_TRUE(same_bits(merged.sums.sums, expected.sums.sums));
  EXPECT_EQ(merged.picture.samples, expected.picture.samples);
  EXPECT_EQ(merged.denoised.samples, expected.denoised.samples);
  EXPECT_EQ(merged.layers.samples, expected.layers.samples);
  EXPECT_EQ(merged.layers.composite, expected.layers.composite);
  EXPECT_EQ(merged.layers.normal, expected.layers.normal);
  EXPECT_EQ(merged.layers.variance, expected.layers.variance);
  EXPECT_EQ(merged.counters.rays, expected.counters.rays);
  EXPECT_EQ(merged.counters.shadow_rays, expected.counters.shadow_rays);
}

// A frame too small to be divided keeps the bits that it has without parts, and a part those of a
// frame that has only its samples.
TEST_P(FrameInRanges, OfOnePartIsSummedAsItWasRendered) {
  const int few = GetParam() ? 20 : 127;  // photons take their time
  SetRenderer in_parts(stage_.view), plain(stage_.view);
  begin(in_parts);
  begin(plain);
  ASSERT_TRUE(pipeline::render_range(in_parts, few, {}, {}, {}).whole);
  plain.render(few);
  EXPECT_TRUE(same_bits(in_parts.take_sums().sums, plain.take_sums().sums));
  // What follows are the next samples, from sums of nothing.
  plain.render(8);
  begin(in_parts);
  in_parts.start_at(few);
  in_parts.render(8);
  EXPECT_TRUE(same_bits(in_parts.take_sums().sums, plain.take_sums().sums));
}

TEST_P(FrameInRanges, CanBeCancelledBetweenPartsAndBegunAgain) {
  SetRenderer renderer(stage_.view), fresh(stage_.view);
  begin(renderer);
  int done = 0;
  const auto refined = pipeline::render_range(
      renderer, frame_samples, {}, [&] { return done >= 70; },
      [&](int samples) { done = samples; });
  EXPECT_FALSE(refined.whole);
  for (SetRenderer* one : {&renderer, &fresh}) {
    begin(*one);
    ASSERT_TRUE(pipeline::render_range(*one, 4, {}, {}, {}).whole);
  }
  EXPECT_TRUE(same_bits(renderer.take_sums().sums, fresh.take_sums().sums));
}

TEST_P(FrameInRanges, TakesNoSumsOfAnotherPicture) {
  SetRenderer renderer(stage_.view);
  begin(renderer);
  renderer.render(1);
  SampleSums sums = renderer.take_sums();
  sums.width = 15;
  EXPECT_THROW(renderer.put_sums(sums), Error);
  sums.width = 16;
  sums.sums.caustics.resize(GetParam() ? 0 : sums.sums.pixels.size());
  EXPECT_THROW(renderer.put_sums(sums), Error);
}

}  // namespace previz::test::sample_sums_test
