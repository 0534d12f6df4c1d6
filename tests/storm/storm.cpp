#include "tests/storm/storm.hpp"

#include <systemd/sd-bus.h>

#include "daemon/control/bus.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/set/actions.hpp"
#include "tests/devices/private_network.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/other_camera.hpp"

namespace previz::rig::storm_test {
namespace {

namespace fs = std::filesystem;

// A member of the bus, who asks for anything.
class Member {
 public:
  ~Member() { sd_bus_flush_close_unref(bus_); }

  // Returns whether there was an answer.
  bool ask(Dice& dice) {
    if (!bus_ && sd_bus_open_system(&bus_) < 0) return false;
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
    if (sd_bus_is_open(bus_) <= 0) bus_ = sd_bus_flush_close_unref(bus_);
    return result >= 0;
  }

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
};

std::chrono::seconds storm_time() {
  const char* seconds = std::getenv("PREVIZ_STORM_S");
  return std::chrono::seconds(seconds ? std::atoi(seconds) : 20);
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
    EXPECT_THAT(missing, HasSubstr("did not reach the disk in time"));
}

std::size_t count_whole_takes(const fs::path& takes) {
  std::size_t count = 0;
  for (const auto& take : fs::directory_iterator(takes))
    if (take.is_directory() && fs::exists(take.path() / "session.toml")) {
      expect_whole(take.path());
      ++count;
    }
  return count;
}

}  // namespace

void Dice::rest(std::size_t most_ms) {
  std::this_thread::sleep_for(std::chrono::milliseconds(1 + below(most_ms)));
}

void Storm::SetUpTestSuite() {
  (void)test::enter_private_network();  // where it may not, it asks for what it needs itself
}

void Storm::write_stormy_set() {
  write_set("composite = true\n[display]\ndriver = \"headless\"\nmode = \"480x270\"\n");
  text_ = test::content_of(directory_ / "set.toml");
  const std::string camera = "driver = \"replay\"\ndevice = \"session\"\n";
  replace(camera, camera +
                      "faults = [\"disconnect@40+0.5s\", \"drop@70+3\", \"corrupt@90\", "
                      "\"late@110+4\", \"disconnect@130+1.5s\"]\n");
}

void Storm::replace(const std::string& old, const std::string& by) {
  text_.replace(text_.find(old), old.size(), by);
  for (const char* name : {"set.toml", "other.toml"}) std::ofstream(directory_ / name) << text_;
}

void Storm::push(const std::string& action) {
  press(contact_ + action);
  ++tally_.presses;
}

// Writes the set anew, as an editor does. One in four is wrong.
void Storm::edit_set() {
  std::string text = text_;
  if (dice_.one_in(4)) {
    text += "[[object]]\nname = 3\n";
    ++tally_.wrong_sets;
  }
  if (dice_.one_in(2)) text += "[[surface]]\nmaterial = \"paper\"\nalbedo = [0.1, 0.2, 0.3]\n";
  std::ofstream(directory_ / "edited") << text;
  fs::rename(directory_ / "edited", directory_ / "set.toml");
  ++tally_.sets;
}

void Storm::throw_in_every_stage() {
  const auto lightning = [this](std::size_t one_in, const std::string& where) {
    if (!blows_ || !dice_.one_in(one_in)) return;
    ++tally_.exceptions;
    throw std::runtime_error("lightning in " + where);
  };
  options_.rehearse = [lightning](const std::string& part) { lightning(300, part); };
  options_.around_cameras = [lightning](live::Cameras& cameras) {
    for (std::unique_ptr<Camera>* camera : {&cameras.observer, &cameras.light})
      test::put_around(*camera, [lightning](CameraEvent event, Camera&) {
        lightning(200, "a cable");
        return event;
      });
  };
}

std::vector<Gust> Storm::everyday(test::PrivateBus& bus) {
  return {[this] {
            push(set::actions()[dice_.below(set::actions().size())].name);
            if (dice_.one_in(8)) push("record");
            dice_.rest(60);
          },
          [this, member = std::make_shared<Member>()] {
            if (member->ask(dice_)) ++tally_.answers;
            dice_.rest(30);
          },
          [this] {
            edit_set();
            dice_.rest(most_ms_between_sets_);
          },
          [this, &bus] {
            dice_.rest(3000);
            bus.stop();
            dice_.rest(300);
            bus.start();
            ++tally_.buses;
          }};
}

// Lets each of these happen again and again, on a thread of its own, until the storm is over.
void Storm::blow(const std::vector<Gust>& gusts) {
  blows_ = true;
  {
    std::vector<std::jthread> threads;
    for (const Gust& gust : gusts)
      threads.emplace_back([&gust](const std::stop_token& over) {
        while (!over.stop_requested()) gust();
      });
    std::this_thread::sleep_for(storm_time());
  }
  blows_ = false;
}

// The sky clears: the rig shows pictures again.
void Storm::clear_up() {
  std::ofstream(directory_ / "set.toml") << text_;
  const int before = shown_now().count;
  test::must_come("pictures are shown again", [&] {
    push("live");
    std::this_thread::sleep_for(std::chrono::milliseconds(500));  // two presses a second
    const std::lock_guard lock(mutex_);
    return shown_.count > before + 10;
  });
}

void Storm::print() const {
  std::printf(
      "%d presses, %d answers on the bus, %d starts of the bus, %d sets (%d of them wrong), %d "
      "exceptions, %d unplugs of the network's camera, %d receivers ended or stopped, %d foreign "
      "packets\n",
      tally_.presses.load(), tally_.answers.load(), tally_.buses.load(), tally_.sets.load(),
      tally_.wrong_sets.load(), tally_.exceptions.load(), tally_.unplugs.load(),
      tally_.receivers.load(), tally_.packets.load());
  for (const auto& [name, stage] : metrics_.stages) {
    std::printf("%s: %llu frames\n", name.c_str(), static_cast<unsigned long long>(stage.frames));
    for (const auto& [cause, frames] : stage.dropped)
      std::printf("  %llu dropped (%s)\n", static_cast<unsigned long long>(frames), cause.c_str());
  }
}

void Storm::weather(const std::vector<Gust>& gusts) {
  test::PrivateBus bus;
  if (!bus.running()) GTEST_SKIP() << "dbus-daemon is not installed";
  throw_in_every_stage();
  options_.bus = true;
  run_rendering([&] {
    std::vector<Gust> all = everyday(bus);
    all.insert(all.end(), gusts.begin(), gusts.end());
    blow(all);
    clear_up();
  });
  EXPECT_EQ(test::accounted_for(metrics_), metrics_.stages.at("observer").frames);
  EXPECT_GT(tally_.answers, 0);
  EXPECT_GT(tally_.exceptions, 0);
  const std::size_t takes = count_whole_takes(directory_ / "takes");
  EXPECT_GT(takes, 0u);
  std::printf("%zu takes, all of them read to the end; ", takes);
  print();
}

}  // namespace previz::rig::storm_test
