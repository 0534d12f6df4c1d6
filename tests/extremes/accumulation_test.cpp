// The real accumulate shader, fed with ten million samples from 1e-4 to 1e4: the means of the sums
// are within 1e-6 of the exact ones.
#include "daemon/core/render/device/kernel.hpp"
#include "shaders/accumulate.spv.h"
#include "tests/support/pixels_by_hand.hpp"

namespace previz::test::accumulation_test {

using render::Buffer;
using render::Device;

// One pixel's sums on the device, and the sample buffers that the shader reads.
class Accumulator {
 public:
  explicit Accumulator(Device& device)
      : device_(device), kernel_(device, "accumulate", accumulate_spv, {0}) {
    const render::Purpose purpose{"a test", ""};
    const vk::DeviceSize samples = slots * sizeof(gpu::vec4);
    for (Buffer* buffer : {&mixed_, &real_, &landed_, &aov_, &albedo_})
      *buffer = render::create_storage_buffer(device, purpose, samples);
    render::upload_storage(device, purpose, pixels_, std::vector<gpu::GpuPixel>(1));
    render::upload_storage(device, purpose, control_, std::vector<gpu::GpuControl>(1));
    render::upload_storage(device, purpose, limits_, std::vector{gpu::UNLIMITED});
    gpu::GpuFrame frame{};
    frame.width = frame.height = 1;
    render::upload_uniform(device, purpose, frame_, frame);
  }

  static constexpr std::uint32_t batch_samples = 4096;

  // In the order given; at most batch_samples.
  void add(const std::vector<gpu::vec4>& mixed, const std::vector<gpu::vec4>& real) {
    render::upload_bytes(device_, mixed_, std::as_bytes(std::span(spread(mixed))));
    render::upload_bytes(device_, real_, std::as_bytes(std::span(spread(real))));
    const gpu::GpuBatch batch{0, 0, 1, 1, 0, static_cast<std::uint32_t>(mixed.size()), 0, 0};
    const render::Buffers buffers{
        {"frame", &frame_},          {"sample_mixed", &mixed_},   {"sample_real", &real_},
        {"sample_landed", &landed_}, {"sample_aov", &aov_},       {"sample_albedo", &albedo_},
        {"control", &control_},      {"pixels", &pixels_},        {"limits", &limits_},
        {"sample_caustic", &mixed_}, {"pixel_caustics", &pixels_}};  // not used without photons
    device_.record([&](const vk::raii::CommandBuffer& commands) {
      kernel_.dispatch({commands, batch, buffers}, 1);
    });
  }

  render::Layers layers(std::int64_t samples) const {
    const auto pixels = render::download<gpu::GpuPixel>(device_, pixels_, 1);
    return layers_of(pixels, samples);
  }
  gpu::GpuPixel pixel() const {
    return render::download<gpu::GpuPixel>(device_, pixels_, 1).front();
  }
  gpu::GpuControl control() const {
    return render::download<gpu::GpuControl>(device_, control_, 1).front();
  }

 private:
  // A tile of one pixel takes a whole block of slots for each sample (shaders/lib/path.glsl).
  static constexpr std::size_t block = 32;
  static constexpr std::size_t slots = block * batch_samples;

  const std::vector<gpu::vec4>& spread(const std::vector<gpu::vec4>& values) {
    staging_.resize(slots);
    for (std::size_t i = 0; i < values.size(); ++i) staging_[block * i] = values[i];
    return staging_;
  }

  Device& device_;
  render::Kernel kernel_;
  Buffer mixed_, real_, landed_, aov_, albedo_, pixels_, control_, limits_, frame_;
  std::vector<gpu::vec4> staging_;
};

// Sum without rounding to speak of: 64 bits of mantissa lose at most 1e7 * 2^-64 of it.
struct Exact {
  long double sum = 0;
  void add(float value) { sum += static_cast<long double>(value); }
};

constexpr std::int64_t many = 10'000'000;

// Samples of Lm from `next`, and of Lr from it as well; compares with the exact means.
template <typename Next>
void expect_exact_means(Next next) {
  Accumulator accumulator(*shared_device());
  Exact mixed, diff, square;
  for (std::int64_t done = 0; done < many;) {
    const auto count = std::min<std::int64_t>(many - done, Accumulator::batch_samples);
    std::vector<gpu::vec4> ms, rs;
    for (std::int64_t i = 0; i < count; ++i) {
      const auto [m, r] = next();
      ms.emplace_back(m, m, m, 1.0f);
      rs.emplace_back(r, r, r, gpu::SAMPLE_FULL);
      mixed.add(m);
      diff.add(m - r);  // the difference of a sample is a float; its rounding is the sample's own
      square.add(m * m);
    }
    accumulator.add(ms, rs);
    done += count;
  }
  const render::Layers layers = accumulator.layers(many);
  const auto n = static_cast<long double>(many);
  // The layers themselves are floats, right to 6e-8.
  EXPECT_NEAR(layers.mixed[0].g / static_cast<double>(mixed.sum / n), 1, 1e-6);
  EXPECT_NEAR(layers.diff[0].g, static_cast<double>(diff.sum / n),
              1e-6 * std::abs(static_cast<double>(diff.sum / n)) + 1e-30);
  EXPECT_FLOAT_EQ(layers.mask[0], 1.0f);
  const auto sum = [](float high, float low) {
    return static_cast<double>(high) + static_cast<double>(low);
  };
  const gpu::GpuPixel p = accumulator.pixel();
  EXPECT_NEAR(sum(p.square_high.g, p.square_low.g) / static_cast<double>(square.sum), 1, 1e-6);
  EXPECT_EQ(sum(p.square_high.w, p.square_low.w), static_cast<double>(many));
  EXPECT_EQ(sum(p.uncovered_high.g, p.uncovered_low.g), 0.0);  // every sample is covered
  EXPECT_EQ(accumulator.control().dropped_not_finite, 0u);
  EXPECT_EQ(accumulator.control().dropped_negative, 0u);
  EXPECT_EQ(render::validation_messages(*shared_device()), 0u);
}

TEST(Accumulation, OfASignalOverEightDecadesIsExact) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> decade(-4, 4);
  expect_exact_means([&] {
    const float m = std::pow(10.0f, decade(random));
    return std::pair(m, std::pow(10.0f, decade(random)));
  });
}

// Where running averages fail first: every sample nearly the same, in worlds nearly the same.
TEST(Accumulation, OfASteadySignalIsExact) {
  std::mt19937 random(4);
  std::uniform_real_distribution<float> noise(0, 1e-3f);
  expect_exact_means([&] {
    const float m = 1 + noise(random);
    return std::pair(m, m - 1e-4f * noise(random));
  });
}

// Samples that cannot be are counted and are black in both worlds; the others stay.
TEST(Accumulation, CountsWhatCannotBe) {
  const float nan = std::nanf(""), inf = std::numeric_limits<float>::infinity();
  Accumulator accumulator(*shared_device());
  const auto grey = [](float value) { return gpu::vec4(value, value, value, 0); };
  accumulator.add({grey(1), {1, nan, 1, 0}, grey(1), {1, -1, 1, 0}, grey(1), {0, 0, inf, 0}},
                  {grey(1), grey(1), {-1, 1, 1, 0}, grey(1), {1, 1, -inf, 0}, {0, 0, inf, 0}});
  EXPECT_EQ(accumulator.control().dropped_not_finite, 3u);
  EXPECT_EQ(accumulator.control().dropped_negative, 2u);
  const render::Layers layers = accumulator.layers(6);
  EXPECT_FLOAT_EQ(layers.mixed[0].g, 1.0f / 6);
  EXPECT_EQ(layers.diff[0].g, 0);
}

}  // namespace previz::test::accumulation_test
