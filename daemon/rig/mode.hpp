// What the rig is doing, and what each wish does to it: the whole state machine, as a pure table.
#pragma once

#include <array>

#include "daemon/set/actions.hpp"

namespace previz::rig {

using set::Mode;

struct State {
  Mode mode = Mode::live;
  bool recording = false;
  bool camera_lost = false;  // the observer; shown, and in the way of nothing
  bool has_good = false;     // a frame with pose and light was seen: refine has what to freeze
  bool has_take = false;     // a take is finished: review has what to play

  friend bool operator==(const State&, const State&) = default;
};

// Refining and standby let tracking and light estimation rest (P7), except that a take gets its
// poses whatever is shown.
bool tracks(const State& state);

// What happens to the rig. A mode that is wished for twice stays; one that is toggled goes back to
// live.
enum class Event {
  wish_standby,
  wish_live,
  wish_refine,
  wish_review,
  toggle_standby,
  toggle_refine,
  toggle_review,
  press,  // of any button, before its action: a refinement ends
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

// The event by which somebody asks for this mode.
Event wish_for(Mode mode);

struct Step {
  State state;
  const char* refused = nullptr;  // in words for the display; the state is then as it was
};

// Recording never ends by a change of mode: what would end it is refused. Record always rolls: from
// standby and review it goes live first. A lost camera changes nothing but State::camera_lost.
Step step(const State& state, Event event);

}  // namespace previz::rig
