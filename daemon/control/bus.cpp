#include "daemon/control/bus.hpp"

#include <systemd/sd-bus.h>

#include <array>
#include <bit>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <deque>
#include <exception>
#include <map>
#include <optional>
#include <string_view>
#include <vector>

#include "daemon/control/callers.hpp"
#include "daemon/core/set/names.hpp"
#include "drivers/error.hpp"

namespace previz::control {
namespace {

constexpr const char* refused_error = "org.previz.Error.Refused";
constexpr const char* failed_error = "org.previz.Error.Failed";
// Whoever connects waits at most so long for the bus to greet and to grant the name.
constexpr std::chrono::seconds longest_answer{3};

void check(int result, const std::string& what) {
  if (result < 0) throw Error("D-Bus: " + what + ": " + std::strerror(-result));
}

// Returns whether sd-bus sends this character: a Unicode scalar value that is none of the 66 that
// stand for no character. It refuses a message with any other, so that nobody would get an answer.
bool is_sent(char32_t character) {
  const bool is_surrogate = character >= 0xd800 && character <= 0xdfff;
  const bool is_none =
      (character & 0xfffe) == 0xfffe || (character >= 0xfdd0 && character <= 0xfdef);
  return character <= 0x10ffff && !is_surrogate && !is_none;
}

// Returns the number of bytes of the UTF-8 character (RFC 3629) at the text's beginning; 0 if there
// is none that can be sent.
std::size_t utf8_length(std::string_view text) {
  static constexpr std::array<char32_t, 5> least = {0, 0, 0x80, 0x800, 0x10000};  // by length
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  if (byte(0) < 0x80) return 1;
  const auto length = static_cast<std::size_t>(std::countl_one(byte(0)));
  if (length < 2 || length > 4 || text.size() < length) return 0;
  char32_t character = byte(0) & (0x7fu >> length);
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return 0;
    character = character << 6 | (byte(i) & 0x3fu);
  }
  return character >= least[length] && is_sent(character) ? length : 0;
}

// Returns the text as it may go on the bus, which disconnects whoever sends anything but UTF-8; the
// name of a file or a device may be anything.
std::string on_the_bus(std::string_view text) {
  std::string result;
  while (!text.empty()) {
    const std::size_t length = text[0] == '\0' ? 0 : utf8_length(text);
    result += length == 0 ? "?" : text.substr(0, length);
    text.remove_prefix(length == 0 ? 1 : length);
  }
  return result;
}

int failed(sd_bus_error* error, const char* why) noexcept {
  try {
    return sd_bus_error_set(error, failed_error, on_the_bus(why).c_str());
  } catch (...) {
    return sd_bus_error_set(error, failed_error, "out of memory");
  }
}

// Calls a handler of sd-bus. An exception must not pass through C code; the caller gets it as an
// error in reply.
template <class Handler>
int guarded(sd_bus_error* error, Handler&& handler) noexcept {
  try {
    return handler();
  } catch (const std::exception& thrown) {
    return failed(error, thrown.what());
  } catch (...) {
    return failed(error, "unknown exception");
  }
}

// What the handlers work on.
struct Served {
  Verbs verbs;
  std::optional<Callers> callers;  // once there is a bus
};

template <int (*Method)(sd_bus_message*, Served&)>
int method(sd_bus_message* call, void* served, sd_bus_error* error) {
  return guarded(error, [&] { return Method(call, *static_cast<Served*>(served)); });
}

struct Property {
  const char* name;
  const char* type;
  bool is_signalled;
  int (*append)(sd_bus_message*, const Status&);
  bool (*same)(const Status&, const Status&);
};

template <auto Member>
int append_value(sd_bus_message* message, const Status& status) {
  const auto& value = status.*Member;
  using T = std::remove_cvref_t<decltype(value)>;
  if constexpr (std::is_same_v<T, std::string>) {
    return sd_bus_message_append(message, "s", on_the_bus(value).c_str());
  } else if constexpr (std::is_same_v<T, bool>) {
    return sd_bus_message_append(message, "b", int{value});
  } else if constexpr (std::is_same_v<T, std::uint64_t>) {
    return sd_bus_message_append(message, "t", value);
  } else if constexpr (std::is_same_v<T, double>) {
    return sd_bus_message_append(message, "d", value);
  } else {
    return sd_bus_message_append(message, "i", value);
  }
}

template <auto Member>
constexpr Property property(const char* name, const char* type, bool is_signalled = true) {
  return {name, type, is_signalled,
          [](sd_bus_message* message, const Status& status) {
            return append_value<Member>(message, status);
          },
          [](const Status& a, const Status& b) { return a.*Member == b.*Member; }};
}

constexpr Property properties[] = {
    property<&Status::mode>("Mode", "s"),
    property<&Status::recording>("Recording", "b"),
    property<&Status::writing>("Writing", "b"),
    property<&Status::take>("Take", "s"),
    property<&Status::take_good>("TakeGood", "b"),
    property<&Status::take_s>("TakeSeconds", "d", false),
    property<&Status::take_frames>("TakeFrames", "t"),
    property<&Status::take_dropped>("TakeDropped", "t"),
    property<&Status::behind_s>("BehindSeconds", "d"),
    property<&Status::behind_mb>("BehindMegabytes", "t"),
    property<&Status::fault>("Fault", "s"),
    property<&Status::camera_lost>("CameraLost", "b"),
    property<&Status::samples>("Samples", "i"),
    property<&Status::set>("Set", "s"),
    property<&Status::object>("Object", "s"),
    property<&Status::light>("Light", "s"),
    property<&Status::set_problem>("SetProblem", "s"),
    property<&Status::device>("Device", "s"),
    property<&Status::model>("Model", "s"),
    property<&Status::message>("Message", "s"),
    property<&Status::picture_s>("PictureSeconds", "d", false),
    property<&Status::loading_s>("LoadingSeconds", "d", false),
};

int answer_with(sd_bus_message* call, const Answer& answer) {
  const std::string said = on_the_bus(answer.said);
  return answer.refused ? sd_bus_reply_method_errorf(call, refused_error, "%s", said.c_str())
                        : sd_bus_reply_method_return(call, "s", said.c_str());
}

int invalid(sd_bus_message* call, const std::string& what) {
  return sd_bus_reply_method_errorf(call, SD_BUS_ERROR_INVALID_ARGS, "%s",
                                    on_the_bus(what).c_str());
}

// Lets the rig do something, once it is known that the caller may, and sends its answer when there
// is one. An exception must not pass through the question's answer either.
int operate(sd_bus_message* call, Served& served, const std::string& verb,
            std::function<void(const std::string& who, Verbs::Reply)> act) {
  return served.callers->admit(
      call, verb, [act = std::move(act)](sd_bus_message* asked, const std::string& who) {
        try {
          const std::shared_ptr<sd_bus_message> kept(sd_bus_message_ref(asked),
                                                     sd_bus_message_unref);
          act(who, [kept](const Answer& answer) { answer_with(kept.get(), answer); });
          return 1;
        } catch (const std::exception& thrown) {
          return sd_bus_reply_method_errorf(asked, failed_error, "%s",
                                            on_the_bus(thrown.what()).c_str());
        }
      });
}

int perform(sd_bus_message* call, Served& served, const set::Action& action) {
  return operate(call, served, action.name, [&](const std::string& who, Verbs::Reply reply) {
    served.verbs.perform(action, who, std::move(reply));
  });
}

int on_action(sd_bus_message* call, Served& served) {
  const char* name = nullptr;
  if (const int result = sd_bus_message_read(call, "s", &name); result < 0) return result;
  const set::Action* action = set::find_action(name);
  if (!action) return invalid(call, std::string("unknown action \"") + name + "\"");
  return perform(call, served, *action);
}

// Performs an action that was called by its own method, whose name says which action it is.
int on_own_method(sd_bus_message* call, Served& served) {
  const std::string member = sd_bus_message_get_member(call);
  for (const set::Action& action : set::actions())
    if (method_name(action.name) == member) return perform(call, served, action);
  return invalid(call, member);
}

int on_set_mode(sd_bus_message* call, Served& served) {
  const char* wanted = nullptr;
  if (const int result = sd_bus_message_read(call, "s", &wanted); result < 0) return result;
  for (const auto& [name, mode] : set::names(set::Mode{}))
    if (std::strcmp(name, wanted) == 0)
      return operate(call, served, name,
                     [&served, mode = mode](const std::string& who, const Verbs::Reply& reply) {
                       reply(served.verbs.go(mode, who));
                     });
  return invalid(
      call, std::string("unknown mode \"") + wanted + "\"; allowed: standby, live, refine, review");
}

int on_record(sd_bus_message* call, Served& served) {
  int on = 0;
  if (const int result = sd_bus_message_read(call, "b", &on); result < 0) return result;
  return operate(call, served, "record",
                 [&served, on](const std::string& who, const Verbs::Reply& reply) {
                   reply(served.verbs.record(on != 0, who));
                 });
}

int on_metrics(sd_bus_message* call, Served& served) {
  return sd_bus_reply_method_return(call, "s", on_the_bus(served.verbs.metrics()).c_str());
}

int on_actions(sd_bus_message* call, Served&) {
  sd_bus_message* reply = nullptr;
  int result = sd_bus_message_new_method_return(call, &reply);
  if (result >= 0) result = sd_bus_message_open_container(reply, 'a', "(ss)");
  for (const set::Action& action : set::actions())
    if (result >= 0) result = sd_bus_message_append(reply, "(ss)", action.name, action.about);
  if (result >= 0) result = sd_bus_message_close_container(reply);
  if (result >= 0) result = sd_bus_send(nullptr, reply, nullptr);
  sd_bus_message_unref(reply);
  return result;
}

int on_get(sd_bus*, const char*, const char*, const char* name, sd_bus_message* reply, void* served,
           sd_bus_error* error) {
  return guarded(error, [&] {
    for (const Property& property : properties)
      if (std::strcmp(property.name, name) == 0)
        return property.append(reply, static_cast<Served*>(served)->verbs.status());
    return -ENOENT;
  });
}

// Keeps what the bus answers to the wish for a name: 0, or why it is not granted.
int on_name(sd_bus_message* message, void* kept, sd_bus_error*) {
  constexpr std::uint32_t is_owner = 1;  // D-Bus specification, RequestName
  std::uint32_t result = 0;
  int refused = sd_bus_message_get_errno(message);
  if (refused == 0 && sd_bus_message_read(message, "u", &result) < 0) refused = EBADMSG;
  if (refused == 0 && result != is_owner) refused = EEXIST;
  *static_cast<std::optional<int>*>(kept) = -refused;
  return 0;
}

}  // namespace

std::string method_name(const std::string& action) {
  std::string name;
  bool upper = true;
  for (const char c : action) {
    if (c != '_')
      name += upper ? static_cast<char>(std::toupper(static_cast<unsigned char>(c))) : c;
    upper = c == '_';
  }
  return name;
}

struct Bus::Impl {
  Served served;
  std::deque<std::string> names;  // names of methods, which the table points at
  std::vector<sd_bus_vtable> table;
  sd_bus* bus = nullptr;
  sd_bus_slot* interface = nullptr;  // the table's place on the bus
  Status published;

  Impl(sd_event* loop, Verbs the_verbs) : served{std::move(the_verbs), std::nullopt} {
    fill_table();
    try {
      check(sd_bus_open_system(&bus), "the system bus cannot be reached");
      // Who ends a loop and begins another one stays on the bus.
      check(sd_bus_set_close_on_exit(bus, 0), "it cannot be kept");
      served.callers.emplace(bus, [this](const std::string& who, const std::string& verb) {
        if (served.verbs.denied) served.verbs.denied(who, verb);
      });
      check(sd_bus_add_object_vtable(bus, &interface, object_path, interface_name, table.data(),
                                     &served),
            "the interface cannot be registered");
      request_name();
      check(sd_bus_attach_event(bus, loop, SD_EVENT_PRIORITY_NORMAL), "cannot join the event loop");
    } catch (...) {
      close();
      throw;
    }
    published = served.verbs.status();
  }
  ~Impl() {
    sd_bus_detach_event(bus);
    close();
  }

  // A call that still waits for its answer keeps the bus alive, and the table must be off it by
  // then.
  void close() {
    served.callers.reset();
    sd_bus_slot_unref(interface);
    sd_bus_close_unref(bus);  // without a flush, which may wait
  }

  // Nobody is held up by a bus that stands still.
  void request_name() {
    const std::string what = std::string("the name ") + bus_name;
    const auto end = std::chrono::steady_clock::now() + longest_answer;
    std::optional<int> answer;
    check(sd_bus_request_name_async(bus, nullptr, bus_name, 0, on_name, &answer), what);
    while (!answer) {
      const int worked = sd_bus_process(bus, nullptr);
      check(worked, what);
      if (worked > 0) continue;
      const auto left =
          std::chrono::ceil<std::chrono::microseconds>(end - std::chrono::steady_clock::now());
      if (left.count() <= 0) throw Error("D-Bus: the bus does not respond");
      const int waited = sd_bus_wait(bus, static_cast<std::uint64_t>(left.count()));
      if (waited != -EINTR) check(waited, what);
    }
    check(*answer, what);
  }

  void fill_table() {
    table.push_back(SD_BUS_VTABLE_START(0));
    table.push_back(
        SD_BUS_METHOD("Action", "s", "s", method<on_action>, SD_BUS_VTABLE_UNPRIVILEGED));
    table.push_back(
        SD_BUS_METHOD("SetMode", "s", "s", method<on_set_mode>, SD_BUS_VTABLE_UNPRIVILEGED));
    table.push_back(
        SD_BUS_METHOD("Record", "b", "s", method<on_record>, SD_BUS_VTABLE_UNPRIVILEGED));
    table.push_back(
        SD_BUS_METHOD("Metrics", "", "s", method<on_metrics>, SD_BUS_VTABLE_UNPRIVILEGED));
    table.push_back(
        SD_BUS_METHOD("Actions", "", "a(ss)", method<on_actions>, SD_BUS_VTABLE_UNPRIVILEGED));
    for (const set::Action& action : set::actions()) {
      const std::string& name = names.emplace_back(method_name(action.name));
      if (name == "Record") continue;  // Record(b) takes on or off instead
      table.push_back(
          SD_BUS_METHOD(name.c_str(), "", "s", method<on_own_method>, SD_BUS_VTABLE_UNPRIVILEGED));
    }
    for (const Property& property : properties)
      table.push_back(SD_BUS_PROPERTY(property.name, property.type, on_get, 0,
                                      property.is_signalled
                                          ? std::uint64_t{SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE}
                                          : std::uint64_t{0}));
    table.push_back(SD_BUS_VTABLE_END);
  }
};

Bus::Bus(sd_event* loop, Verbs verbs) : impl_(std::make_unique<Impl>(loop, std::move(verbs))) {}
Bus::~Bus() = default;

bool Bus::is_open() const {
  return sd_bus_is_open(impl_->bus) > 0;
}

void Bus::serve(sd_event* loop, Verbs verbs) {
  leave();
  impl_->served.verbs = std::move(verbs);
  check(sd_bus_attach_event(impl_->bus, loop, SD_EVENT_PRIORITY_NORMAL),
        "cannot join the event loop");
  changed();
}

void Bus::leave() {
  sd_bus_detach_event(impl_->bus);
}

void Bus::changed() {
  const Status now = impl_->served.verbs.status();
  std::vector<char*> names;
  for (const Property& property : properties)
    if (property.is_signalled && !property.same(impl_->published, now))
      names.push_back(const_cast<char*>(property.name));
  impl_->published = now;
  if (names.empty()) return;
  names.push_back(nullptr);
  sd_bus_emit_properties_changed_strv(impl_->bus, object_path, interface_name, names.data());
}

}  // namespace previz::control
