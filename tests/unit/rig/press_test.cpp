// Presses from edges alone: every time is written down here, none is waited for.
#include "daemon/rig/press.hpp"

#include "tests/support/test.hpp"

namespace previz::rig::press_test {

using set::PressKind;
using enum set::PressKind;
constexpr std::int64_t ms = 1'000'000;

set::Button mapped(PressKind kind, const std::string& name = "red") {
  return {name, kind, "record"};
}

// Edges as (time in ms, pushed), then the clock to the end; what was recognised, as (time in ms,
// kind).
using Recognised = std::vector<std::pair<std::int64_t, PressKind>>;
Recognised presses_of(const std::vector<PressKind>& kinds,
                      const std::vector<std::pair<std::int64_t, bool>>& edges,
                      std::int64_t end_ms) {
  std::vector<set::Button> buttons;
  for (const PressKind kind : kinds) buttons.push_back(mapped(kind));
  PressRecognizer recognizer(buttons);
  Recognised recognised;
  const auto keep = [&](const std::vector<Press>& presses) {
    for (const Press& press : presses) recognised.emplace_back(press.timestamp_ns / ms, press.kind);
  };
  for (const auto& [at, pushed] : edges) keep(recognizer.edge({"red", pushed, at * ms}));
  keep(recognizer.tick(end_ms * ms));
  return recognised;
}

TEST(Presses, AButtonWithAShortPressOnlyAnswersWhenItIsPushed) {
  EXPECT_EQ(
      presses_of({short_press}, {{100, true}, {5000, false}, {5001, true}, {5002, false}}, 9000),
      (Recognised{{100, short_press}, {5001, short_press}}));
}

TEST(Presses, WithALongPressShortIsToldAtTheRelease) {
  EXPECT_EQ(presses_of({short_press, long_press}, {{100, true}, {699, false}}, 9000),
            (Recognised{{699, short_press}}));
}

TEST(Presses, LongIsToldWhileItIsStillHeldAndItsReleaseSaysNothing) {
  EXPECT_EQ(presses_of({short_press, long_press}, {{100, true}}, 700),
            (Recognised{{700, long_press}}));
  EXPECT_EQ(presses_of({short_press, long_press}, {{100, true}}, 699), Recognised{});
  EXPECT_EQ(presses_of({short_press, long_press}, {{100, true}, {2000, false}}, 9000),
            (Recognised{{700, long_press}}));
}

TEST(Presses, WithADoublePressShortWaitsForTheSecondPush) {
  const std::vector<PressKind> kinds = {short_press, double_press};
  EXPECT_EQ(presses_of(kinds, {{0, true}, {100, false}}, 399), Recognised{});
  EXPECT_EQ(presses_of(kinds, {{0, true}, {100, false}}, 400), (Recognised{{400, short_press}}));
  EXPECT_EQ(presses_of(kinds, {{0, true}, {100, false}, {399, true}, {450, false}}, 9000),
            (Recognised{{399, double_press}}));
  // Too late for a double press: two short ones.
  EXPECT_EQ(presses_of(kinds, {{0, true}, {100, false}, {401, true}, {450, false}}, 9000),
            (Recognised{{400, short_press}, {750, short_press}}));
}

TEST(Presses, AllThreeOnOneButton) {
  const std::vector<PressKind> kinds = {short_press, long_press, double_press};
  EXPECT_EQ(presses_of(kinds,
                       {{0, true},
                        {50, false},
                        {1000, true},
                        {1050, false},
                        {1200, true},
                        {1900, false},
                        {3000, true},
                        {4000, false}},
                       9000),
            (Recognised{{350, short_press}, {1200, double_press}, {3600, long_press}}));
}

TEST(Presses, AThirdPushStartsAnew) {
  EXPECT_EQ(
      presses_of({short_press, double_press},
                 {{0, true}, {10, false}, {20, true}, {30, false}, {40, true}, {50, false}}, 9000),
      (Recognised{{20, double_press}, {350, short_press}}));
}

TEST(Presses, WhatHasNoActionIsNotTold) {
  EXPECT_EQ(presses_of({long_press}, {{0, true}, {10, false}}, 9000), Recognised{});
  EXPECT_EQ(presses_of({double_press}, {{0, true}, {10, false}}, 9000), Recognised{});
  EXPECT_TRUE(PressRecognizer({mapped(short_press)}).edge({"blue", true, 0}).empty());
}

// A device that comes back may say a release nobody pushed, or push twice.
TEST(Presses, EdgesThatDoNotPairAreHarmless) {
  EXPECT_EQ(presses_of({short_press, long_press},
                       {{10, false}, {20, true}, {30, true}, {40, false}}, 9000),
            (Recognised{{40, short_press}}));
}

}  // namespace previz::rig::press_test
