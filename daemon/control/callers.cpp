#include "daemon/control/callers.hpp"

#include <systemd/sd-bus.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <exception>
#include <sstream>
#include <utility>

#include "daemon/core/session/files.hpp"
#include "drivers/error.hpp"

namespace previz::control {
namespace {

constexpr const char* denied_error = "org.previz.Error.Denied";
constexpr std::size_t most_waiting = 1024, most_waiting_of_one = 16;
constexpr std::uint64_t longest_answer_us = 20'000'000;  // polkit may have to be started

// Asks only this computer: a directory of users may be far away, and the rig's loop waits for none.
std::map<std::uint32_t, std::string> users_of_this_computer() try {
  std::map<std::uint32_t, std::string> names;
  std::istringstream lines(session::read_beginning("/etc/passwd", 1 << 20));
  for (std::string line; std::getline(lines, line);) {
    std::istringstream fields(line);
    std::string name, password, user;
    for (std::string* field : {&name, &password, &user}) std::getline(fields, *field, ':');
    std::uint32_t number = 0;
    const auto [end, wrong] = std::from_chars(user.data(), user.data() + user.size(), number);
    if (wrong == std::errc() && end == user.data() + user.size()) names.try_emplace(number, name);
  }
  return names;
} catch (const Error&) {
  return {};
}

int refuse(sd_bus_message* call) {
  return sd_bus_reply_method_errorf(call, SD_BUS_ERROR_LIMITS_EXCEEDED,
                                    "too many calls wait for polkit; try again");
}

}  // namespace

// A call whose sender is not known, or not allowed, yet.
class Callers::Waiting {
 public:
  Waiting(Callers& callers, sd_bus_message* call, std::string verb, Act act)
      : callers_(callers),
        call_(sd_bus_message_ref(call)),
        verb_(std::move(verb)),
        act_(std::move(act)) {}
  ~Waiting() {
    sd_bus_slot_unref(slot_);
    sd_bus_message_unref(call_);
  }
  Waiting(const Waiting&) = delete;
  Waiting& operator=(const Waiting&) = delete;

  int ask_for_user() {
    return ask<&Waiting::know_user>("org.freedesktop.DBus", "/org/freedesktop/DBus",
                                    "org.freedesktop.DBus", "GetConnectionUnixUser", "s",
                                    sd_bus_message_get_sender(call_));
  }

 private:
  // Sends a question, whose answer goes to `Next`.
  template <int (Waiting::*Next)(sd_bus_message*), class... Arguments>
  int ask(const char* service, const char* path, const char* interface, const char* method,
          const char* types, Arguments... arguments) {
    // An exception must not pass through sd-bus.
    const auto answered = [](sd_bus_message* answer, void* waiting, sd_bus_error*) noexcept {
      auto* const self = static_cast<Waiting*>(waiting);
      try {
        return (self->*Next)(answer);
      } catch (const std::exception&) {
        sd_bus_reply_method_errorf(self->call_, SD_BUS_ERROR_NO_MEMORY, "no memory");
        return self->end(0);
      }
    };
    sd_bus_message* question = nullptr;
    int result =
        sd_bus_message_new_method_call(callers_.bus_, &question, service, path, interface, method);
    if (result >= 0) result = sd_bus_message_append(question, types, arguments...);
    slot_ = sd_bus_slot_unref(slot_);
    if (result >= 0)
      result =
          sd_bus_call_async(callers_.bus_, &slot_, question, answered, this, longest_answer_us);
    sd_bus_message_unref(question);
    return result < 0 ? deny("the rig cannot ask who you are") : 1;
  }

  int know_user(sd_bus_message* answer) {
    std::uint32_t user = 0;
    if (sd_bus_message_is_method_error(answer, nullptr) != 0 ||
        sd_bus_message_read(answer, "u", &user) < 0)
      return deny("the bus does not say who you are");
    who_ = callers_.name_of(user);
    if (user == 0 || user == ::geteuid()) return allow();
    const auto others = std::ranges::count_if(
        callers_.waiting_, [&](const Waiting& waiting) { return waiting.who_ == who_; });
    if (others > std::ptrdiff_t{most_waiting_of_one}) return end(refuse(call_));
    constexpr std::uint32_t without_a_dialogue = 0;
    return ask<&Waiting::know_verdict>(
        "org.freedesktop.PolicyKit1", "/org/freedesktop/PolicyKit1/Authority",
        "org.freedesktop.PolicyKit1.Authority", "CheckAuthorization", "(sa{sv})sa{ss}us",
        "system-bus-name", 1, "name", "s", sd_bus_message_get_sender(call_), operate_action, 1,
        "verb", verb_.c_str(), without_a_dialogue, "");
  }

  int know_verdict(sd_bus_message* answer) {
    int is_allowed = 0, may_be_asked = 0;
    if (const sd_bus_error* const error = sd_bus_message_get_error(answer))
      return deny("polkit does not respond, so that only root may; apt-get install polkitd (" +
                  std::string(error->message ? error->message : error->name) + ")");
    if (sd_bus_message_enter_container(answer, 'r', "bba{ss}") < 0 ||
        sd_bus_message_read(answer, "bb", &is_allowed, &may_be_asked) < 0 || is_allowed == 0)
      return deny(
          "polkit does not let you; members of the group previz may, or whom your rules "
          "for org.previz.Rig1.operate allow");
    return allow();
  }

  // Both end the wait, and with it this object.
  int allow() {
    const int result = act_(call_, who_);
    return end(result);
  }
  int deny(const std::string& why) {
    const std::string who = who_.empty() ? "somebody" : who_;
    if (callers_.denied_) callers_.denied_(who, verb_);
    return end(sd_bus_reply_method_errorf(call_, denied_error, "%s: %s: %s", verb_.c_str(),
                                          who.c_str(), why.c_str()));
  }
  int end(int result) noexcept {
    callers_.waiting_.remove_if([this](const Waiting& waiting) { return &waiting == this; });
    return result;
  }

  Callers& callers_;
  sd_bus_message* const call_;
  const std::string verb_;
  const Act act_;
  std::string who_;
  sd_bus_slot* slot_ = nullptr;
};

Callers::Callers(sd_bus* bus, Denied denied) : bus_(bus), denied_(std::move(denied)) {}
Callers::~Callers() = default;

std::string Callers::name_of(std::uint32_t user) {
  if (!names_.contains(user)) names_ = users_of_this_computer();
  return names_.contains(user) ? names_[user] : "uid " + std::to_string(user);
}

int Callers::admit(sd_bus_message* call, const std::string& verb, Act act) {
  if (waiting_.size() >= most_waiting) return refuse(call);
  return waiting_.emplace_back(*this, call, verb, std::move(act)).ask_for_user();
}

}  // namespace previz::control
