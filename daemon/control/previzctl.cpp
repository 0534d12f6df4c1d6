// previzctl controls the rig from a shell. Its exit status is 0 if the request was done, 1 if it
// was refused or there is no rig (one line says why), 2 if the command line cannot be understood.
#include <systemd/sd-bus.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <iostream>
#include <map>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "daemon/control/bus.hpp"
#include "daemon/control/request.hpp"
#include "daemon/control/status_words.hpp"
#include "daemon/core/report/printable.hpp"
#include "daemon/core/report/standard_output.hpp"
#include "daemon/core/report/still_working.hpp"
#include "drivers/error.hpp"

namespace {

using namespace previz;

struct BusCloser {
  void operator()(sd_bus* bus) const { sd_bus_flush_close_unref(bus); }
};
struct MessageCloser {
  void operator()(sd_bus_message* message) const { sd_bus_message_unref(message); }
};
using BusPtr = std::unique_ptr<sd_bus, BusCloser>;
using MessagePtr = std::unique_ptr<sd_bus_message, MessageCloser>;

class ErrorText {
 public:
  ~ErrorText() { sd_bus_error_free(&error_); }
  sd_bus_error* out() { return &error_; }
  // Throws the bus's error if the call failed.
  void check(int result) const {
    if (result >= 0) return;
    if (sd_bus_error_has_name(&error_, SD_BUS_ERROR_SERVICE_UNKNOWN) != 0 ||
        sd_bus_error_has_name(&error_, SD_BUS_ERROR_NAME_HAS_NO_OWNER) != 0)
      throw Error("previzd is not running, or not with --bus");
    if (sd_bus_error_has_name(&error_, SD_BUS_ERROR_NO_REPLY) != 0 || result == -ETIMEDOUT)
      throw Error("previzd is running but does not respond; the journal may say why");
    if (sd_bus_error_has_name(&error_, SD_BUS_ERROR_ACCESS_DENIED) != 0)
      throw Error(
          "only root and members of the groups previz and previz-view may call the rig: "
          "`adduser NAME previz` lets NAME operate it from the next login on, previz-view only "
          "look");
    throw Error(error_.message ? error_.message : std::strerror(-result));
  }

 private:
  sd_bus_error error_ = SD_BUS_ERROR_NULL;
};

BusPtr open_bus() {
  sd_bus* bus = nullptr;
  if (const int result = sd_bus_open_system(&bus); result < 0)
    throw Error(std::string("the system bus cannot be reached: ") + std::strerror(-result));
  return BusPtr(bus);
}

template <class... Arguments>
std::string call(const char* method, const char* types, Arguments... arguments) {
  const BusPtr bus = open_bus();
  ErrorText error;
  sd_bus_message* reply = nullptr;
  error.check(sd_bus_call_method(bus.get(), control::bus_name, control::object_path,
                                 control::interface_name, method, error.out(), &reply, types,
                                 arguments...));
  const MessagePtr owned(reply);
  const char* said = nullptr;
  error.check(sd_bus_message_read(reply, "s", &said));
  return said;
}

// Returns a property's value as text, for the types that the rig has.
std::string value_text(sd_bus_message* message) {
  char type = 0;
  const char* contents = nullptr;
  sd_bus_message_peek_type(message, &type, &contents);
  const std::string signature = contents ? contents : "";
  sd_bus_message_enter_container(message, 'v', contents);
  std::string text;
  if (signature == "s") {
    const char* value = nullptr;
    sd_bus_message_read(message, "s", &value);
    text = value;
  } else if (signature == "b") {
    int value = 0;
    sd_bus_message_read(message, "b", &value);
    text = value != 0 ? "yes" : "no";
  } else if (signature == "d") {
    double value = 0;
    sd_bus_message_read(message, "d", &value);
    std::array<char, 32> digits{};
    std::snprintf(digits.data(), digits.size(), "%.1f", value);
    text = digits.data();
  } else if (signature == "t") {
    std::uint64_t value = 0;
    sd_bus_message_read(message, "t", &value);
    text = std::to_string(value);
  } else if (signature == "i") {
    std::int32_t value = 0;
    sd_bus_message_read(message, "i", &value);
    text = std::to_string(value);
  } else {
    sd_bus_message_skip(message, nullptr);
  }
  sd_bus_message_exit_container(message);
  return text;
}

using Properties = std::map<std::string, std::string>;

// Reads the properties of an a{sv}.
Properties read_properties(sd_bus_message* message) {
  Properties properties;
  sd_bus_message_enter_container(message, 'a', "{sv}");
  while (sd_bus_message_enter_container(message, 'e', "sv") > 0) {
    const char* name = nullptr;
    sd_bus_message_read(message, "s", &name);
    const std::string key = name;
    properties[key] = value_text(message);
    sd_bus_message_exit_container(message);
  }
  sd_bus_message_exit_container(message);
  return properties;
}

std::vector<std::string> lines_of(const Properties& properties, bool is_raw) {
  if (!is_raw) return control::status_words(properties);
  std::vector<std::string> lines;
  for (const auto& [name, text] : properties) lines.push_back(name + ": " + text);
  return lines;
}

Properties print_status(bool is_raw) {
  const BusPtr bus = open_bus();
  ErrorText error;
  sd_bus_message* reply = nullptr;
  error.check(sd_bus_call_method(bus.get(), control::bus_name, control::object_path,
                                 "org.freedesktop.DBus.Properties", "GetAll", error.out(), &reply,
                                 "s", control::interface_name));
  const MessagePtr owned(reply);
  Properties properties = read_properties(reply);
  for (const std::string& line : lines_of(properties, is_raw)) std::cout << line << "\n";
  std::cout << std::flush;
  return properties;
}

// What watch() knows so far.
struct Watched {
  Properties properties;
  bool is_raw;
};

int on_changed(sd_bus_message* signal, void* data, sd_bus_error*) {
  auto& watched = *static_cast<Watched*>(data);
  sd_bus_message_skip(signal, "s");
  const std::vector<std::string> before = lines_of(watched.properties, watched.is_raw);
  for (auto& [name, text] : read_properties(signal)) watched.properties[name] = text;
  for (const std::string& line : lines_of(watched.properties, watched.is_raw))
    if (std::ranges::find(before, line) == before.end()) std::cout << line << "\n";
  std::cout << std::flush;
  return 0;
}

// Prints every change until it is interrupted.
void watch(bool is_raw) {
  Watched watched{print_status(is_raw), is_raw};
  // What is not signalled grows old.
  for (const char* name : {"PictureSeconds", "LoadingSeconds", "TakeSeconds"})
    watched.properties.erase(name);
  const BusPtr bus = open_bus();
  ErrorText error;
  error.check(sd_bus_match_signal(bus.get(), nullptr, control::bus_name, control::object_path,
                                  "org.freedesktop.DBus.Properties", "PropertiesChanged",
                                  on_changed, &watched));
  for (;;) {
    error.check(sd_bus_process(bus.get(), nullptr));
    error.check(sd_bus_wait(bus.get(), UINT64_MAX));
  }
}

// Prints the built-in table of actions, which needs no rig.
void print_actions(bool names_only) {
  for (const set::Action& action : set::actions()) {
    std::cout << action.name;
    if (!names_only) std::cout << "\t" << action.about;
    std::cout << "\n";
  }
}

int do_line(int argc, char** argv) {
  CLI::App app{"Operates a camera rig that runs previzd", "previzctl"};
  control::Request asked;
  try {
    control::add_requests(app, asked);
    app.parse(argc, argv);
    if (app.got_subcommand("status")) return print_status(asked.raw), 0;
    if (app.got_subcommand("watch")) return watch(asked.raw), 0;
    if (app.got_subcommand("actions")) return print_actions(asked.names_only), 0;
    std::optional<StillWorking> waiting;
    if (isatty(STDOUT_FILENO) != 0)
      waiting.emplace("waiting for the rig", std::vector<std::ostream*>{&std::cout});
    std::string said;
    if (app.got_subcommand("metrics"))
      said = call("Metrics", "");
    else if (app.got_subcommand("mode"))
      said = call("SetMode", "s", asked.mode.c_str());
    else if (app.got_subcommand("record"))
      said = call("Record", "b", int{asked.record == "on"});
    else if (app.got_subcommand("action"))
      said = call("Action", "s", asked.action.c_str());
    else
      said =
          call("Action", "s", asked.set == "reload" ? "reload_set" : (asked.set + "_set").c_str());
    std::cout << said << std::endl;
    return 0;
  } catch (const CLI::ParseError& error) {
    std::ostringstream refusal;
    const int status = app.exit(error, std::cout, refusal);
    std::cerr << with_short_lines(refusal.str());
    return status == 0 ? 0 : 2;
  } catch (const std::exception& error) {
    std::cerr << "previzctl: " << with_short_lines(error.what()) << std::endl;
    return 1;
  }
}

}  // namespace

int main(int argc, char** argv) {
  const SafeOutput out(std::cout), errors(std::cerr);
  return finished_output("previzctl", do_line(argc, argv));
}
