#include "daemon/rig/live.hpp"

#include <malloc.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <thread>
#include <utility>
#include <variant>

#include "daemon/control/inhibitor.hpp"
#include "daemon/core/live/graphics.hpp"
#include "daemon/core/set/actions.hpp"
#include "daemon/core/set/check.hpp"
#include "daemon/core/set/names.hpp"
#include "daemon/rig/bus_link.hpp"
#include "daemon/rig/event_loop.hpp"
#include "daemon/rig/live_files.hpp"
#include "daemon/rig/rig.hpp"
#include "daemon/rig/screen.hpp"
#include "daemon/rig/service.hpp"
#include "daemon/rig/set_keeper.hpp"
#include "drivers/error.hpp"

namespace previz::rig {
namespace {

// Command line options override the set's.
void override_set(set::Set& set, const LiveOptions& options) {
  if (options.samples) set.quality.samples = *options.samples;
  if (options.directory) set.output.directory = *options.directory;
}

// The screen stays open from one set to the next if both describe it alike.
class CrewScreen {
 public:
  CrewScreen(pipeline::StageKeeper::Parts kept, decltype(LiveOptions::on_screen) on_screen)
      : kept_(std::move(kept)), on_screen_(std::move(on_screen)) {}

  void use(const set::Set& set) {
    if (screen_ && set.display == used_ && set.output.directory == directory_) return;
    screen_.reset();  // before another opens the same display
    screen_.emplace(set, Screen::Parts{kept_, set.output.directory, on_screen_});
    used_ = set.display;
    directory_ = set.output.directory;
  }
  void close() { screen_.reset(); }
  Screen* operator->() { return &*screen_; }

 private:
  const pipeline::StageKeeper::Parts kept_;
  const decltype(LiveOptions::on_screen) on_screen_;
  std::optional<Screen> screen_;
  set::Display used_;
  std::filesystem::path directory_;
};

control::Status status_of(const Rig& rig, const SetKeeper& sets, const render::Device& device,
                          const report::Reports& reports) {
  const live::Look& look = rig.controls().look();
  const output::RecorderStatus recorder = rig.recorder_status();
  const std::optional<fit::Figure> fit = rig.model_fit();
  return {set::name_of(look.state.mode),
          look.state.recording,
          recorder.writing,
          recorder.directory.filename().string(),
          recorder.good,
          recorder.seconds,
          recorder.frames,
          recorder.lost.frames,
          0.1 * std::floor(10 * recorder.backlog.seconds),
          recorder.backlog.bytes / 1'000'000,
          recorder.fault,
          look.state.camera_lost,
          rig.samples(),
          sets.running().set.name,
          rig.controls().selected_object(),
          rig.controls().selected_light(),
          sets.problem(),
          render::drawing_device(device),
          fit ? words_of(*fit) : "",
          reports.announced(),
          rig.picture_age_s().value_or(-1),
          0};
}

control::Verbs verbs_of(Rig& rig, const SetKeeper& sets, const render::Device& device,
                        report::Reports& reports, const std::function<std::string()>& metrics) {
  const auto answer = [](const Outcome& outcome) {
    return control::Answer{outcome.said, outcome.refused};
  };
  // Whoever asks on the bus need not see the set.
  const auto ends_a_take = [&rig, &sets](bool begins) {
    return !sets.running().set.recording.end_over_bus && !begins &&
           rig.controls().look().state.recording;
  };
  const auto not_here = [] {
    return control::Answer{"the set lets only buttons end a take (recording.end_over_bus)", true};
  };
  control::Verbs verbs;
  const auto over_bus = [](const std::string& who) { return "bus, " + who; };
  verbs.perform = [&rig, answer, ends_a_take, not_here, over_bus](const set::Action& action,
                                                                  const std::string& who,
                                                                  control::Verbs::Reply reply) {
    if (std::holds_alternative<set::Record>(action.effect) && ends_a_take(false))
      return reply(not_here());
    rig.perform(action, over_bus(who), [reply = std::move(reply), answer](const Outcome& outcome) {
      reply(answer(outcome));
    });
  };
  verbs.go = [&rig, answer, over_bus](live::Mode mode, const std::string& who) {
    return answer(rig.wish(live::wish_for(mode), over_bus(who)));
  };
  verbs.record = [&rig, answer, ends_a_take, not_here, over_bus](bool on, const std::string& who) {
    if (ends_a_take(on)) return not_here();
    return answer(rig.wish(on ? live::Event::record_on : live::Event::record_off, over_bus(who)));
  };
  verbs.denied = [&reports, over_bus](const std::string& who, const std::string& verb) {
    reports(report::once({report::Severity::warning, over_bus(who), verb + " (not allowed)"}));
  };
  verbs.status = [&] { return status_of(rig, sets, device, reports); };
  verbs.metrics = metrics;
  return verbs;
}

// While a set loads: `last` is what was known before.
control::Verbs loading_verbs(control::Status last) {
  last.mode = "loading";
  last.recording = last.writing = last.camera_lost = false;
  const auto age_s = [begin = std::chrono::steady_clock::now()] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  const auto refusal = [age_s] {
    return control::Answer{
        "a set is loading (since " + std::to_string(std::lround(age_s())) + " s); try again", true};
  };
  control::Verbs verbs;
  verbs.perform = [refusal](const set::Action&, const std::string&,
                            const control::Verbs::Reply& reply) { reply(refusal()); };
  verbs.go = [refusal](live::Mode, const std::string&) { return refusal(); };
  verbs.record = [refusal](bool, const std::string&) { return refusal(); };
  verbs.status = [last, age_s]() mutable {
    last.loading_s = age_s();
    return last;
  };
  verbs.metrics = [refusal]() -> std::string { throw Error(refusal().said); };
  return verbs;
}

bool is_recording(const Rig& rig) {
  return rig.controls().look().state.recording || rig.recorder_status().recording;
}

// What follows from whether a take is being recorded: the machine stays on meanwhile, and a program
// that was replaced meanwhile ends afterwards.
class RecordingWatch {
 public:
  RecordingWatch(sd_event* loop, report::Reports& reports, std::function<void()> ended)
      : inhibitor_(loop,
                   [&reports](const std::string& what) {
                     reports(report::once({report::Severity::warning, "", what}));
                   }),
        ended_(std::move(ended)) {}

  void look(const Rig& rig) {
    const bool recording = is_recording(rig);
    inhibitor_.hold(recording);
    if (std::exchange(recorded_, recording) && !recording) ended_();
  }

 private:
  control::Inhibitor inhibitor_;
  const std::function<void()> ended_;
  bool recorded_ = false;
};

// The rig from its start to its end: what stays while sets come and go, and each set's run.
class LiveRun {
 public:
  // `pulse` is the main thread's; liveness, pulse and reports outlive the run.
  LiveRun(const LiveOptions& options, report::Reports& reports, pipeline::Liveness& liveness,
          pipeline::Liveness::Pulse& pulse)
      : options_(options),
        reports_(reports),
        liveness_(liveness),
        pulse_(pulse),
        end_from_outside_(options.stop, [this] { end_.request_stop(); }),
        service_(liveness, reports, end_.get_token()),
        bus_(begin_bus()),
        sets_(
            options.set_file, [this](set::Set& set) { override_set(set, options_); }, reports,
            options.with),
        device_(live::open_graphics(
            render::options_for(options.device, sets_.running().set.quality.hardware_rays),
            sets_.running().set.quality.cpu_instead, reports)),
        screen_(kept_, options.on_screen) {}

  pipeline::MetricsSnapshot run() {
    for (;;) {
      reports_.begin_set();
      if (!run_set()) continue;
      if (is_last_) return snapshot();
      sets_.begin_next();
    }
  }

 private:
  // Whoever asks is answered from the beginning, while the first set loads.
  std::unique_ptr<BusLink> begin_bus() const {
    if (!options_.bus) return nullptr;
    auto bus = std::make_unique<BusLink>(kept_);
    bus->serve_alone(loading_verbs({}));
    return bus;
  }

  pipeline::MetricsSnapshot snapshot() {
    const std::chrono::duration<double> since = std::chrono::steady_clock::now() - start_;
    return metrics_.snapshot(since.count());
  }

  // Returns false, with the set before in place, if the set cannot run. Throws if there is none.
  bool run_set() {
    const set::Set& set = sets_.running().set;
    EventLoop loop([this](const std::exception& error) { loop_failed(error); });
    std::optional<LiveFiles> files;
    const auto show = [&](pipeline::Shot shot, const live::Look& look, GuidesOf guides) {
      if (options_.on_shown) options_.on_shown(shot, look);
      screen_->show(shot, std::move(guides));
      if (shot.picture) files->take(std::move(shot.picture));
    };
    // A picture comes down to the computer only where somebody there wants it.
    const auto wants = [&](const std::optional<CardIdentity>& card) -> render::ShowTo {
      const bool is_on_card = card && screen_->card() == card;
      return {.computer = !is_on_card || set.recording.composite || files->is_due() ||
                          static_cast<bool>(options_.on_shown),
              .card = is_on_card};
    };
    std::unique_ptr<Rig> rig;
    try {
      files.emplace(
          options_.directory ? *options_.directory : live_directory(set.output.directory),
          [this] { return to_json(snapshot()); }, reports_);
      screen_.use(set);
      rig = std::make_unique<Rig>(
          Rig::Parts{loop, sets_, kept_, service_, pulse_, device_, renderer_, show, wants,
                     [this](RigFacts facts) { screen_->show(std::move(facts)); }, options_.buttons,
                     options_.around_cameras, options_.loop, last_take_, end_.get_token()});
    } catch (const std::exception& error) {
      if (!sets_.go_back(error.what())) throw;
      return false;
    }
    say_live(set);
    run_rig(loop, *rig);
    rig.reset();
    is_last_ =
        !sets_.has_next() || end_.stop_requested();  // a stop may come with a set that was read
    if (is_last_) {  // before the files, which have the last word on what was shown
      service_.stopping();
      screen_.close();
    }
    return true;
  }

  void run_rig(EventLoop& loop, Rig& rig) {
    std::optional<RecordingWatch> watch;
    if (bus_) {
      watch.emplace(loop.handle(), reports_, [this] { end_if_replaced(); });
      bus_->serve(loop,
                  verbs_of(rig, sets_, *device_, reports_, [this] { return to_json(snapshot()); }));
      rig.on_change([&] {
        bus_->changed();
        watch->look(rig);
      });
    }
    const auto reload =
        loop.on_signal(SIGHUP, [&] { rig.perform(*set::find_action("reload_set"), "SIGHUP"); });
    const auto drivers = loop.every(std::chrono::seconds(1), [&] { end_if_barred(rig); });
    rig.run();
    if (bus_ && sets_.has_next() && !end_.stop_requested())
      bus_->serve_alone(loading_verbs(status_of(rig, sets_, *device_, reports_)));
    else
      bus_.reset();
    sets_.leave(rig.controls().look().edits);
    if (sets_.has_next() && rig.controls().look().take_edits != pipeline::Edits{})
      reports_({report::Severity::warning, "review",
                "changes to the take in review are dropped, because a set is loading"});
    rig.on_change({});
  }

  void loop_failed(const std::exception& error) {
    metrics_.count("main loop: failed");
    reports_(report::once({report::Severity::error, "main loop", error.what()}));
    // What fails again at once leaves time for the rest.
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }

  void say_live(const set::Set& set) {
    const bool holds_rate = set.quality.fps > 0;
    reports_({report::Severity::info, "",
              "live on " + live::device_words(*device_) + ", set \"" + set.name + "\", " +
                  (holds_rate ? "at most " : "") +
                  set::plural(std::uint64_t(set.quality.samples), "sample") + " per frame" +
                  (holds_rate ? ", fewer where the rate would suffer (quality.fps)" : "")});
  }

  void end_if_replaced() {
    if (!options_.replaced || !options_.replaced()) return;
    reports_({report::Severity::info, "", "another version was installed; restarting"});
    end_.request_stop();
  }

  void end_if_barred(const Rig& rig) {
    if (!options_.has_new_devices || !render::drawing_device(*device_).empty() ||
        is_recording(rig) || !options_.has_new_devices())
      return;
    reports_({report::Severity::info, "",
              "a new kind of device appeared; previzd is restarting to open it"});
    end_.request_stop();
  }

  const LiveOptions& options_;
  report::Reports& reports_;
  pipeline::Liveness& liveness_;
  pipeline::Liveness::Pulse& pulse_;
  const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  pipeline::Metrics metrics_;
  std::stop_source end_;
  const std::stop_callback<std::function<void()>> end_from_outside_;
  Service service_;
  const pipeline::StageKeeper::Parts kept_{.reports = reports_,
                                           .metrics = metrics_,
                                           .liveness = liveness_,
                                           .patience = options_.patience,
                                           .rehearse = options_.rehearse};
  std::unique_ptr<BusLink> bus_;  // null: not wanted, or the rig ends
  SetKeeper sets_;
  const std::shared_ptr<render::Device> device_;
  std::shared_ptr<render::Renderer> renderer_;  // goes from set to set
  CrewScreen screen_;
  KeptTake last_take_;
  bool is_last_ = false;  // no set follows the one that has run
};

// What the whole process needs before any thread starts.
void prepare_process() {
  // A file that may not grow (RLIMIT_FSIZE) fails the recorder's write and does not end the
  // process.
  std::signal(SIGXFSZ, SIG_IGN);
  // Threads come and go with cameras and sets. Each would take an arena of its own, up to eight for
  // a core, and leave its gaps there: more than 100 MB in five minutes.
  ::mallopt(M_ARENA_MAX, 2);
  // The loop takes SIGHUP and reads the set again; the signal is blocked before any thread starts
  // here.
  sigset_t hangup;
  sigemptyset(&hangup);
  sigaddset(&hangup, SIGHUP);
  pthread_sigmask(SIG_BLOCK, &hangup, nullptr);
}

}  // namespace

pipeline::MetricsSnapshot run_live(const LiveOptions& options, report::Reports& reports) {
  prepare_process();
  pipeline::Liveness liveness;
  pipeline::Liveness::Pulse pulse(liveness, Service::main_thread);
  pulse.begin(options.patience.set);  // until the set is read
  return LiveRun(options, reports, liveness, pulse).run();
}

}  // namespace previz::rig
