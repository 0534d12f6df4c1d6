#include "daemon/rig/live.hpp"

#include <array>
#include <csignal>
#include <ostream>
#include <utility>

#include "daemon/control/bus.hpp"
#include "daemon/rig/event_loop.hpp"
#include "daemon/rig/headless_display.hpp"
#include "daemon/rig/loaded_set.hpp"
#include "daemon/rig/notes.hpp"
#include "daemon/rig/rig.hpp"
#include "daemon/rig/service.hpp"
#include "daemon/set/actions.hpp"
#include "daemon/set/names.hpp"
#include "drivers/error.hpp"

namespace previz::rig {
namespace {

// The command line's word over the set's.
LoadedSet overridden(LoadedSet loaded, const LiveOptions& options) {
  if (options.samples) loaded.set.quality.samples = *options.samples;
  if (options.directory) loaded.set.output.directory = *options.directory;
  return loaded;
}

control::Status status_of(const Rig& rig) {
  const Look& look = rig.controls().look();
  const output::RecorderStatus recorder = rig.recorder_status();
  return {set::name_of(look.state.mode),
          look.state.recording,
          recorder.directory.filename().string(),
          recorder.frames,
          recorder.dropped,
          recorder.fault,
          look.state.camera_lost,
          look.samples,
          rig.loaded().set.name,
          rig.controls().selected_object(),
          rig.controls().selected_light(),
          rig.last_said()};
}

control::Verbs verbs_of(Rig& rig, const std::function<std::string()>& metrics) {
  const auto answer = [](const Outcome& outcome) {
    return control::Answer{outcome.said, outcome.refused};
  };
  control::Verbs verbs;
  verbs.perform = [&rig, answer](const set::Action& action) {
    return answer(rig.perform(action, "bus"));
  };
  verbs.go = [&rig, answer](Mode mode) {
    constexpr std::array wishes = {Event::wish_standby, Event::wish_live, Event::wish_refine,
                                   Event::wish_review};
    return answer(rig.wish(wishes[static_cast<std::size_t>(mode)], "bus"));
  };
  verbs.record = [&rig, answer](bool on) {
    return answer(rig.wish(on ? Event::record_on : Event::record_off, "bus"));
  };
  verbs.status = [&rig] { return status_of(rig); };
  verbs.metrics = metrics;
  return verbs;
}

}  // namespace

pipeline::MetricsSnapshot run_live(const LiveOptions& options, std::ostream& out) {
  // A file that may not grow (RLIMIT_FSIZE) is an error of the recorder's, not the process's end.
  std::signal(SIGXFSZ, SIG_IGN);
  // For the loop, which reads the set again; before any thread is started here.
  sigset_t hangup;
  sigemptyset(&hangup);
  sigaddset(&hangup, SIGHUP);
  pthread_sigmask(SIG_BLOCK, &hangup, nullptr);
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
    std::optional<control::Bus> bus;
    if (options.bus) {
      bus.emplace(loop.handle(), verbs_of(*rig, [&] { return to_json(display.metrics()); }));
      rig->on_change([&] { bus->changed(); });
    }
    const auto reload =
        loop.on_signal(SIGHUP, [&] { rig->perform(*set::find_action("reload_set"), "SIGHUP"); });
    std::optional<LoadedSet> next = rig->run();
    if (!next) service::stopping();
    rig->on_change({});
    bus.reset();
    rig.reset();
    if (!next) return display.write();
    before = std::exchange(loaded, overridden(std::move(*next), options));
  }
}

}  // namespace previz::rig
