// The rates of cameras, and what is said of one that a camera does not have.
#include "drivers/frame_rate.hpp"

#include "tests/support/test.hpp"

namespace previz::frame_rate_test {

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr double no_number = std::numeric_limits<double>::quiet_NaN();

CameraSettings asking(double rate_hz) {
  CameraSettings settings;
  settings.rate_hz = rate_hz;
  return settings;
}

TEST(FrameRate, ARefusalHasTheRateThoseOnOfferAndTheKey) {
  EXPECT_EQ(rate_not_possible(120, std::nullopt, text_of(rates_between(1, 60))),
            "rate_hz 120 is not possible; allowed: 1 to 60; change rate_hz or remove it");
  EXPECT_EQ(rate_not_possible(0.5, std::nullopt, text_of(RatesOnOffer{{30, 29.97, 15}})),
            "rate_hz 0.5 is not possible; allowed: 30, 29.97, 15; change rate_hz or remove it");
  EXPECT_EQ(rate_not_possible(120, std::nullopt, text_of(RatesOnOffer{})),
            "rate_hz 120 is not possible; change rate_hz or remove it");
}

TEST(FrameRate, AnotherRateIsADoubtInTheSameWords) {
  EXPECT_EQ(other_rate(asking(120), 60, text_of(rates_between(1, 60))),
            "rate_hz 120 is not possible; the camera sends 60 frames per second; allowed: 1 to 60; "
            "change rate_hz or remove it");
  EXPECT_EQ(other_rate(asking(40), 38, ""),
            "rate_hz 40 is not possible; the camera sends 38 frames per second; change rate_hz or "
            "remove it");
}

TEST(FrameRate, ARoundedRateIsTheSame) {
  EXPECT_EQ(other_rate(asking(30), 29.97, "29.97"), std::nullopt);
  EXPECT_EQ(other_rate(asking(100), 99, "99"), std::nullopt);
  EXPECT_NE(other_rate(asking(100), 98.9, "98.9"), std::nullopt);
  EXPECT_EQ(other_rate(CameraSettings{}, 60, "60"), std::nullopt);  // nothing was asked for
  EXPECT_EQ(other_rate(asking(30), 0, "60"), std::nullopt);         // the device reports none
}

TEST(FrameRate, TheNearestOnOfferIsTaken) {
  EXPECT_EQ(nearest_rate(rates_between(1, 60), 120), 60);
  EXPECT_EQ(nearest_rate(rates_between(1, 60), 0.5), 1);
  EXPECT_EQ(nearest_rate(rates_between(1, 60), 23.976), 23.976);
  EXPECT_EQ(nearest_rate(RatesOnOffer{{30, 15, 5}}, 12), 15);
  EXPECT_EQ(nearest_rate(RatesOnOffer{}, 12), 12);
}

TEST(FrameRate, BoundsThatAreImpossibleAreUnknown) {
  for (const auto& [least, most] :
       {std::pair{60.0, 1.0}, std::pair{-1.0, 60.0}, std::pair{1.0, infinite},
        std::pair{no_number, 60.0}, std::pair{1.0, no_number}}) {
    EXPECT_EQ(nearest_rate(rates_between(least, most), 25), 25);
    EXPECT_EQ(text_of(rates_between(least, most)), "");
  }
}

}  // namespace previz::frame_rate_test
