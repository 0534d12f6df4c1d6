// The daemon from end to end on the small take, with a crew that presses buttons when it sees what
// it waits for.
#pragma once

#include <nlohmann/json.hpp>

#include "daemon/post/render.hpp"
#include "daemon/rig/live.hpp"
#include "tests/support/crewed_rig.hpp"
#include "tests/support/small_take.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::test {

// A log that another thread may read.
class Log : public std::stringbuf {
 public:
  std::string text() const {
    const std::lock_guard lock(mutex_);
    return lines_;
  }

 private:
  int sync() override {
    const std::lock_guard lock(mutex_);
    lines_ += str();
    str("");
    return 0;
  }
  mutable std::mutex mutex_;
  std::string lines_;
};

class RigLive : public testing::Test {
 protected:
  struct Shown {
    pipeline::Shot shot;
    rig::Look look;
    int count = 0;
  };

  // The small take with a button for every action, named like it, and a lamp.
  void write_set(const std::string& more = "", std::int64_t interval_ns = small_take_interval_ns) {
    std::string text =
        "[[light]]\nname = \"key\"\ntype = \"point\"\nposition_m = [0.3, 0, 0.6]\n"
        "emission = [1, 1, 1]\n[recording]\nslate = \"12A\"\nreserve_mb = 1\n"
        "directory = \"takes\"\n" +
        more;
    text += button_for_every_action();
    write_small_take(directory_.path(), true, text, {}, interval_ns);
  }

  std::function<void()> while_shown_ = [] {};  // on the display's thread
  rig::LiveOptions options_;

  // Runs the daemon, looping the take, until the script has ended.
  void run(const std::function<void()>& script) {
    rig::LiveOptions options = options_;
    options.on_shown = [&](const pipeline::Shot& shot, const rig::Look& look) {
      std::unique_lock lock(mutex_);
      shown_ = {shot, look, shown_.count + 1};
      seen_.notify_all();
      lock.unlock();
      while_shown_();
    };
    std::ostream out(&log_);
    metrics_ = run_crewed(std::move(options), directory_.path(), hand_, script, out);
  }

  // Waits until the stages in metrics.json, which is written once a second while pictures are
  // shown, are as they should be.
  void until_measured(const std::function<bool(const nlohmann::json&)>& condition) {
    const auto text = [file = directory_ / "live/metrics.json"] {
      return std::filesystem::exists(file) ? session::read_file(file) : std::string("{}");
    };
    must_come(
        "the metrics are right",
        [&] {
          const auto json = nlohmann::json::parse(text());
          return json.contains("stages") && condition(json.at("stages"));
        },
        text);
  }

  // A press, then whatever is shown until the condition holds: no time is assumed.
  Shown until(const std::function<bool(const Shown&)>& condition) {
    std::unique_lock lock(mutex_);
    await(
        seen_, lock, [&] { return shown_.shot.frame && condition(shown_); },
        [&] { return "picture " + std::to_string(shown_.count) + "\n" + log_.text(); });
    return shown_;
  }
  Shown until_mode(rig::Mode mode) {
    return until([mode](const Shown& s) {
      return s.look.state.mode == mode && s.shot.frozen == (mode == rig::Mode::refine);
    });
  }
  void until_said(const std::string& words) {
    must_come(
        "\"" + words + "\" is said", [&] { return count_said(words) > 0; },
        [&] { return log_.text(); });
  }
  int count_said(const std::string& words) const {
    const std::string text = log_.text();
    int count = 0;
    for (std::size_t at = 0; (at = text.find(words, at)) != std::string::npos; ++at) ++count;
    return count;
  }
  // Returns whether a take that began before `first` and ends after `s` is long enough for a crew
  // that presses buttons in its review. A review goes at the pace of its take, whatever the machine
  // can render meanwhile, and ends with it. So the take is as long as a dozen pictures took.
  static bool is_long_after(const Shown& s, const Shown& first) {
    return s.count > first.count + 12 &&
           s.shot.frame->timestamp_ns > first.shot.frame->timestamp_ns + 4'000'000'000;
  }
  void until_counted(const std::string& what) { must_be_counted(directory_.path(), what); }
  void press(const std::string& button) { hand_.press(button); }

  // The layers of the frame as `previzd render` makes them.
  render::Layers rendered(const std::filesystem::path& take, std::int64_t timestamp_ns,
                          std::int64_t samples) {
    session::Session session = session::open_session(take);
    const auto stream = session::open_stream(session, "observer");
    std::uint64_t frame = 0;
    while (stream->records().at(frame).timestamp_ns != timestamp_ns) ++frame;
    post::RenderOptions options;
    options.session = take;
    options.directory = directory_ / ("post" + std::to_string(frame));
    options.frames = post::FrameRange{frame, frame};
    options.samples = static_cast<int>(samples);
    options.neighbours = 0;  // the frame alone, as a snapshot and a refinement have it
    render::Layers layers;
    options.on_frame = [&](const pipeline::Shot& shot) { layers = *shot.layers; };
    std::ostringstream ignored;
    post::render_session(options, ignored);
    return layers;
  }

  TemporaryDirectory directory_;
  Hand hand_;
  Log log_;
  std::mutex mutex_;
  std::condition_variable seen_;
  Shown shown_;
  pipeline::MetricsSnapshot metrics_;
};

}  // namespace previz::test
