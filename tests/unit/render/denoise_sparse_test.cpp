// Noise taken out of what few samples or few photons have brought, of pixels made by hand.
#include "tests/support/pixels_by_hand.hpp"

namespace previz::test::denoise_sparse_test {

// Returns the denoised signal of side * side pixels. With `has_history` the variances have numbers
// of samples in their fourth component; otherwise the pixels have a single sample. Light of photons
// may be empty.
std::vector<glm::vec4> denoised_by_hand(int side, const std::vector<glm::vec4>& signals,
                                        const std::vector<glm::vec4>& variances,
                                        const std::vector<glm::vec4>& surfaces, bool has_history,
                                        const std::vector<glm::vec4>& caustics = {}) {
  render::Device& device = *shared_device();
  render::Denoiser denoiser(device);
  denoiser.reserve(signals.size(), false, !caustics.empty());
  const auto upload = [&](render::Buffer& buffer, const auto& values) {
    render::upload_bytes(device, buffer, std::as_bytes(std::span(values)));
  };
  upload(denoiser.signal(), signals);
  upload(denoiser.variance(), variances);
  upload(denoiser.surface(), surfaces);
  upload(denoiser.uncovered(), std::vector<glm::vec4>(signals.size()));
  upload(denoiser.real(), std::vector<glm::vec4>(signals.size()));
  constexpr std::uint16_t one = 0x3c00;  // as a half
  std::vector<std::uint16_t> albedos(4 * signals.size(), one);
  for (std::size_t i = 3; i < albedos.size(); i += 4) albedos[i] = 0;  // no ray has found a cover
  upload(denoiser.albedo(), albedos);
  if (!caustics.empty()) upload(denoiser.caustic(), caustics);
  device.record([&](const vk::raii::CommandBuffer& commands) {
    denoiser.record(commands, side, static_cast<int>(signals.size()) / side, !has_history,
                    has_history);
  });
  EXPECT_EQ(render::validation_messages(device), 0u);
  return render::download<glm::vec4>(device, denoiser.denoised_signal(), signals.size());
}

// The outline of a virtual wall, a column of pixels that it covers by half. One of them has a
// single sample, which met a light; its neighbours in the column have many. It must not stay as
// bright as it is, as if a sample without neighbours to compare it with were certain.
TEST(DenoiseSparse, TakesAnOutlierOutOfAYoungOutline) {
  constexpr int side = 16, outline = 8, young = 8 * side + outline;
  std::vector<glm::vec4> signals, variances, surfaces;
  for (int i = 0; i < side * side; ++i) {
    const int x = i % side;
    const float cover = x < outline ? 1.0f : x == outline ? 0.5f : 0.0f;
    signals.emplace_back(glm::vec3(0.4f * cover), 0.5f);
    variances.emplace_back(glm::vec3(0), i == young ? 1.0f : 31.0f);
    surfaces.emplace_back(0, 0, 1, cover);
  }
  signals[young] = {3, 3, 3, 0.5f};
  const std::vector<glm::vec4> clean = denoised_by_hand(side, signals, variances, surfaces, true);
  // Half of the wall's 0.4, and half of the outlier's part in the mean of the wall over 5x5 pixels,
  // of which ten are the wall's and five half.
  EXPECT_NEAR(clean[young].r, 0.2, 0.5 * 3 / 12.5);
}

// Photons' light on a real floor, of one sample: on the left a focus, a disc of twice white made by
// some thousand photons a pixel, and on the right one photon of 0.1 to every tenth pixel. The focus
// keeps its brightness and its outline, both to 4 of its standard deviations of 1 / 32. What few
// photons bring becomes even. At each level a bright pixel's dark neighbours take exp(-1 / 25) of
// what their equals would, and dark ones take all of one another: 4 % of the light may be lost, and
// 1 % beyond the pixels that are summed.
TEST(DenoiseSparse, KeepsAFocusOfPhotonsAndEvensOutFewOfThem) {
  constexpr int side = 64;
  constexpr double half = side * side / 2.0;  // the pixels on the right
  const auto in_focus = [](int x, int y) { return std::hypot(x - 16, y - 32) < 6; };
  std::vector<glm::vec4> signals(side * side, glm::vec4(0, 0, 0, 0.5)), variances(side * side);
  std::vector<glm::vec4> surfaces(side * side, glm::vec4(0, 0, 1, 0)), caustics(side * side);
  std::mt19937 random(3);
  double drawn = 0;
  for (const auto& [x, y, i] : pixels_of(side, side)) {
    glm::vec4& caustic = caustics[i];
    if (in_focus(x, y)) caustic = {2, 2, 2, 4.0 / 1024};
    if (x < side / 2 || random() % 10 != 0) continue;
    caustic = {0.1, 0.1, 0.1, 0.01};
    drawn += 0.1;
  }
  const std::vector<glm::vec4> clean =
      denoised_by_hand(side, signals, variances, surfaces, false, caustics);
  double sum = 0, square = 0;
  for (const auto& [x, y, i] : pixels_of(side, side)) {
    const float value = clean[i].r;
    const bool is_near = std::hypot(x - 16, y - 32) < 8;
    if (is_near) {
      EXPECT_NEAR(value, in_focus(x, y) ? 2 : 0, 4 * 2.0 / 32) << x << ", " << y;
    }
    if (x > 24) sum += value;
    if (x >= side / 2) square += std::pow(value - drawn / half, 2);
  }
  EXPECT_NEAR(sum, drawn, 0.05 * drawn);
  EXPECT_LT(square / half, 0.1 * 0.9 * 0.01 / 10);
}

}  // namespace previz::test::denoise_sparse_test
