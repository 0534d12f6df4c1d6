// The rig from end to end by a transcript: a replayed take is looped, a hand presses the button of
// every action there is, and each line says what D-Bus signalled and what the crew then read on the
// display. Afterwards the take has the same story.
#include <systemd/sd-bus.h>

#include "daemon/control/bus.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/live_rig.hpp"
#include "tests/support/pages.hpp"
#include "tests/support/private_bus.hpp"
#include "tests/support/test.hpp"

namespace previz::rig::transcript_test {

using output::OsdPage;

// The overlay is switched off: a page without a word.
constexpr const char* no_words = "(no words)";
// The screen is dark, and shows no page that could be read.
constexpr const char* dark = "(dark)";

// A line of the transcript: a press, or nothing but what follows by itself; the message that is
// signalled on the bus, with the other properties that change at once; and what then comes onto the
// display, if it is not the message's own words.
struct Line {
  const char* button;
  const char* message;
  const char* changes = "";
  const char* screen = nullptr;
};

// clang-format off
constexpr Line transcript[] = {
    {"samples_up", "button samples_up: 3 samples", "Samples=3"},
    {"samples_down", "button samples_down: 2 samples", "Samples=2"},
    {"hold_rate", "button hold_rate: quality.fps is 0 in this set file (refused)", "", "quality.fps is 0 in this set file"},
    {"accumulate", "button accumulate: frame averaging off"},
    {"accumulate", "button accumulate: frame averaging on"},
    {"estimator", "button estimator: estimator: difference"},
    {"light_mode", "button light_mode: light: sources"},
    {"environment_left", "button environment_left: no environment file lights this set; nothing to turn (refused)", "", "no environment file lights this set"},
    {"environment_right", "button environment_right: no environment file lights this set; nothing to turn (refused)", "", "no environment file lights this set"},
    {"debug_view", "button debug_view: view: mixed"},
    {"record", "button record: recording", "Recording=yes", "● 00:"},
    {"next_object", "button next_object: object: sign", "Object=sign"},
    {"previous_object", "button previous_object: object: card", "Object=card"},
    {"move_left", "button move_left: card moved by -0.010 +0.000 +0.000 m"},
    {"move_right", "button move_right: card moved by +0.000 +0.000 +0.000 m"},
    {"move_back", "button move_back: card moved by +0.000 -0.010 +0.000 m"},
    {"move_forward", "button move_forward: card moved by +0.000 +0.000 +0.000 m"},
    {"move_down", "button move_down: card moved by +0.000 +0.000 -0.010 m"},
    {"move_up", "button move_up: card moved by +0.000 +0.000 +0.000 m"},
    {"turn_left", "button turn_left: card turned by +0.0 +0.0 +5.0 degrees"},
    {"turn_right", "button turn_right: card turned by +0.0 +0.0 +0.0 degrees"},
    {"tilt_forward", "button tilt_forward: card turned by +5.0 +0.0 +0.0 degrees"},
    {"tilt_back", "button tilt_back: card turned by +0.0 +0.0 +0.0 degrees"},
    {"roll_right", "button roll_right: card turned by +0.0 +5.0 +0.0 degrees"},
    {"roll_left", "button roll_left: card turned by +0.0 +0.0 +0.0 degrees"},
    {"scale_up", "button scale_up: card scaled to 1.05"},
    {"scale_down", "button scale_down: card scaled to 1"},
    {"next_variant", "button next_variant: card has no variants in its file (refused)", "", "card has no variants in its file"},
    {"previous_variant", "button previous_variant: card has no variants in its file (refused)", "", "card has no variants in its file"},
    {"reset_object", "button reset_object: card is back as the set file has it"},
    {"play", "button play: this set has no animation (refused)", "", "this set has no animation"},
    {"hold", "button hold: this set has no animation (refused)", "", "this set has no animation"},
    {"tags", "button tags: no phantom of this set has printed tags; previz model makes one (refused)", "", "no phantom of this set has printed tags"},
    {"next_light", "button next_light: lamp: fill", "Light=fill"},
    {"previous_light", "button previous_light: lamp: key", "Light=key"},
    {"light_up", "button light_up: key +0.33 stops"},
    {"light_down", "button light_down: key +0.00 stops"},
    {"light_warmer", "button light_warmer: key warm +0.10 green +0.00 stops"},
    {"light_cooler", "button light_cooler: key warm +0.00 green +0.00 stops"},
    {"light_greener", "button light_greener: key warm +0.00 green +0.10 stops"},
    {"light_pinker", "button light_pinker: key warm +0.00 green +0.00 stops"},
    {"reset_light", "button reset_light: key is reset to the set file"},
    {"exposure_up", "button exposure_up: exposure +0.33 stops"},
    {"exposure_down", "button exposure_down: exposure +0.00 stops"},
    {"standby", "button standby: still recording; end the take first (refused)", "", "still recording; end the take first"},
    {"refine", "button refine: refine", "Mode=refine", "REFINE"},
    {"snapshot", "button snapshot: live", "Mode=live", "LIVE"},  // any button ends a refinement
    {nullptr, "button snapshot: saving a snapshot"},
    {"mark_good", "button mark_good: the running take is marked good when it is finished", "", "the running take is marked good"},
    {"acknowledge", "button acknowledge: noted"},
    {"record", "button record: recording ended", "Recording=no"},
    {nullptr, "recorder: take 12A_take001 is finished"},
    {"review", "button review: review", "Mode=review", "REVIEW"},
    {"live", "button live: live", "Mode=live", "LIVE"},
    {"osd", "button osd: overlay off", "", no_words},
    {"osd", "button osd: overlay on"},
    {"pass_times", "button pass_times: pass times on", "", "does not time its passes"},  // the CPU
    {"pass_times", "button pass_times: pass times off"},
    {"guides", "button guides: guides on"},
    {"guides", "button guides: guides off"},
    {"marking", "button marking: aim the cross at box 1 corner 1", "", "aim the cross at box 1"},
    {"mark", "button mark: marks are kept in a take; start one with record, then mark (refused)", "", "marks are kept in a take"},
    {"unmark", "button unmark: no corner is marked (refused)", "", "no corner is marked"},
    {"next_corner", "button next_corner: mark box 1 corner 2"},
    {"next_box", "button next_box: mark box 1 corner 1"},
    {"marking", "button marking: marking off"},
    {"keep", "button keep: buttons have changed nothing; nothing to keep (refused)", "", "buttons have changed nothing"},
    {"reload_set", "button reload_set: reloading the set file", "", "LIVE"},
    {"next_set", "button next_set: next set", "", "LIVE"},
    {"previous_set", "button previous_set: previous set", "", "LIVE"},
    {"standby", "button standby: standby", "Mode=standby", dark},
    {"standby", "button standby: live", "Mode=live", "LIVE"},
};
// clang-format on

using Changes = std::map<std::string, std::string>;  // of properties

// The changes of one PropertiesChanged.
Changes changes_of(sd_bus_message* signal) {
  Changes changes;
  sd_bus_message_skip(signal, "s");
  sd_bus_message_enter_container(signal, 'a', "{sv}");
  while (sd_bus_message_enter_container(signal, 'e', "sv") > 0) {
    const char *name = nullptr, *type = nullptr, *text = nullptr;
    sd_bus_message_read(signal, "s", &name);
    sd_bus_message_peek_type(signal, nullptr, &type);
    sd_bus_message_enter_container(signal, 'v', type);
    std::string value;
    int number = 0;
    std::uint64_t frames = 0;
    if (*type == 't' && sd_bus_message_read(signal, "t", &frames) >= 0) {
      value = std::to_string(frames);
    } else if (*type == 's' && sd_bus_message_read(signal, "s", &text) >= 0) {
      value = text;
    } else if (*type == 'b' && sd_bus_message_read(signal, "b", &number) >= 0) {
      value = number != 0 ? "yes" : "no";
    } else if (*type == 'i' && sd_bus_message_read(signal, "i", &number) >= 0) {
      value = std::to_string(number);
    } else {
      sd_bus_message_skip(signal, type);
    }
    sd_bus_message_exit_container(signal);
    sd_bus_message_exit_container(signal);
    changes[name] = value;
  }
  return changes;
}

// Hears what the rig signals on the bus, for a thread that waits for it.
class Listener {
 public:
  explicit Listener(const std::function<void(Changes)>& heard) : heard_(heard) {
    sd_bus_open_system(&bus_);
    sd_bus_match_signal(bus_, nullptr, nullptr, control::object_path,
                        "org.freedesktop.DBus.Properties", "PropertiesChanged", &on_signal, this);
    thread_ = std::jthread([this](const std::stop_token& stop) {
      while (!stop.stop_requested() && sd_bus_wait(bus_, 100'000) >= 0)
        while (sd_bus_process(bus_, nullptr) > 0) continue;
    });
  }
  ~Listener() {
    thread_.request_stop();
    thread_.join();
    sd_bus_flush_close_unref(bus_);
  }

 private:
  static int on_signal(sd_bus_message* signal, void* listener, sd_bus_error*) {
    static_cast<Listener*>(listener)->heard_(changes_of(signal));
    return 0;
  }

  const std::function<void(Changes)> heard_;
  sd_bus* bus_ = nullptr;
  std::jthread thread_;
};

class RigTranscript : public test::RigLive {
 protected:
  void SetUp() override {
    if (!bus_.running()) GTEST_SKIP() << "dbus-daemon is not installed";
    write_set(
        "[display]\ndriver = \"headless\"\nmode = \"480x270\"\n"
        "[[object]]\nname = \"sign\"\nfile = \"card.gltf\"\npresence = \"virtual\"\n"
        "[[light]]\nname = \"fill\"\ntype = \"point\"\nposition_m = [-0.3, 0, 0.6]\n"
        "emission = [1, 1, 1]\n");
    std::filesystem::copy_file(directory_ / "set.toml", directory_ / "z.toml");
  }

  void perform() {
    const Listener listener([this](Changes changes) {
      const std::lock_guard lock(mutex_);
      // A machine may be so busy that the replayed camera is taken for stalled.
      if (changes["Message"].starts_with("rig: film camera: ")) return;
      // It is written by a thread of its own.
      if (changes["Message"].starts_with("snapshot: ")) return;
      if (changes["Message"].empty()) changes.erase("Message");
      if (is_of_loading(changes)) return;
      remember_take(changes);
      if (changes.empty()) return;
      signals_.push_back(std::move(changes));
      seen_.notify_all();
    });
    options_.bus = true;
    options_.on_screen = [this](const Plate&, const OsdPage& page) { pages_.show(page); };
    run([this] { follow(); });
  }

  // A set that is read shows it by its mode, until it runs with its own selection.
  bool is_of_loading(Changes& changes) {
    const auto mode = changes.find("Mode");
    if (mode == changes.end()) return false;
    const bool was_loading = std::exchange(is_loading_, mode->second == "loading");
    return was_loading || is_loading_;
  }

  // Which signal says what of the take depends on how far the recorder's thread is: it is no part
  // of a line, and compared with the take afterwards.
  void remember_take(Changes& changes) {
    changes.erase("Model");  // it depends on how far the thread is that measures it
    for (const char* name : {"Take", "TakeGood", "TakeFrames", "TakeDropped", "Writing",
                             "BehindSeconds", "BehindMegabytes"})
      if (const auto found = changes.find(name); found != changes.end()) {
        take_[name].push_back(found->second);
        changes.erase(found);
      }
  }

  void follow() {
    pages_.until_words("2 samples");  // it runs
    for (const Line& line : transcript) {
      SCOPED_TRACE(line.message);
      if (line.button) press(line.button);
      const Changes changes = next_signal();
      EXPECT_EQ(written(changes),
                std::string(line.changes) + (*line.changes ? " " : "") + "Message=" + line.message);
      const std::string message = line.message;
      next_page_with(line.screen ? line.screen : message.substr(message.find(": ") + 2));
    }
  }

  static std::string written(const Changes& changes) {
    std::string text, message;
    for (const auto& [name, value] : changes)
      (name == "Message" ? message : text) += name + "=" + value + (name == "Message" ? "" : " ");
    return text + message;
  }

  // The pages before it are of no interest any more.
  void press(const std::string& button) {
    pages_.skip();
    hand_.press(button);
  }
  Changes next_signal() {
    std::unique_lock lock(mutex_);
    test::await(
        seen_, lock, [&] { return !signals_.empty(); }, [] { return std::string("no signal"); });
    Changes changes = signals_.front();
    signals_.pop_front();
    return changes;
  }
  void next_page_with(const std::string& words) {
    if (words == dark) return;
    if (words == no_words)
      pages_.until([](const OsdPage& page) { return page == OsdPage{}; });
    else
      pages_.until_words(words);
  }

  test::PrivateBus bus_;
  test::Pages pages_;
  bool is_loading_ = true;
  std::deque<Changes> signals_;
  std::map<std::string, std::vector<std::string>> take_;  // of its properties what was signalled
};

TEST_F(RigTranscript, EveryActionIsSignalledShownAndRecorded) {
  for (const set::Action& action : set::actions())
    EXPECT_TRUE(std::ranges::any_of(transcript,
                                    [&](const Line& line) {
                                      return line.button &&
                                             std::string_view(line.button) == action.name;
                                    }))
        << action.name << " is not in the transcript";
  perform();
  EXPECT_TRUE(signals_.empty());

  // The take tells the same, from its first word to its last.
  session::Session take = session::open_session(take_folder());
  std::erase(take_["Take"], "");  // of the sets that were read afterwards, which have none yet
  std::erase(take_["TakeFrames"], "0");
  EXPECT_EQ(take_["Take"], std::vector<std::string>{"12A_take001"});
  EXPECT_TRUE(std::ranges::is_sorted(take_["TakeFrames"], {}, [](const std::string& frames) {
    return std::stoull(frames);
  })) << testing::PrintToString(take_["TakeFrames"]);
  ASSERT_FALSE(take_["TakeFrames"].empty());
  EXPECT_LE(std::stoull(take_["TakeFrames"].back()),
            session::open_stream(take, "observer")->records().size());
  EXPECT_TRUE(take.info.take->good);
  const std::string events = test::content_of(take.directory / "events.jsonl");
  std::size_t at = 0;
  const auto begins =
      std::ranges::find(transcript, std::string_view("Object=sign"), &Line::changes);
  const auto ends = std::ranges::find(transcript, std::string_view("Recording=no"), &Line::changes);
  for (const Line& line : std::span(begins, ends)) {
    const std::size_t found = events.find(line.message, at);
    EXPECT_NE(found, std::string::npos) << line.message << " is not in order in\n" << events;
    if (found != std::string::npos) at = found;
  }
}

}  // namespace previz::rig::transcript_test
