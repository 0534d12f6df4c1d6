// The rig's bus on a bus of its own, operated by previzctl as from a shell.
#include "daemon/control/bus.hpp"

#include <grp.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <systemd/sd-bus.h>
#include <systemd/sd-event.h>

#include <future>

#include "daemon/control/callers.hpp"
#include "daemon/control/status_words.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/private_bus.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::control::bus_test {

struct Said {
  std::string out;
  int status = 0;
};
Said previzctl(const std::string& arguments) {
  Said said;
  FILE* pipe =
      popen((PREVIZ_BINARY_DIR "/daemon/control/previzctl " + arguments + " 2>&1").c_str(), "r");
  std::array<char, 256> line{};
  while (fgets(line.data(), line.size(), pipe)) said.out += line.data();
  said.status = WEXITSTATUS(pclose(pipe));
  return said;
}

class RigOnTheBus : public testing::Test {
 protected:
  explicit RigOnTheBus(const std::filesystem::path& policy = {}) : bus_(policy) {}
  void SetUp() override {
    if (!bus_.running()) GTEST_SKIP() << "dbus-daemon is not installed";
    sd_event_new(&event_);
    Verbs verbs;
    verbs.perform = [this](const set::Action& action, const std::string& who,
                           const Verbs::Reply& reply) {
      who_ = who;
      fall_if(fallen_ == "perform");
      status_.message = action.name;
      rig_->changed();
      if (answers_later_ && action.name == std::string("snapshot")) {
        reply_ = reply;
        return;
      }
      if (const Verbs::Reply later = std::exchange(reply_, {})) later({"a.exr"});
      reply({action.name, std::string(action.name) == "standby"});
    };
    verbs.go = [this](set::Mode mode, const std::string&) {
      status_.mode = mode == set::Mode::refine ? "refine" : "live";
      return Answer{status_.mode};
    };
    verbs.record = [this](bool on, const std::string&) {
      status_.recording = on;
      return Answer{on ? "recording" : "recording ended"};
    };
    verbs.status = [this] {
      fall_if(fallen_ == "status");
      return status_;
    };
    verbs.denied = [this](const std::string& who, const std::string& verb) {
      denied_.push_back(who + ": " + verb);
    };
    verbs.metrics = [this] {
      fall_if(fallen_ == "metrics");
      return std::string("{}");
    };
    rig_ = std::make_unique<Bus>(event_, std::move(verbs));
    loop_ = std::thread([this] {
      while (!quit_) sd_event_run(event_, 10'000);
    });
  }
  void TearDown() override { stop(); }
  void stop() {
    if (!loop_.joinable()) return;
    quit_ = true;
    loop_.join();
    rig_.reset();
    sd_event_unref(event_);
  }

  test::PrivateBus bus_;
  sd_event* event_ = nullptr;
  static Status first_status() {
    Status status;
    status.mode = "live";
    status.writing = true;  // recording ended, and the disk is slow
    status.take = "12A_take003";
    status.take_frames = 120;
    status.samples = 16;
    status.set = "desk";
    return status;
  }
  static void fall_if(bool falls) {
    if (falls) throw std::runtime_error("lamp fell down");
  }
  std::string fallen_;          // the verb that throws
  std::string who_;             // called last
  bool answers_later_ = false;  // a snapshot
  Verbs::Reply reply_;          // that somebody waits for
  std::vector<std::string> denied_;
  Status status_ = first_status();
  std::unique_ptr<Bus> rig_;
  std::atomic<bool> quit_ = false;
  std::thread loop_;
};

TEST(MethodName, IsTheActionInCamelCase) {
  EXPECT_EQ(method_name("record"), "Record");
  EXPECT_EQ(method_name("move_left"), "MoveLeft");
}

TEST_F(RigOnTheBus, PrevizctlOperatesIt) {
  const Said status = previzctl("status --raw");
  EXPECT_EQ(status.status, 0) << status.out;
  for (const char* line :
       {"Mode: live\n", "Recording: no\n", "Writing: yes\n", "Take: 12A_take003\n",
        "TakeFrames: 120\n", "Samples: 16\n", "Set: desk\n"})
    EXPECT_THAT(status.out, HasSubstr(line));
  EXPECT_EQ(previzctl("status").out,
            "mode: live\nset: desk\npicture: none shown yet, 16 samples per pixel\n"
            "take: 12A_take003, 120 frames, still being written\n");
  EXPECT_EQ(previzctl("mode refine").out, "refine\n");
  EXPECT_EQ(previzctl("record on").out, "recording\n");
  EXPECT_THAT(previzctl("status").out, HasSubstr("mode: refine, recording\n"));
  EXPECT_EQ(previzctl("action move_left").out, "move_left\n");
  EXPECT_EQ(previzctl("set next").out, "next_set\n");
  EXPECT_EQ(previzctl("metrics").out, "{}\n");
}

// The rig goes on while somebody waits for an answer, and answers him when it has one.
TEST_F(RigOnTheBus, AnAnswerMayComeLater) {
  answers_later_ = true;
  std::future<Said> later = std::async(std::launch::async, previzctl, "action snapshot");
  EXPECT_TRUE(test::wait_until("it is asked", [&] {
    return previzctl("status").out.find("last message: snapshot") != std::string::npos;
  }));
  EXPECT_EQ(later.wait_for(std::chrono::seconds(0)), std::future_status::timeout);
  EXPECT_EQ(previzctl("action move_left").out, "move_left\n");
  EXPECT_EQ(later.get().out, "a.exr\n");
}

TEST_F(RigOnTheBus, AnAnswerMayComeWhenTheBusHasEnded) {
  answers_later_ = true;
  std::future<Said> asked = std::async(std::launch::async, previzctl, "action snapshot");
  EXPECT_TRUE(test::wait_until("it is asked", [&] {
    return previzctl("status").out.find("last message: snapshot") != std::string::npos;
  }));
  stop();
  reply_({"a.exr"});
  reply_ = {};
  EXPECT_NE(asked.get().status, 0);
}

// Its set changes, and with it the loop and the verbs; who calls in between is answered afterwards.
TEST_F(RigOnTheBus, StaysThereWhenAnotherLoopServesIt) {
  quit_ = true;
  loop_.join();
  std::future<Said> said = std::async(std::launch::async, previzctl, "status");
  sd_event_exit(event_, 0);
  while (sd_event_get_state(event_) != SD_EVENT_FINISHED) sd_event_run(event_, 10'000);
  sd_event_unref(event_);
  sd_event_new(&event_);
  Verbs verbs;
  verbs.status = [] {
    Status status;
    status.mode = "loading";
    status.loading_s = 5;
    return status;
  };
  rig_->serve(event_, verbs);
  quit_ = false;
  loop_ = std::thread([this] {
    while (!quit_) sd_event_run(event_, 10'000);
  });
  EXPECT_THAT(said.get().out, HasSubstr("mode: loading a set (since 5.0 s)\n"));
}

TEST(StatusWords, SayWhatMattersAndNothingElse) {
  const std::vector<std::string> words = status_words({{"Mode", "live"},
                                                       {"Recording", "no"},
                                                       {"Writing", "no"},
                                                       {"Take", "1A_take002"},
                                                       {"TakeGood", "yes"},
                                                       {"TakeSeconds", "4.8"},
                                                       {"TakeFrames", "120"},
                                                       {"TakeDropped", "56"},
                                                       {"BehindSeconds", "0.0"},
                                                       {"BehindMegabytes", "0"},
                                                       {"Fault", ""},
                                                       {"CameraLost", "no"},
                                                       {"Samples", "1"},
                                                       {"Set", "demo"},
                                                       {"Object", "vase"},
                                                       {"Light", ""},
                                                       {"Device", "llvmpipe (CPU)"},
                                                       {"Model", "model 0.3 px (90 % 0.8)"},
                                                       {"Message", "button red: recording ended"},
                                                       {"PictureSeconds", "0.4"},
                                                       {"LoadingSeconds", "0.0"}});
  EXPECT_EQ(words, (std::vector<std::string>{
                       "mode: live", "set: demo", "drawn by: llvmpipe (CPU)",
                       "picture: shown 0.4 s ago, 1 sample per pixel",
                       "take: 1A_take002, good, 4.8 s, 120 frames, 56 frames dropped",
                       "selected: object vase", "model: 0.3 px (90 % 0.8)",
                       "last message: button red: recording ended"}));
  EXPECT_EQ(status_words({{"Mode", "loading"}, {"LoadingSeconds", "13.2"}}),
            (std::vector<std::string>{"mode: loading a set (since 13.2 s)", "take: none yet"}));
  EXPECT_EQ(status_words({{"Take", "1A_take002"},
                          {"Writing", "yes"},
                          {"BehindSeconds", "1.6"},
                          {"BehindMegabytes", "40"},
                          {"Fault", "disk full"},
                          {"Set", "demo"},
                          {"SetProblem", "demo.toml:4:1: set.nme: unknown key"},
                          {"CameraLost", "yes"}}),
            (std::vector<std::string>{
                "set: demo",
                "the set that was asked for is not in use: demo.toml:4:1: set.nme: unknown key",
                "film camera: lost, no picture comes",
                "take: 1A_take002, still being written, 1.6 s behind the cameras, 40 MB in memory",
                "the last take ended by itself: disk full"}));
}

TEST_F(RigOnTheBus, WhatIsRefusedOrUnknownIsSaidAndFails) {
  const Said refused = previzctl("action standby");
  EXPECT_EQ(refused.status, 1);
  EXPECT_EQ(refused.out, "previzctl: standby\n");
  const Said unknown = previzctl("action make_coffee");
  EXPECT_EQ(unknown.status, 1);
  EXPECT_THAT(unknown.out, HasSubstr("\"make_coffee\""));
  EXPECT_EQ(previzctl("mode faster").status, 2);
}

// An exception that passes through sd-bus, which is C, is undefined behaviour, and mostly the end.
TEST_F(RigOnTheBus, WhatAVerbThrowsIsAnErrorInReplyAndTheRigGoesOn) {
  for (const auto& [verb, call] :
       {std::pair("perform", "action move_left"), {"metrics", "metrics"}, {"status", "status"}}) {
    fallen_ = verb;
    const Said said = previzctl(call);
    EXPECT_EQ(said.status, 1) << said.out;
    EXPECT_THAT(said.out, HasSubstr("lamp fell down"));
    fallen_.clear();
    EXPECT_EQ(previzctl("action move_left").out, "move_left\n");
  }
}

// The bus disconnects whoever sends anything else.
TEST_F(RigOnTheBus, WhatIsNotUtf8OrNoCharacterIsSentWithoutIt) {
  status_.set = "d\xc3\xa4sk \xff\xc3";
  EXPECT_THAT(previzctl("status").out, HasSubstr("set: d\xc3\xa4sk ??\n"));
  status_.set = "\xed\xa0\x80 \xf4\x90\x80\x80 \xc0\xaf \xf0\x9f\x8e\xac";
  EXPECT_THAT(previzctl("status").out, HasSubstr("set: ??? ???? ?? \xf0\x9f\x8e\xac\n"));
  // The last of a plane, the first of those in Arabic's block, and characters beside them.
  status_.set = "\xf0\xbf\xbf\xbf \xef\xbf\xbe \xef\xb7\x90 \xef\xbf\xbd \xef\xb7\xb0";
  EXPECT_THAT(previzctl("status").out, HasSubstr("set: ???? ??? ??? \xef\xbf\xbd \xef\xb7\xb0\n"));
}

// Every action of the table has its own method, and a change its signal.
TEST_F(RigOnTheBus, EveryActionIsAMethodAndEveryChangeASignal) {
  sd_bus* client = nullptr;
  ASSERT_GE(sd_bus_open_system(&client), 0);
  int signals = 0;
  ASSERT_GE(sd_bus_match_signal(
                client, nullptr, bus_name, object_path, "org.freedesktop.DBus.Properties",
                "PropertiesChanged",
                [](sd_bus_message*, void* count, sd_bus_error*) {
                  return ++*static_cast<int*>(count), 0;
                },
                &signals),
            0);
  int calls = 0;
  for (const set::Action& action : set::actions()) {
    const std::string method = method_name(action.name);
    if (method == "Record" || method == "Standby") continue;  // takes on or off; refused here
    sd_bus_error error = SD_BUS_ERROR_NULL;
    EXPECT_GE(sd_bus_call_method(client, bus_name, object_path, interface_name, method.c_str(),
                                 &error, nullptr, ""),
              0)
        << method << ": " << error.message;
    sd_bus_error_free(&error);
    ++calls;
  }
  while (signals < calls && sd_bus_wait(client, 1'000'000) >= 0)
    while (sd_bus_process(client, nullptr) > 0) continue;
  EXPECT_EQ(signals, calls);
  sd_bus_flush_close_unref(client);
}

// The policy that the package ships, for groups that there are on any machine instead of previz and
// previz-view, and for a polkit of nobody's.
class PolicyFile {
 protected:
  PolicyFile() {
    std::string text = test::content_of(PREVIZ_SOURCE_DIR "/systemd/org.previz.Rig1.conf");
    replace(text, "group=\"previz\"", std::string("group=\"") + crew + '"');
    replace(text, "group=\"previz-view\"", std::string("group=\"") + viewers + '"');
    replace(text, "</busconfig>",
            "<policy user=\"nobody\"><allow own=\"org.freedesktop.PolicyKit1\"/></policy><policy "
            "user=\"root\"><allow send_destination=\"org.freedesktop.PolicyKit1\"/></policy>"
            "</busconfig>");
    std::ofstream(policy_) << text;
  }
  static void replace(std::string& text, const std::string& what, const std::string& with) {
    text.replace(text.find(what), what.size(), with);
  }
  static constexpr const char *crew = "games", *viewers = "news";
  const test::TemporaryDirectory folder_;
  const std::filesystem::path policy_ = folder_ / "org.previz.Rig1.conf";
};

// Lets everybody do one thing, as polkit does by its rules; where that is "", it never answers.
class Polkit {
 public:
  explicit Polkit(std::string allowed) : allowed_(std::move(allowed)) {
    static const sd_bus_vtable methods[] = {
        SD_BUS_VTABLE_START(0),
        SD_BUS_METHOD("CheckAuthorization", "(sa{sv})sa{ss}us", "(bba{ss})", answer,
                      SD_BUS_VTABLE_UNPRIVILEGED),
        SD_BUS_VTABLE_END};
    // The user of this thread alone is another one, and the bus asks the kernel for it.
    constexpr uid_t root = 0, nobody = 65534, same = static_cast<uid_t>(-1);
    ::syscall(SYS_setresuid, same, nobody, same);
    sd_bus_open_system(&bus_);
    ::syscall(SYS_setresuid, same, root, same);
    sd_bus_add_object_vtable(bus_, nullptr, "/org/freedesktop/PolicyKit1/Authority",
                             "org.freedesktop.PolicyKit1.Authority", methods, this);
    sd_bus_request_name(bus_, "org.freedesktop.PolicyKit1", 0);
    thread_ = std::jthread([this](const std::stop_token& stop) {
      while (!stop.stop_requested())
        if (sd_bus_process(bus_, nullptr) == 0) sd_bus_wait(bus_, 10'000);
    });
  }
  ~Polkit() {
    thread_ = {};
    sd_bus_flush(bus_);
    ::shutdown(sd_bus_get_fd(bus_), SHUT_RDWR);  // callers that were forked meanwhile have it too
    sd_bus_close_unref(bus_);
  }
  Polkit(const Polkit&) = delete;
  Polkit& operator=(const Polkit&) = delete;

 private:
  static int answer(sd_bus_message* call, void* polkit, sd_bus_error*) {
    const char *kind = "", *key = "", *sender = "", *action = "", *detail = "", *verb = "";
    sd_bus_message_read(call, "(sa{sv})s", &kind, 1, &key, "s", &sender, &action);
    sd_bus_message_read(call, "a{ss}", 1, &detail, &verb);
    const bool is_sound = kind == std::string("system-bus-name") && key == std::string("name") &&
                          *sender == ':' && action == std::string(operate_action) &&
                          detail == std::string("verb");
    if (static_cast<Polkit*>(polkit)->allowed_.empty()) return 1;
    const bool is_allowed = is_sound && verb == static_cast<Polkit*>(polkit)->allowed_;
    return sd_bus_reply_method_return(call, "(bba{ss})", int{is_allowed}, 0, 0);
  }

  const std::string allowed_;
  sd_bus* bus_ = nullptr;
  std::jthread thread_;
};

// A bus that keeps to the policy. The rig is root; callers are root, a user of no group, and the
// same as a member of one of the groups.
class ShippedPolicy : private PolicyFile, public RigOnTheBus {
 protected:
  enum class Caller { root, nobody, viewer, member };

  ShippedPolicy() : RigOnTheBus(policy_) {}
  void SetUp() override {
    if (geteuid() != 0) GTEST_SKIP() << "only root can be another user";
    RigOnTheBus::SetUp();
  }

  static bool become(Caller caller) {
    constexpr uid_t nobody = 65534;
    const ::group* members = getgrnam(caller == Caller::viewer ? viewers : crew);
    const gid_t groups[] = {members ? members->gr_gid : nobody};
    const std::size_t count = caller == Caller::nobody ? 0 : 1;
    return caller == Caller::root ||
           (setgroups(count, groups) == 0 && setgid(nobody) == 0 && setuid(nobody) == 0);
  }

  // The name of the error that a call is answered with; empty where there is none. The policy is
  // asked before anybody looks at the arguments, so that calls without them will do.
  using Call = std::function<void(sd_bus*, sd_bus_error*)>;
  static std::string error_of(Caller caller, const Call& call) {
    int answer[2];
    if (pipe(answer) != 0) return "no pipe";
    const pid_t child = fork();
    if (child == 0) {
      std::string said = "the caller cannot be another user";
      if (become(caller)) {
        sd_bus* bus = nullptr;
        sd_bus_error error{};
        said = sd_bus_open_system(&bus) < 0 ? "the bus cannot be reached" : "";
        if (bus) call(bus, &error);
        if (error.name) said = error.name;
      }
      const ssize_t written = write(answer[1], said.data(), said.size());
      _exit(written == static_cast<ssize_t>(said.size()) ? 0 : 1);
    }
    close(answer[1]);
    std::array<char, 256> text{};
    const ssize_t size = read(answer[0], text.data(), text.size());
    close(answer[0]);
    waitpid(child, nullptr, 0);
    return {text.data(), static_cast<std::size_t>(std::max<ssize_t>(size, 0))};
  }
  static std::string error_of(Caller caller, const char* interface, const std::string& method) {
    return error_of(caller, [&](sd_bus* bus, sd_bus_error* error) {
      sd_bus_call_method(bus, bus_name, object_path, interface, method.c_str(), error, nullptr,
                         nullptr);
    });
  }
};

TEST_F(ShippedPolicy, BothGroupsAndRootMayCallTheRigAndNobodyElse) {
  std::vector<std::string> methods{"Action", "SetMode", "Record", "Metrics", "Actions"};
  for (const set::Action& action : set::actions()) methods.push_back(method_name(action.name));
  // Without arguments that it takes, a call is wrong before anybody asks who calls.
  const Polkit polkit("any");
  for (const std::string& method : methods)
    EXPECT_EQ(error_of(Caller::nobody, interface_name, method), SD_BUS_ERROR_ACCESS_DENIED)
        << method;
  for (const char* method : {"Action", "SetMode", "Record"})
    for (const Caller caller : {Caller::root, Caller::member, Caller::viewer})
      EXPECT_EQ(error_of(caller, interface_name, method), SD_BUS_ERROR_INVALID_ARGS) << method;
  constexpr const char* properties = "org.freedesktop.DBus.Properties";
  EXPECT_EQ(error_of(Caller::nobody, properties, "Set"), SD_BUS_ERROR_ACCESS_DENIED);
  for (const char* method : {"Get", "GetAll"}) {  // for which the arguments are missing
    EXPECT_EQ(error_of(Caller::nobody, properties, method), SD_BUS_ERROR_ACCESS_DENIED) << method;
    for (const Caller caller : {Caller::viewer, Caller::member, Caller::root})
      EXPECT_EQ(error_of(caller, properties, method), SD_BUS_ERROR_INVALID_ARGS) << method;
  }
  for (const Caller caller : {Caller::viewer, Caller::member, Caller::root})
    EXPECT_EQ(error_of(caller, interface_name, "Metrics"), "");
}

// Rules of a department can tell one thing that the rig does from another.
TEST_F(ShippedPolicy, WhatACallerMayDoPolkitSays) {
  const Polkit polkit("mark");
  for (const Caller caller : {Caller::viewer, Caller::member}) {
    EXPECT_EQ(error_of(caller, interface_name, "MoveLeft"), "org.previz.Error.Denied");
    EXPECT_EQ(error_of(caller,
                       [](sd_bus* bus, sd_bus_error* error) {
                         sd_bus_call_method(bus, bus_name, object_path, interface_name, "Record",
                                            error, nullptr, "b", 1);
                       }),
              "org.previz.Error.Denied");
    EXPECT_EQ(who_, "");
  }
  EXPECT_EQ(error_of(Caller::viewer, interface_name, "Mark"), "");
  EXPECT_EQ(who_, "nobody");
  EXPECT_EQ(error_of(Caller::root, interface_name, "MoveLeft"), "");
  EXPECT_EQ(who_, "root");
  EXPECT_EQ(denied_, (std::vector<std::string>{"nobody: move_left", "nobody: record",
                                               "nobody: move_left", "nobody: record"}));
}

TEST_F(ShippedPolicy, WithoutPolkitOnlyRootMayOperateAndTheOthersAreToldWhy) {
  EXPECT_EQ(error_of(Caller::member, interface_name, "MoveLeft"), "org.previz.Error.Denied");
  EXPECT_EQ(error_of(Caller::root, interface_name, "MoveLeft"), "");
  EXPECT_EQ(error_of(Caller::member, interface_name, "Metrics"), "");
}

TEST_F(ShippedPolicy, WhatIsAskedOfAPolkitThatDiesIsNotDone) {
  auto polkit = std::make_unique<Polkit>("");
  std::future<std::string> member = std::async(
      std::launch::async, [&] { return error_of(Caller::member, interface_name, "MoveLeft"); });
  EXPECT_EQ(member.wait_for(std::chrono::milliseconds(300)), std::future_status::timeout);
  polkit.reset();
  EXPECT_EQ(member.get(), "org.previz.Error.Denied");
  EXPECT_EQ(who_, "");
}

// The rig answers others meanwhile, and says to the one who asks so much that it is busy.
TEST_F(ShippedPolicy, CallsThatWaitForPolkitHoldUpNobodyAndAreFew) {
  const Polkit polkit("");
  const Call flood = [](sd_bus* bus, sd_bus_error* error) {
    const auto keep = [](sd_bus_message* answer, void* errors, sd_bus_error*) {
      if (const sd_bus_error* why = sd_bus_message_get_error(answer))
        static_cast<std::vector<std::string>*>(errors)->emplace_back(why->name);
      return 0;
    };
    std::vector<std::string> errors;
    for (int i = 0; i < 80; ++i)
      sd_bus_call_method_async(bus, nullptr, bus_name, object_path, interface_name, "MoveLeft",
                               keep, &errors, nullptr);
    for (int i = 0; errors.size() < 64 && i < 200; ++i)
      if (sd_bus_process(bus, nullptr) == 0) sd_bus_wait(bus, 10'000);
    if (std::ranges::count(errors, SD_BUS_ERROR_LIMITS_EXCEEDED) != 64)
      sd_bus_error_set_const(error, "others.are.refused", "");
  };
  std::future<std::string> member =
      std::async(std::launch::async, [&] { return error_of(Caller::member, flood); });
  do {
    EXPECT_EQ(error_of(Caller::root, interface_name, "MoveLeft"), "");
  } while (member.wait_for(std::chrono::milliseconds(20)) != std::future_status::ready);
  EXPECT_EQ(member.get(), "");
}

// Signals tell of the take and of who did something.
TEST_F(ShippedPolicy, OnlyThoseWhoMayLookHearWhatChanges) {
  for (const auto& [caller, hears] : {std::pair(Caller::nobody, false), {Caller::viewer, true}}) {
    int is_ready[2];
    ASSERT_EQ(pipe(is_ready), 0);
    const Call listen = [&](sd_bus* bus, sd_bus_error* error) {
      bool has_heard = false;
      sd_bus_match_signal(
          bus, nullptr, bus_name, object_path, nullptr, nullptr,
          [](sd_bus_message*, void* heard, sd_bus_error*) {
            return *static_cast<bool*>(heard) = true, 0;
          },
          &has_heard);
      const char is_listening = 1;
      if (write(is_ready[1], &is_listening, 1) != 1) return;
      for (int i = 0; !has_heard && i < 30; ++i)
        if (sd_bus_process(bus, nullptr) == 0) sd_bus_wait(bus, 10'000);
      if (has_heard) sd_bus_error_set_const(error, "it.heard", "");
    };
    std::future<std::string> listener =
        std::async(std::launch::async, [&, who = caller] { return error_of(who, listen); });
    char is_listening = 0;
    ASSERT_EQ(read(is_ready[0], &is_listening, 1), 1);
    EXPECT_EQ(error_of(Caller::root, interface_name, hears ? "MoveLeft" : "MoveRight"), "");
    EXPECT_EQ(listener.get(), hears ? "it.heard" : "");
    close(is_ready[0]);
    close(is_ready[1]);
  }
}

// Who could own the name could pretend to be the rig.
TEST_F(ShippedPolicy, OnlyTheServiceAndRootMayBeTheRig) {
  const Call own = [](sd_bus* bus, sd_bus_error* error) {
    sd_bus_call_method(bus, "org.freedesktop.DBus", "/org/freedesktop/DBus", "org.freedesktop.DBus",
                       "RequestName", error, nullptr, "su", bus_name, 0u);
  };
  for (const Caller caller : {Caller::nobody, Caller::member})
    EXPECT_EQ(error_of(caller, own), SD_BUS_ERROR_ACCESS_DENIED);
  EXPECT_EQ(error_of(Caller::root, own), "");
}

TEST(BusWithoutARig, IsToldInPlainWords) {
  const test::PrivateBus bus;
  if (!bus.running()) GTEST_SKIP() << "dbus-daemon is not installed";
  for (const char* request : {"status", "mode live"}) {
    const Said said = previzctl(request);
    EXPECT_EQ(said.status, 1);
    EXPECT_EQ(said.out, "previzctl: previzd is not running, or not with --bus\n");
  }
}

// Whoever connects does so on the loop that answers buttons and feeds the watchdog.
TEST(BusThatStandsStill, IsGivenUpSoon) {
  const test::PrivateBus bus;
  if (!bus.running()) GTEST_SKIP() << "dbus-daemon is not installed";
  sd_event* event = nullptr;
  sd_event_new(&event);
  Verbs verbs;
  verbs.status = [] { return Status{}; };
  bus.stand_still();
  std::jthread limit([&](const std::stop_token& is_given_up) {
    const auto has_ended = [&] { return is_given_up.stop_requested(); };
    EXPECT_TRUE(test::wait_until("it is given up", has_ended, std::chrono::seconds(15)));
    bus.go_on();
  });
  EXPECT_THROW(Bus(event, verbs), Error);
  limit.request_stop();
  limit.join();
  EXPECT_NO_THROW(Bus(event, verbs));
  sd_event_unref(event);
}

TEST(RigWithoutABus, SaysSo) {
  setenv("DBUS_SYSTEM_BUS_ADDRESS", "unix:path=/nonexistent/bus", 1);
  const Said said = previzctl("status");
  EXPECT_EQ(said.status, 1);
  EXPECT_THAT(said.out, HasSubstr("bus cannot be reached"));
  unsetenv("DBUS_SYSTEM_BUS_ADDRESS");
}

}  // namespace previz::control::bus_test
