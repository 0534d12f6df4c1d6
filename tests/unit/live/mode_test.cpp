// Every event in every state the rig can be in, also while the camera is lost.
#include "daemon/core/live/mode.hpp"

#include "daemon/core/set/names.hpp"
#include "tests/support/test.hpp"

namespace previz::live::mode_test {

using enum Mode;

auto key(const State& s) {
  return std::tuple(s.mode, s.recording, s.camera_lost, s.has_good, s.has_take);
}

// Everything that can be reached from the start by any events.
std::vector<State> reachable() {
  std::vector<State> states{State{}};
  std::set<decltype(key(State{}))> known{key(State{})};
  for (std::size_t i = 0; i < states.size(); ++i)
    for (const Event event : all_events) {
      const State next = step(states[i], event).state;
      if (known.insert(key(next)).second) states.push_back(next);
    }
  return states;
}

// The table as a person would write it: where each event leads from standby, live, refine, review,
// and what else it changes.
struct Row {
  Event event;
  std::array<Mode, 4> to;
  void (*changes)(State&) = [](State&) {};
};
constexpr Row table[] = {
    {Event::wish_standby, {standby, standby, standby, standby}},
    {Event::wish_live, {live, live, live, live}},
    {Event::wish_refine, {refine, refine, refine, refine}},
    {Event::wish_review, {review, review, review, review}},
    {Event::toggle_standby, {live, standby, standby, standby}},
    {Event::toggle_refine, {refine, refine, live, refine}},
    {Event::toggle_review, {review, review, review, live}},
    {Event::press, {standby, live, live, review}},
    {Event::record_on, {live, live, refine, live}, [](State& s) { s.recording = true; }},
    {Event::record_off, {standby, live, refine, review}, [](State& s) { s.recording = false; }},
    {Event::record_toggle, {live, live, refine, live}, [](State& s) { s.recording ^= true; }},
    {Event::recorder_failed,
     {standby, live, refine, review},
     [](State& s) { s.recording = false; }},
    {Event::take_finished, {standby, live, refine, review}, [](State& s) { s.has_take = true; }},
    {Event::review_ended, {standby, live, refine, live}},
    {Event::good_frame, {standby, live, refine, review}, [](State& s) { s.has_good = true; }},
    {Event::camera_lost, {standby, live, refine, review}, [](State& s) { s.camera_lost = true; }},
    {Event::camera_back, {standby, live, refine, review}, [](State& s) { s.camera_lost = false; }},
};

bool must_be_refused(const State& from, Mode to) {
  if (to == from.mode) return false;
  return (from.recording && (to == standby || to == review)) || (to == refine && !from.has_good) ||
         (to == review && !from.has_take);
}

TEST(Modes, EveryEventDoesWhatTheTableSaysInEveryState) {
  ASSERT_EQ(std::size(table), all_events.size());
  const std::vector<State> states = reachable();
  for (const State& from : states)
    for (const Row& row : table) {
      SCOPED_TRACE(testing::Message()
                   << set::name_of(from.mode) << (from.recording ? " recording" : "")
                   << (from.camera_lost ? " camera lost" : "") << ", event "
                   << static_cast<int>(row.event));
      const Mode to = row.to[static_cast<std::size_t>(from.mode)];
      const Step taken = step(from, row.event);
      if (must_be_refused(from, to)) {
        EXPECT_NE(taken.refused, nullptr);
        EXPECT_EQ(taken.state, from);
        continue;
      }
      State wanted = from;
      wanted.mode = to;
      row.changes(wanted);
      EXPECT_EQ(taken.refused, nullptr);
      EXPECT_EQ(taken.state, wanted);
    }
}

// What the four flags and modes could be, less recording in standby or review, refining without a
// good frame, and playing without a take: 2 (lost) * [live: 2*2*2 + refine: 2*2 + standby: 2*2 +
// review: 2].
TEST(Modes, WhatMakesNoSenseCannotBeReached) {
  const std::vector<State> states = reachable();
  EXPECT_EQ(states.size(), 2u * (8 + 4 + 4 + 2));
  for (const State& state : states) {
    EXPECT_FALSE(state.recording && (state.mode == standby || state.mode == review));
    EXPECT_FALSE(state.mode == refine && !state.has_good);
    EXPECT_FALSE(state.mode == review && !state.has_take);
  }
}

TEST(ModeTable, EveryModeCanBeWishedFor) {
  State anything;
  anything.has_good = anything.has_take = true;
  for (const auto& [name, mode] : set::names(Mode{}))
    EXPECT_EQ(step(anything, wish_for(mode)).state.mode, mode) << name;
}

}  // namespace previz::live::mode_test
