#include "daemon/rig/live.hpp"

#include <array>
#include <chrono>
#include <csignal>
#include <ostream>
#include <utility>

#include "daemon/control/bus.hpp"
#include "daemon/rig/event_loop.hpp"
#include "daemon/rig/live_files.hpp"
#include "daemon/rig/loaded_set.hpp"
#include "daemon/rig/notes.hpp"
#include "daemon/rig/rig.hpp"
#include "daemon/rig/screen.hpp"
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

// The screen stays as it is from one set to the next, as far as both say the same of it.
class CrewScreen {
 public:
  CrewScreen(Notes& note, pipeline::Metrics& metrics, decltype(LiveOptions::on_screen) on_screen)
      : note_(note), metrics_(metrics), on_screen_(std::move(on_screen)) {}

  void use(const set::Set& set) {
    if (screen_ && set.display == used_ && set.output.directory == directory_) return;
    screen_.reset();  // before another opens the same display
    screen_.emplace(set, Screen::Parts{note_, metrics_, set.output.directory, on_screen_});
    used_ = set.display;
    directory_ = set.output.directory;
  }
  void close() { screen_.reset(); }
  Screen* operator->() { return &*screen_; }

 private:
  Notes& note_;
  pipeline::Metrics& metrics_;
  const decltype(LiveOptions::on_screen) on_screen_;
  std::optional<Screen> screen_;
  set::Display used_;
  std::filesystem::path directory_;
};

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
  const auto start = std::chrono::steady_clock::now();
  const auto snapshot = [&] {
    const std::chrono::duration<double> since = std::chrono::steady_clock::now() - start;
    return metrics.snapshot(since.count());
  };
  LoadedSet loaded = overridden(load_whole_set(options.set_file), options);
  std::optional<LoadedSet> before;  // what ran until now, should this one not start
  const std::shared_ptr<render::Device> device = render::open_device(options.device);
  CrewScreen screen(note, metrics, options.on_screen);
  for (;;) {
    EventLoop loop;
    std::optional<LiveFiles> files;
    const auto show = [&](pipeline::Shot shot, const Look& look) {
      if (options.on_shown) options.on_shown(shot, look);
      const auto picture = std::make_shared<const Plate>(std::move(shot.picture));
      screen->show(shot, picture);
      files->take(picture);
    };
    const auto tell = [&](RigFacts facts) { screen->tell(std::move(facts)); };
    std::unique_ptr<Rig> rig;
    try {
      files.emplace(
          loaded.set.output.directory, [&] { return to_json(snapshot()); }, note);
      screen.use(loaded.set);
      rig = std::make_unique<Rig>(loaded, Rig::Parts{loop, note, metrics, device, show, tell,
                                                     options.buttons, options.loop, options.stop});
    } catch (const std::exception& error) {
      if (!before) throw;
      note.again(std::string(error.what()) +
                 "\nback to the set as it was: " + before->set.file.string());
      // Of the same file: not tried again until it is changed again.
      if (before->set.file == loaded.set.file) before->changed = loaded.changed;
      loaded = *std::exchange(before, std::nullopt);
      continue;
    }
    note.again("live on " + render::device_name(*device) + ", set \"" + loaded.set.name + "\", " +
               std::to_string(loaded.set.quality.samples) + " samples a frame");
    std::optional<control::Bus> bus;
    if (options.bus) {
      bus.emplace(loop.handle(), verbs_of(*rig, [&] { return to_json(snapshot()); }));
      rig->on_change([&] { bus->changed(); });
    }
    const auto reload =
        loop.on_signal(SIGHUP, [&] { rig->perform(*set::find_action("reload_set"), "SIGHUP"); });
    std::optional<LoadedSet> next = rig->run();
    if (!next) service::stopping();
    rig->on_change({});
    bus.reset();
    rig.reset();
    if (!next) {
      screen.close();
      return snapshot();
    }
    before = std::exchange(loaded, overridden(std::move(*next), options));
  }
}

}  // namespace previz::rig
