#include "daemon/core/live/mode.hpp"

namespace previz::live {
namespace {

Step go(State state, Mode mode) {
  if (mode == state.mode) return {state};
  if (state.recording && (mode == Mode::standby || mode == Mode::review))
    return {state, "still recording; end the take first"};
  if (mode == Mode::refine && !state.has_good)
    return {state, "no frame with a pose and light yet; nothing to refine"};
  if (mode == Mode::review && !state.has_take)
    return {state, "no take recorded yet; nothing to review"};
  state.mode = mode;
  return {state};
}

Step toggle(const State& state, Mode mode) {
  return go(state, state.mode == mode ? Mode::live : mode);
}

Step record(State state, bool on) {
  state.recording = on;
  if (on && (state.mode == Mode::standby || state.mode == Mode::review)) state.mode = Mode::live;
  return {state};
}

Step with(State state, bool State::*flag, bool value) {
  state.*flag = value;
  return {state};
}

}  // namespace

bool tracks(const State& state) {
  return state.recording || state.mode == Mode::live;
}

Event wish_for(Mode mode) {
  switch (mode) {
    case Mode::standby:
      return Event::wish_standby;
    case Mode::live:
      return Event::wish_live;
    case Mode::refine:
      return Event::wish_refine;
    case Mode::review:
      return Event::wish_review;
  }
  return Event::wish_live;
}

Step step(const State& state, Event event) {
  switch (event) {
    case Event::wish_standby:
      return go(state, Mode::standby);
    case Event::wish_live:
      return go(state, Mode::live);
    case Event::wish_refine:
      return go(state, Mode::refine);
    case Event::wish_review:
      return go(state, Mode::review);
    case Event::toggle_standby:
      return toggle(state, Mode::standby);
    case Event::toggle_refine:
      return toggle(state, Mode::refine);
    case Event::toggle_review:
      return toggle(state, Mode::review);
    case Event::press:
      return state.mode == Mode::refine ? go(state, Mode::live) : Step{state};
    case Event::record_on:
      return record(state, true);
    case Event::record_off:
    case Event::recorder_failed:
      return record(state, false);
    case Event::record_toggle:
      return record(state, !state.recording);
    case Event::take_finished:
      return with(state, &State::has_take, true);
    case Event::review_ended:
      return state.mode == Mode::review ? go(state, Mode::live) : Step{state};
    case Event::good_frame:
      return with(state, &State::has_good, true);
    case Event::camera_lost:
      return with(state, &State::camera_lost, true);
    case Event::camera_back:
      return with(state, &State::camera_lost, false);
  }
  return {state};
}

}  // namespace previz::live
