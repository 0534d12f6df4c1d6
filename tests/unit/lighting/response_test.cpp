#include "daemon/core/lighting/response.hpp"

#include "tests/support/test.hpp"

namespace previz::lighting::response_test {

ResponseCurve gamma_curve(double gamma) {
  return {.kind = ResponseCurve::Kind::gamma, .gamma = gamma, .inverse_table = {}};
}

ResponseCurve table_curve(std::vector<double> table) {
  return {.kind = ResponseCurve::Kind::table, .inverse_table = std::move(table)};
}

// A film-like curve: steep at the bottom, flat at the top.
ResponseCurve film_curve(int entries) {
  std::vector<double> table;
  for (int i = 0; i < entries; ++i) {
    const double value = static_cast<double>(i) / (entries - 1);
    table.push_back(std::expm1(4 * value) / std::expm1(4.0));
  }
  table.back() = 1;
  return table_curve(table);
}

class EveryCurve : public testing::TestWithParam<std::tuple<ResponseCurve, int>> {};

TEST_P(EveryCurve, ReturnsEveryCodeAndIncreases) {
  const auto& [curve, bits] = GetParam();
  const Response response(curve, bits);
  const auto& inverse = response.inverse();
  ASSERT_EQ(inverse.size(), std::size_t{1} << bits);
  EXPECT_EQ(inverse.front(), 0);
  EXPECT_EQ(inverse.back(), 1);
  for (std::size_t code = 0; code < inverse.size(); ++code) {
    ASSERT_EQ(response.forward(inverse[code]), code);
    if (code > 0) {
      ASSERT_GT(inverse[code], inverse[code - 1]);
      const double least = response.least_signal(static_cast<std::uint16_t>(code));
      ASSERT_EQ(response.forward(least * (1 + 1e-9)), code);
      ASSERT_EQ(response.forward(least * (1 - 1e-9)), code - 1);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Response, EveryCurve,
    testing::Combine(
        testing::Values(ResponseCurve{},
                        ResponseCurve{.kind = ResponseCurve::Kind::linear, .inverse_table = {}},
                        gamma_curve(1.0), gamma_curve(2.2), gamma_curve(0.45), table_curve({0, 1}),
                        table_curve({0, 0.01, 0.1, 0.4, 1}), film_curve(256), film_curve(1024)),
        testing::Values(1, 8, 10, 12, 16)));

TEST(Response, SrgbHasItsPublishedValues) {
  const Response response({}, 8);
  // IEC 61966-2-1: half of the code range stands for 21.4 % of the light, to the rounding of the
  // published constants.
  EXPECT_NEAR(response.inverse()[128], 0.215861, 1e-6);
  EXPECT_NEAR(response.inverse()[10], 10 / 255.0 / 12.92, 1e-15);
  EXPECT_NEAR(response.inverse()[11], std::pow((11 / 255.0 + 0.055) / 1.055, 2.4), 1e-15);
}

TEST(Response, ForwardRoundsHalfUpAndClips) {
  const Response response({.kind = ResponseCurve::Kind::linear, .inverse_table = {}}, 8);
  EXPECT_EQ(response.forward(0.5 / 255 + 1e-9), 1);
  EXPECT_EQ(response.forward(0.5 / 255 - 1e-9), 0);
  EXPECT_EQ(response.forward(-3), 0);
  EXPECT_EQ(response.forward(7), 255);
  EXPECT_EQ(response.forward(std::numeric_limits<double>::infinity()), 255);
  EXPECT_EQ(response.forward(std::numeric_limits<double>::quiet_NaN()), 0);
}

std::string message_of(const ResponseCurve& curve, int bits) {
  return test::error_of([&] { const Response response(curve, bits); });
}

TEST(Response, RefusesWhatCannotRoundTrip) {
  // (1/65535)^70 is below the smallest double.
  EXPECT_THAT(message_of(gamma_curve(70), 16), HasSubstr("code 1"));
  for (const ResponseCurve& curve : {gamma_curve(0), gamma_curve(std::nan("")),
                                     table_curve({0, 0.5, 0.5, 1}), table_curve({0, 0.5})})
    EXPECT_THAT(message_of(curve, 8), HasSubstr("does not survive"));
  EXPECT_THAT(message_of({}, 17), HasSubstr("1 to 16"));
}

}  // namespace previz::lighting::response_test
