// A rig that records while everything happens to it at once: presses of every button, calls on the
// bus and restarts of it, new sets, good and bad, cameras that are unplugged, fall silent or
// deliver damage, and exceptions in every stage. PREVIZ_STORM_S says for how many seconds; 8
// without it.
#include <gtest/gtest.h>
#include <systemd/sd-bus.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "daemon/control/bus.hpp"
#include "daemon/set/actions.hpp"
#include "drivers/session/files.hpp"
#include "tests/support/live_rig.hpp"
#include "tests/support/other_camera.hpp"
#include "tests/support/private_bus.hpp"

namespace previz::rig {
namespace storm_test {

namespace fs = std::filesystem;

// Random choices for any thread; which ones fall together is up to the threads anyway.
class Dice {
 public:
  std::size_t below(std::size_t count) {
    thread_local std::mt19937 engine(++seeds_);
    return engine() % count;
  }
  bool one_in(std::size_t count) { return below(count) == 0; }
  void rest(std::size_t most_ms) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1 + below(most_ms)));
  }

 private:
  std::atomic<unsigned> seeds_ = 0;
};

// A member of the bus, who asks for anything.
class Member {
 public:
  ~Member() { sd_bus_flush_close_unref(bus_); }

  void ask(Dice& dice) {
    if (!bus_ && sd_bus_open_system(&bus_) < 0) return;
    const set::Action& action = set::actions()[dice.below(set::actions().size())];
    int result = 0;
    switch (dice.below(5)) {
      case 0:
        result = call("Action", "s", action.name);
        break;
      case 1:
        result = call("SetMode", "s", dice.one_in(2) ? "review" : "live");
        break;
      case 2:
        result = call("Record", "b", dice.one_in(3) ? 0 : 1);
        break;
      case 3:
        result = call("Metrics", "");
        break;
      default:
        result = call(control::method_name(action.name).c_str(), "");
    }
    if (result >= 0) ++answers_;
    if (sd_bus_is_open(bus_) <= 0) bus_ = sd_bus_flush_close_unref(bus_);
  }
  int answers() const { return answers_; }

 private:
  template <class... Arguments>
  int call(const char* method, const char* types, Arguments... arguments) {
    sd_bus_message* reply = nullptr;
    const int result =
        sd_bus_call_method(bus_, control::bus_name, control::object_path, control::interface_name,
                           method, nullptr, &reply, types, arguments...);
    sd_bus_message_unref(reply);
    return result;
  }

  sd_bus* bus_ = nullptr;
  int answers_ = 0;
};

class Storm : public test::RigLive {
 protected:
  // Writes the set anew, as an editor does. One in four is wrong.
  void edit_set() {
    std::string text = text_;
    if (dice_.one_in(4)) text += "[[object]]\nname = 3\n";
    if (dice_.one_in(2)) text += "[[surface]]\nmaterial = \"paper\"\nalbedo = [0.1, 0.2, 0.3]\n";
    std::ofstream(directory_ / "edited") << text;
    fs::rename(directory_ / "edited", directory_ / "set.toml");
  }

  void write_stormy_set() {
    write_set("composite = true\n[display]\ndriver = \"headless\"\nmode = \"480x270\"\n");
    text_ = session::read_file(directory_ / "set.toml");
    const std::string camera = "driver = \"replay\"\ndevice = \"session\"\n";
    const std::string faults =
        "faults = [\"disconnect@40+0.5s\", \"drop@70+3\", \"corrupt@90\", \"late@110+4\", "
        "\"disconnect@130+1.5s\"]\n";
    text_.replace(text_.find(camera), camera.size(), camera + faults);
    std::ofstream(directory_ / "set.toml") << text_;
    std::ofstream(directory_ / "other.toml") << text_;
  }

  void make_faulty() {
    options_.rehearse = [this](const std::string& part) {
      if (blows_ && dice_.one_in(300)) throw std::runtime_error("lightning in " + part);
    };
    options_.around_cameras = [this](Cameras& cameras) {
      for (std::unique_ptr<Camera>* camera : {&cameras.observer, &cameras.light})
        test::put_around(*camera, [this](CameraEvent event, Camera&) {
          if (blows_ && dice_.one_in(200)) throw std::runtime_error("lightning in a cable");
          return event;
        });
    };
  }

  // Lets each of these happen again and again, on a thread of its own, until the storm is over.
  void blow(std::chrono::seconds time, const std::vector<std::function<void()>>& gusts) {
    blows_ = true;
    std::vector<std::jthread> threads;
    for (const auto& gust : gusts)
      threads.emplace_back([&](const std::stop_token& over) {
        while (!over.stop_requested()) gust();
      });
    std::this_thread::sleep_for(time);
    blows_ = false;
  }

  Dice dice_;
  std::string text_;
  std::atomic<bool> blows_ = false;
};

std::chrono::seconds storm_time() {
  const char* seconds = std::getenv("PREVIZ_STORM_S");
  return std::chrono::seconds(seconds ? std::atoi(seconds) : 8);
}

// A take is whole up to its end, and says what is missing in between.
void expect_whole(const fs::path& take) {
  SCOPED_TRACE(take);
  session::Session session = session::open_session(take);
  for (const char* source : {"observer", "light", "composite"}) {
    const auto stream = session::open_stream(session, source);
    for (std::size_t i = 0; stream && i < stream->records().size(); ++i)
      EXPECT_NO_THROW(stream->read(i));
  }
  for (const std::string& missing : session.missing)
    EXPECT_NE(missing.find("did not reach the disk in time"), std::string::npos) << missing;
}

TEST_F(Storm, TheRigOutlivesItAndEveryTakeIsWhole) {
  test::PrivateBus bus;
  if (!bus.running()) GTEST_SKIP() << "dbus-daemon is not installed";
  write_stormy_set();
  make_faulty();
  options_.bus = true;
  Member member;
  run([&] {
    until([](const Shown& s) { return s.shot.samples == 2; });
    blow(storm_time(), {[&] {
                          press(set::actions()[dice_.below(set::actions().size())].name);
                          if (dice_.one_in(8)) press("record");
                          dice_.rest(60);
                        },
                        [&] {
                          member.ask(dice_);
                          dice_.rest(30);
                        },
                        [&] {
                          edit_set();
                          dice_.rest(700);
                        },
                        [&] {
                          dice_.rest(3000);
                          bus.stop();
                          dice_.rest(300);
                          bus.start();
                        }});
    // The sky clears: the rig shows pictures again.
    std::ofstream(directory_ / "set.toml") << text_;
    const int before = until([](const Shown&) { return true; }).count;
    test::must_come("pictures are shown again", [&] {
      press("live");
      std::this_thread::sleep_for(std::chrono::milliseconds(500));
      const std::lock_guard lock(mutex_);
      return shown_.count > before + 10;
    });
  });
  EXPECT_EQ(test::accounted_for(metrics_), metrics_.stages.at("observer").frames);
  EXPECT_GT(member.answers(), 0);
  std::size_t takes = 0;
  for (const auto& take : fs::directory_iterator(directory_ / "takes"))
    if (take.is_directory() && fs::exists(take.path() / "session.toml")) {
      expect_whole(take.path());
      ++takes;
    }
  EXPECT_GT(takes, 0u);
  std::printf("%zu takes, %d answers on the bus\n", takes, member.answers());
}

}  // namespace storm_test
}  // namespace previz::rig
