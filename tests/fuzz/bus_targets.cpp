// What members of the bus ask for, and the foreign text that the rig answers with.
#include <systemd/sd-bus.h>
#include <systemd/sd-event.h>

#include <cstdlib>
#include <memory>
#include <stdexcept>

#include "daemon/control/bus.hpp"
#include "tests/fuzz/targets.hpp"
#include "tests/support/private_bus.hpp"

namespace previz::fuzz {
namespace bus_targets_cpp {

// A rig's interface, and a member of the same bus; both are served by one thread.
class Conversation {
 public:
  Conversation() {
    expect(daemon_.running(), "there is a private bus");
    expect(sd_event_new(&loop_) >= 0, "there is an event loop");
    bus_ = std::make_unique<control::Bus>(loop_, verbs());
    join();
  }
  ~Conversation() {
    leave();
    bus_.reset();
    sd_event_unref(loop_);
  }
  Conversation(const Conversation&) = delete;
  Conversation& operator=(const Conversation&) = delete;

  // Calls a method or reads a property with the text as its argument and in the rig's answer.
  void call(int kind, const std::string& text) {
    // The daemon turns out a member that sends what is no UTF-8; that is no fault of the rig.
    if (sd_bus_is_open(member_) <= 0) {
      leave();
      join();
    }
    text_ = text;
    static constexpr const char* members[] = {"Action", "SetMode", "Record", "Metrics", "Actions"};
    sd_bus_message* message = nullptr;
    const bool is_property = kind >= 6;
    const std::string own = kind == 5 ? control::method_name(text) : std::string();
    const char* member = is_property ? "Get" : kind == 5 ? own.c_str() : members[kind];
    if (sd_bus_message_new_method_call(
            member_, &message, control::bus_name, control::object_path,
            is_property ? "org.freedesktop.DBus.Properties" : control::interface_name, member) < 0)
      return;  // sd-bus sends no such name
    int sent = 0;
    if (is_property)
      sent = sd_bus_message_append(message, "ss", control::interface_name,
                                   kind == 6 ? "Message" : text.c_str());
    else if (kind < 2)
      sent = sd_bus_message_append(message, "s", text.c_str());
    else if (kind == 2)
      sent = sd_bus_message_append(message, "b", !text.empty() && text[0] % 2 != 0);
    answered_ = false;
    if (sent >= 0) sent = sd_bus_call_async(member_, nullptr, message, on_answer, this, 10'000'000);
    sd_bus_message_unref(message);
    if (sent < 0) return;
    while (!answered_) expect(sd_event_run(loop_, UINT64_MAX) >= 0, "the loop goes on");
    bus_->changed();
    expect(bus_->is_open(), "the rig stays on the bus");
  }

 private:
  void join() {
    expect(sd_bus_open_system(&member_) >= 0, "a member is on the bus");
    expect(sd_bus_attach_event(member_, loop_, SD_EVENT_PRIORITY_NORMAL) >= 0, "it is served");
  }
  void leave() {
    sd_bus_detach_event(member_);
    member_ = sd_bus_flush_close_unref(member_);
  }

  control::Verbs verbs() {
    control::Verbs verbs;
    verbs.perform = [this](const set::Action&, const std::string&,
                           const control::Verbs::Reply& reply) { reply(said()); };
    verbs.go = [this](set::Mode, const std::string&) { return said(); };
    verbs.record = [this](bool, const std::string&) { return said(); };
    verbs.status = [this] {
      control::Status status;
      status.message = status.set = status.fault = text_;
      return status;
    };
    verbs.metrics = [this] { return text_; };
    return verbs;
  }

  // The rig answers, refuses or throws, by the length of the text.
  control::Answer said() const {
    if (text_.size() % 3 == 2) throw std::runtime_error(text_);
    return {text_, text_.size() % 3 == 1};
  }

  static int on_answer(sd_bus_message* answer, void* own, sd_bus_error*) {
    auto& conversation = *static_cast<Conversation*>(own);
    // A member that was turned out gets this instead of an answer as well.
    expect(sd_bus_is_open(conversation.member_) <= 0 ||
               sd_bus_message_is_method_error(answer, SD_BUS_ERROR_NO_REPLY) == 0,
           "the rig answers");
    conversation.answered_ = true;
    return 0;
  }

  test::PrivateBus daemon_;
  sd_event* loop_ = nullptr;
  std::unique_ptr<control::Bus> bus_;
  sd_bus* member_ = nullptr;
  std::string text_;
  bool answered_ = false;
};

void bus(Bytes bytes) {
  static Conversation conversation;
  Choices choices(bytes);
  const int kind = choices.up_to(7);
  conversation.call(kind, text_of(choices.rest()));
}

constexpr Target own[] = {{"bus", "the argument of a call on the bus, and the rig's answer", bus}};

}  // namespace bus_targets_cpp

std::span<const Target> bus_targets() {
  return bus_targets_cpp::own;
}

}  // namespace previz::fuzz
