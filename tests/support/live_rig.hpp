// The daemon from end to end on the small take, with a crew that presses buttons when it sees what
// it waits for.
#pragma once

#include <nlohmann/json.hpp>

#include "daemon/tools/post/render.hpp"
#include "tests/support/content_of.hpp"
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

// The film camera's frames of a take, each of which must be there.
inline std::vector<session::FrameRecord> unbroken(const std::filesystem::path& take) {
  session::Session session = session::open_session(take);
  EXPECT_TRUE(session.missing.empty()) << testing::PrintToString(session.missing);
  const auto stream = session::open_stream(session, "observer");
  if (!stream) return {};
  std::vector<session::FrameRecord> records = stream->records();
  for (std::size_t i = 0; i < records.size(); ++i)
    EXPECT_EQ(records[i].sequence, records[0].sequence + i);
  return records;
}

class RigLive : public testing::Test {
 protected:
  struct Shown {
    pipeline::Shot shot;
    live::Look look;
    int count = 0;     // pictures until this one
    int rendered = 0;  // how many of these were rendered
    bool records(int samples) const { return look.state.recording && shot.samples == samples; }
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

  // Replaces words of the set file. Returns its text as it was before.
  std::string replace_in_set(const std::string& old, const std::string& by) {
    std::string before = test::content_of(directory_ / "set.toml");
    std::string text = before;
    EXPECT_THAT(text, HasSubstr(old));
    text.replace(text.find(old), old.size(), by);
    std::ofstream(directory_ / "set.toml") << text;
    return before;
  }

  std::function<void()> while_shown_ = [] {};  // on the display's thread
  rig::LiveOptions options_;
  // Nobody but a screen wants the pictures if not; the script cannot wait for them then.
  bool sees_pictures_ = true;

  // Runs the daemon, looping the take, until the script has ended.
  void run(const std::function<void()>& script) {
    rig::LiveOptions options = options_;
    if (sees_pictures_)
      options.on_shown = [&](const pipeline::Shot& shot, const live::Look& look) {
        std::unique_lock lock(mutex_);
        shown_ = {shot, look, shown_.count + 1, shown_.rendered + (shot.samples > 0 ? 1 : 0)};
        seen_.notify_all();
        lock.unlock();
        while_shown_();
      };
    std::ostream out(&log_);
    metrics_ = run_looped(std::move(options), directory_.path(), hand_, script, out);
  }

  // The same with a script that begins once pictures are rendered.
  void run_rendering(const std::function<void()>& script) {
    run([&] {
      until_samples(2);
      script();
    });
  }

  // Waits until metrics.json, which is written once a second while pictures are shown, is as it
  // should be.
  void until_metrics(const std::string& what,
                     const std::function<bool(const nlohmann::json&)>& condition) {
    const auto text = [file = directory_ / "live/metrics.json"] {
      return std::filesystem::exists(file) ? test::content_of(file) : std::string("{}");
    };
    must_come(
        what, [&] { return condition(nlohmann::json::parse(text())); }, text);
  }
  void until_measured(const std::function<bool(const nlohmann::json& stages)>& condition) {
    until_metrics("the metrics are right", [&](const nlohmann::json& metrics) {
      return metrics.contains("stages") && condition(metrics.at("stages"));
    });
  }
  void until_counted(const std::string& what) {
    until_metrics("\"" + what + "\" is counted", [&](const nlohmann::json& metrics) {
      return metrics.dump().find("\"" + what + "\"") != std::string::npos;
    });
  }

  // Waits until the condition holds for what is shown: no time is assumed.
  Shown until(const std::function<bool(const Shown&)>& condition) {
    std::unique_lock lock(mutex_);
    await(
        seen_, lock, [&] { return shown_.shot.frame && condition(shown_); },
        [&] { return "picture " + std::to_string(shown_.count) + "\n" + log_.text(); });
    return shown_;
  }
  Shown shown_now() {
    return until([](const Shown&) { return true; });
  }
  Shown until_samples(int samples) {
    return until([samples](const Shown& s) { return s.shot.samples == samples; });
  }
  // Waits until more than so many pictures were shown since now.
  Shown until_more(int pictures) {
    const int before = shown_now().count;
    return until([=](const Shown& s) { return s.count > before + pictures; });
  }
  // Waits until so many pictures were rendered since now.
  Shown until_rendered(int more) {
    const int before = rendered_pictures();
    return until([=](const Shown& s) { return s.rendered >= before + more; });
  }
  int rendered_pictures() {
    const std::lock_guard lock(mutex_);
    return shown_.rendered;
  }
  Shown until_frozen(int samples = 0) {
    return until([=](const Shown& s) { return s.shot.frozen && s.shot.samples >= samples; });
  }
  Shown until_mode(live::Mode mode) {
    return until([mode](const Shown& s) {
      return s.look.state.mode == mode && s.shot.frozen == (mode == live::Mode::refine);
    });
  }
  void until_said(const std::string& words) {
    must_come(
        "\"" + words + "\" is said", [&] { return said(words); }, [&] { return log_.text(); });
  }
  bool said(const std::string& words) const { return count_said(words) > 0; }
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
  void press(const std::string& button) { hand_.press(button); }

  // Begins a take and waits for a picture in it; ends one and waits until it is on the disk.
  Shown begin_take() {
    press("record");
    return until([](const Shown& s) { return s.look.state.recording; });
  }
  void end_take(const std::string& name = "12A_take001") {
    press("record");
    until_said(name + " is finished");
  }
  std::filesystem::path take_folder(const std::string& name = "12A_take001") const {
    return directory_ / "takes" / name;
  }

  // The layers of the frame as `previz render` makes them.
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
