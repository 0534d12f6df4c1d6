#include "daemon/rig/live.hpp"

#include <csignal>
#include <ostream>
#include <utility>

#include "daemon/rig/event_loop.hpp"
#include "daemon/rig/headless_display.hpp"
#include "daemon/rig/loaded_set.hpp"
#include "daemon/rig/notes.hpp"
#include "daemon/rig/rig.hpp"
#include "drivers/error.hpp"

namespace previz::rig {
namespace {

// The command line's word over the set's.
LoadedSet overridden(LoadedSet loaded, const LiveOptions& options) {
  if (options.samples) loaded.set.quality.samples = *options.samples;
  if (options.directory) loaded.set.output.directory = *options.directory;
  return loaded;
}

}  // namespace

pipeline::MetricsSnapshot run_live(const LiveOptions& options, std::ostream& out) {
  // A file that may not grow (RLIMIT_FSIZE) is an error of the recorder's, not the process's end.
  std::signal(SIGXFSZ, SIG_IGN);
  Notes note(out);
  pipeline::Metrics metrics;
  LoadedSet loaded = overridden(load_whole_set(options.set_file), options);
  std::optional<LoadedSet> before;  // what ran until now, should this one not start
  const std::shared_ptr<render::Device> device = render::open_device(options.device);
  for (;;) {
    EventLoop loop;
    HeadlessDisplay display(loaded.set.output.directory, metrics);
    const auto show = [&](pipeline::Shot shot, const Look& look) {
      if (options.on_shown) options.on_shown(shot, look);
      display.show(std::move(shot));
    };
    std::unique_ptr<Rig> rig;
    try {
      rig = std::make_unique<Rig>(loaded, Rig::Parts{loop, note, metrics, device, show,
                                                     options.buttons, options.loop, options.stop});
    } catch (const Error& error) {
      if (!before) throw;
      note.again(std::string(error.what()) + "\nback to " + before->set.file.string());
      loaded = *std::exchange(before, std::nullopt);
      continue;
    }
    note.again("live on " + render::device_name(*device) + ", set \"" + loaded.set.name + "\", " +
               std::to_string(loaded.set.quality.samples) + " samples a frame");
    std::optional<LoadedSet> next = rig->run();
    rig.reset();
    if (!next) return display.write();
    before = std::exchange(loaded, overridden(std::move(*next), options));
  }
}

}  // namespace previz::rig
