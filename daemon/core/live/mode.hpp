// The rig's state machine: its mode, and the effect of every event, as a pure function.
#pragma once

#include <array>

#include "daemon/core/set/actions.hpp"

namespace previz::live {

using set::Mode;

struct State {
  Mode mode = Mode::live;
  bool recording = false;
  bool camera_lost = false;  // the observer's loss is shown but blocks nothing
  bool has_good = false;     // a frame with pose and light was seen, so refine can freeze it
  bool has_take = false;     // a take is finished, so review can play it

  friend bool operator==(const State&, const State&) = default;
};

// Returns whether tracking and light estimation run. They rest while refining and in standby (P7),
// except that a take gets its poses in every mode.
bool tracks(const State& state);

// Events that happen to the rig. A mode that is wished for twice stays; a mode that is toggled
// twice goes back to live.
enum class Event {
  wish_standby,
  wish_live,
  wish_refine,
  wish_review,
  toggle_standby,
  toggle_refine,
  toggle_review,
  press,  // any button, before its action: ends a refinement
  record_on,
  record_off,
  record_toggle,
  recorder_failed,  // disk full, too slow, gone: the take so far is finished
  take_finished,
  review_ended,
  good_frame,
  camera_lost,
  camera_back
};
inline constexpr std::array all_events = {
    Event::wish_standby,   Event::wish_live,     Event::wish_refine,   Event::wish_review,
    Event::toggle_standby, Event::toggle_refine, Event::toggle_review, Event::press,
    Event::record_on,      Event::record_off,    Event::record_toggle, Event::recorder_failed,
    Event::take_finished,  Event::review_ended,  Event::good_frame,    Event::camera_lost,
    Event::camera_back};

// Returns the event that asks for this mode.
Event wish_for(Mode mode);

struct Step {
  State state;
  const char* refused = nullptr;  // reason for the display; the state is then unchanged
};

// Returns the state after the event. A change of mode that would end a recording is refused.
// Recording can always start: from standby and review the rig first goes live. A lost camera
// changes nothing but State::camera_lost.
Step step(const State& state, Event event);

}  // namespace previz::live
