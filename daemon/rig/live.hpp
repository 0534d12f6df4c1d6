// Runs the live pipeline, as `previzd run` does. Only the newest value passes between stages; drops
// are counted.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <vector>

#include "daemon/core/live/cameras.hpp"
#include "daemon/core/output/osd_page.hpp"
#include "daemon/core/pipeline/liveness.hpp"
#include "daemon/core/pipeline/metrics.hpp"
#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/render/renderer.hpp"
#include "daemon/core/report/reports.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/rig/controls.hpp"
#include "drivers/buttons.hpp"

namespace previz::rig {

struct LiveOptions {
  std::filesystem::path set_file;
  std::optional<std::filesystem::path> with;       // replaces settings of the set (set::Overlay)
  std::optional<int> samples;                      // quality.samples
  std::optional<std::filesystem::path> directory;  // output.directory
  bool loop = false;                               // replayed cameras start again at their end
  bool bus = false;  // org.previz.Rig1 on the system bus, when there is one
  render::DeviceOptions device;
  std::stop_token stop;
  pipeline::Patience patience = {};  // until a thread counts as hung
  // Returns whether another version of the program has been installed; may be empty. If so when a
  // take ends, run_live ends too, so that an upgrade need not end a take.
  std::function<bool()> replaced;
  // Returns whether the kernel has devices of a kind that was not there when the process began; may
  // be empty. If so while there is no graphics device and no take is recorded, run_live ends,
  // because a service cannot open what came later than itself.
  std::function<bool()> has_new_devices;
  // Opens devices besides those the set names, for tests.
  std::function<std::vector<std::unique_ptr<Buttons>>()> buttons;
  // Called with a set's cameras before they are used, for tests, which may put others around them.
  std::function<void(live::Cameras&)> around_cameras;
  // As StageKeeper's, for tests.
  std::function<void(const std::string&)> rehearse;
  // Called with every picture as it goes to the display, on the pipeline's last thread.
  std::function<void(const pipeline::Shot&, const live::Look&)> on_shown;
  // Called with every screenful as it is read back, and the overlay's words, on the display's
  // thread.
  std::function<void(const Plate&, const output::OsdPage&)> on_screen;
};

// Runs until the observer's stream ends or a stop is requested. Buttons act as the set says;
// changes of the set file take effect. About once a second, and at the end, the newest picture is
// written to DIR/picture.png and the metrics to DIR/metrics.json. A frame whose pose is lost, or
// that comes before the first light, shows its plate untouched. A stage that fails is reported,
// counted and begun anew while the rig goes on (live_pipeline.hpp). Throws previz::Error on
// anything that keeps the rig from running.
pipeline::MetricsSnapshot run_live(const LiveOptions& options, report::Reports& reports);

}  // namespace previz::rig
