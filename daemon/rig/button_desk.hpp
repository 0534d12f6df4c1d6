// Reads the devices of a set's buttons, recognises presses, and asks for the action that the set
// maps to each press.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "daemon/core/live/cameras.hpp"
#include "daemon/core/pipeline/metrics.hpp"
#include "daemon/core/report/reports.hpp"
#include "daemon/core/set/actions.hpp"
#include "daemon/core/set/set.hpp"
#include "daemon/rig/event_loop.hpp"
#include "daemon/rig/press.hpp"
#include "drivers/buttons.hpp"

namespace previz::rig {

class ButtonDesk {
 public:
  // A device that always has another event must not keep the loop from its other work: what is not
  // read in one turn of the loop waits for the next one.
  static constexpr int most_events_a_turn = 16;

  struct Device {
    std::unique_ptr<Buttons> buttons;
    std::int64_t clock_offset_ns = 0;  // the cameras' clock minus the device's
  };
  struct Parts {  // outlive the desk
    EventLoop& loop;
    report::Reports& reports;
    pipeline::Metrics& metrics;
  };
  // All are called on the loop's thread.
  struct Asks {
    // Comes before every event that is read; false leaves the event for another desk.
    std::function<bool()> listens;
    // Receives every push and release of a button; returns true if it ended a refinement.
    std::function<bool(const ButtonEvent&)> edge;
    // Performs an action. `ended_refinement` is true if the same press ended a refinement.
    std::function<void(const set::Action&, const std::string& button, bool ended_refinement)> act;
  };

  // `mapped` is the set's mapping from presses to actions. From now on the devices are read while
  // the loop runs.
  ButtonDesk(const std::vector<set::Button>& mapped, std::vector<Device> devices, Parts parts,
             Asks asks);
  ButtonDesk(const ButtonDesk&) = delete;
  ButtonDesk& operator=(const ButtonDesk&) = delete;

  // Acts on the presses that became certain by the passing of time (PressRecognizer::tick).
  void tick(std::int64_t now_ns);
  // Adds the devices' counters to the metrics.
  void count();

 private:
  struct Watched {
    Device device;
    pipeline::DeviceCounts counts;
    std::unique_ptr<EventLoop::Watch> watch;
    std::uint64_t full_turns = 0;  // after which more events may have waited
  };

  void read(Watched& watched);
  void edge(const ButtonEvent& event);
  void act(const Press& press);

  const std::vector<set::Button> mapped_;
  const Parts parts_;
  const Asks asks_;
  PressRecognizer presses_;
  std::set<std::string> ended_refinement_;  // buttons whose present press ended one
  std::vector<Watched> devices_;
};

// Opens the devices of every button that the set maps: the replayed session's, those that are
// plugged in, and `more`'s (which may be empty). Throws previz::Error naming a button that cannot
// be understood.
std::vector<ButtonDesk::Device> open_button_devices(
    const set::Set& set, const live::Cameras& cameras,
    const std::function<std::vector<std::unique_ptr<Buttons>>()>& more);

}  // namespace previz::rig
