// The rig's display at work: the newest picture with the overlay above it, on a thread of its own,
// at the screen's pace.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>

#include "daemon/output/osd_page.hpp"
#include "daemon/pipeline/metrics.hpp"
#include "daemon/pipeline/shot.hpp"
#include "daemon/report/reports.hpp"
#include "daemon/rig/osd.hpp"
#include "daemon/set/set.hpp"

namespace previz::rig {

// The display is opened when it is there and again when it is back; meanwhile pictures are counted
// as dropped. In standby the screen is dark and free for others. A display that is read back
// (headless) is written to DIR/screen.png about once a second. Latency is counted from a frame's
// capture to where the display says it is seen, or to here where the set has none.
class Screen {
 public:
  struct Parts {  // outlive the screen
    report::Reports& reports;
    pipeline::Metrics& metrics;
    std::filesystem::path directory;
    // Called with every screenful that is shown, as it is read back, and the words in it; or empty.
    std::function<void(const Plate&, const output::OsdPage&)> on_screen;
  };

  // Throws previz::Error naming the key whose driver this build has not, or a font that is missing.
  Screen(const set::Set& set, Parts parts);
  ~Screen();
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;

  // Both return at once and may be called from any thread. The latest of each is shown.
  void show(const pipeline::Shot& shot, std::shared_ptr<const Plate> picture);
  void show(RigFacts facts);

 private:
  struct Impl;
  pipeline::Metrics& metrics_;
  std::unique_ptr<Impl> impl_;  // null: the set has no display
};

}  // namespace previz::rig
