// Shows the newest picture with the overlay above it, on a thread of its own, at the screen's pace.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>

#include "daemon/core/output/osd_page.hpp"
#include "daemon/core/pipeline/metrics.hpp"
#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/pipeline/stage_keeper.hpp"
#include "daemon/core/set/set.hpp"
#include "daemon/rig/live_guides.hpp"
#include "daemon/rig/osd.hpp"
#include "drivers/card_picture.hpp"

namespace previz::rig {

// The display is opened when it is there and again when it comes back; meanwhile pictures are
// counted as dropped. What else fails makes the display begin anew. In standby the screen is dark
// and free for other programs. A display that is read back (headless) is written to DIR/screen.png
// about once a second. Latency counts from a frame's capture to the time at which the display
// reports it visible, or to show() if the set has no display.
class Screen {
 public:
  struct Parts {  // outlive the screen
    pipeline::StageKeeper::Parts kept;
    std::filesystem::path directory;
    // Called with every screenful as it is read back, and the words in it; may be empty.
    std::function<void(const Plate&, const output::OsdPage&)> on_screen;
  };

  // Throws previz::Error naming the key whose driver this build does not have, or a font that is
  // missing.
  Screen(const set::Set& set, Parts parts);
  ~Screen();
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;

  // These return at once and may be called from any thread. The latest picture and facts are shown.
  // `guides` is called, on the screen's thread, only while Look::guides or
  // the cross of Look::marking is on; it may be empty.
  void show(const pipeline::Shot& shot, GuidesOf guides);
  void show(RigFacts facts);
  // Returns the card whose pictures the screen shows where they are (Display::card()); nothing
  // where they have to come down. May be called from any thread.
  std::optional<CardIdentity> card() const;

 private:
  struct Impl;
  pipeline::Metrics& metrics_;
  std::unique_ptr<Impl> impl_;  // null: the set has no display
};

}  // namespace previz::rig
