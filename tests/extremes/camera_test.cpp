// Pixels at the ends of the sensor's codes, both ways; brackets that are clipped or black in every
// exposure.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "daemon/lighting/hdr.hpp"
#include "daemon/lighting/lighting.hpp"
#include "daemon/lighting/response.hpp"
#include "daemon/render/composite.hpp"
#include "tests/unit/lighting_pictures.hpp"

namespace previz::lighting {
namespace {

using test::fisheye_camera;
using test::looking;
using test::make_frame;

const ResponseCurve curves[] = {
    {},
    {.kind = ResponseCurve::Kind::linear, .inverse_table = {}},
    {.kind = ResponseCurve::Kind::gamma, .gamma = 2.2, .inverse_table = {}},
    {.kind = ResponseCurve::Kind::table, .inverse_table = {0, 0.01, 0.1, 0.4, 1}}};

// Every code of 8 bits, and the ends of 16, through radiance and back at any exposure: without a
// difference and with a covered pixel that shows the very radiance.
TEST(ExtremeCamera, every_code_comes_back_through_the_composite) {
  for (const ResponseCurve& curve : curves) {
    for (const int bits : {8, 16}) {
      const int top = (1 << bits) - 1;
      Plate plate{256, 1, bits, {}};
      for (int i = 0; i < 256; ++i) {
        const int code = bits == 8 ? i : i < 128 ? i : top - (255 - i);
        plate.samples.insert(plate.samples.end(), 3, static_cast<std::uint16_t>(code));
      }
      const Response response(curve, bits);
      for (const double exposure : {1e-6, 0.85, 1e6}) {
        const render::PlateRadiance radiance = render::plate_radiance(plate, response, exposure);
        EXPECT_EQ(radiance.value[0], 0);
        EXPECT_DOUBLE_EQ(radiance.value.back(), 1 / exposure);
        std::vector<gpu::GpuPixel> untouched(256), covered(256);
        for (std::size_t i = 0; i < 256; ++i) {
          untouched[i].square_diff_high.w = covered[i].square_diff_high.w = 1;
          const double value = radiance.value[3 * i];
          const auto high = static_cast<float>(value);
          const auto low = static_cast<float>(value - static_cast<double>(high));
          covered[i].mixed_high = gpu::vec4(high, high, high, 1);
          covered[i].mixed_low = gpu::vec4(low, low, low, 0);
        }
        for (const auto& pixels : {untouched, covered}) {
          const render::Layers layers = render::make_layers(pixels, 256, 1, 1, radiance);
          EXPECT_EQ(render::make_picture(layers, plate, response, exposure).samples, plate.samples)
              << bits << " bits, exposure " << exposure;
        }
      }
    }
  }
}

// A bracket of two stops, all white or all black: the map is finite and what the least or the most
// exposed frame can say, the report says over how much of the sky, and a note says it in words.
TEST(ExtremeCamera, a_clipped_or_black_bracket_is_flagged) {
  LightCameraCalibration camera = fisheye_camera();
  camera.world_from_camera = looking(0, 90);
  for (const double signal : {0.0, 1.0}) {
    std::vector<FramePtr> bracket;
    for (const double exposure : {4.0, 1.0})
      bracket.push_back(
          make_frame(512, 512, exposure, std::vector<glm::dvec3>(512 * 512, glm::dvec3(signal))));
    const HdrPicture merged = merge_exposures(bracket, camera.response);
    for (const std::uint8_t flag : merged.flags)
      ASSERT_EQ(flag, signal > 0 ? overexposed : underexposed);
    const Lighting lighting = estimate(bracket, camera, {});
    for (const glm::vec3& radiance : lighting.environment.radiance)
      for (int c = 0; c < 3; ++c)
        ASSERT_NEAR(radiance[c], signal, 1e-4);  // white of the shorter exposure, and smooth
    const EnvironmentReport& report = lighting.report;
    EXPECT_NEAR(signal > 0 ? report.overexposed_sr : report.underexposed_sr, report.seen_sr, 1e-6);
    EXPECT_EQ(signal > 0 ? report.underexposed_sr : report.overexposed_sr, 0);
    ASSERT_FALSE(report.notes.empty());
    EXPECT_NE(
        report.notes[0].find(signal > 0 ? "clipped in every exposure" : "black in every exposure"),
        std::string::npos)
        << report.notes[0];
  }
}

}  // namespace
}  // namespace previz::lighting
