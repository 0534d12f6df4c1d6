// previzd-aravis receives from one GigE Vision or USB3 Vision camera and passes its frames on. The
// driver (aravis_camera.cpp) starts it; it is no program for people. It has nothing in reach but
// the camera and the socket to the driver, because whatever parses what comes from a network may be
// taken over by what comes from a network.
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "drivers/aravis/protocol.hpp"
#include "drivers/aravis/receiver/device.hpp"
#include "drivers/aravis/receiver/guarded_sockets.hpp"
#include "drivers/aravis/receiver/sandbox.hpp"
#include "drivers/error.hpp"

namespace {

using namespace previz;
using namespace previz::aravis;
using Clock = std::chrono::steady_clock;

constexpr int driver = 3;  // the socket
constexpr std::chrono::milliseconds between_pulses{200};

template <class Body>
Body required(const Message& message) {
  std::optional<Body> body = body_of<Body>(message);
  if (!body) throw Error("a request is cut short");
  return *std::move(body);
}

// The answers to the driver's requests, and what is sent unasked.
class Service {
 public:
  // Until the driver closes its end.
  void run() {
    while (receives()) {
      if (device_) pass_on();
      if (Clock::now() >= next_pulse_) pulse(false);
    }
  }

 private:
  Device& device() {
    if (!device_) throw Error("no camera is open");
    return *device_;
  }

  // Waits until something is to be done; returns false when the driver is gone.
  bool receives() {
    std::array<pollfd, 2> ready{
        {{driver, POLLIN, 0}, {device_ ? device_->event() : -1, POLLIN, 0}}};
    poll(ready.data(), ready.size(), static_cast<int>(between_pulses.count()));
    Message message;
    for (;;) {
      const Received received = receive(driver, message);
      if (received == Received::nothing) return true;
      if (received == Received::closed) return false;
      answer(message);
    }
  }

  void answer(Message& message) {
    try {
      int descriptor = -1;
      const std::optional<Writer> done = perform(message, descriptor);
      if (done) send(driver, Kind::done, *done, descriptor, true);
    } catch (const Error& error) {
      send(driver, Kind::refused, Writer()(std::string(error.what())), -1, true);
    }
  }

  // Returns the answer; none for a message that is not answered.
  std::optional<Writer> perform(Message& message, int& descriptor) {
    switch (message.kind) {
      case Kind::list:
        return Writer()(listing());
      case Kind::open:
        device_.reset();
        device_ = std::make_unique<Device>(required<Order>(message).settings);
        descriptor = device_->control_socket();
        return Writer()(device_->terms());
      case Kind::start:
        device().start(required<Ring>(message), std::move(message.descriptor));
        return Writer();
      case Kind::stop:
        pulse(true);  // the last counts of the stream
        device().stop();
        return Writer();
      case Kind::expose:
        return Writer()(device().expose(required<ExposureWords>(message)));
      case Kind::trigger:
        device().trigger();
        return Writer();
      case Kind::give_back:
        if (device_) device_->give_back(required<std::uint32_t>(message));
        return std::nullopt;
      default:
        throw Error("unknown request");
    }
  }

  static Listing listing() {
    constexpr std::size_t most_devices = 32, most_characters = 64;  // so that a message holds them
    Listing listing;
    for (Listed& device : list_devices()) {
      if (listing.devices.size() == most_devices) break;
      for (std::string* text : {&device.id, &device.address, &device.serial, &device.vendor,
                                &device.model, &device.protocol})
        text->resize(std::min(text->size(), most_characters));
      listing.devices.push_back(std::move(device));
    }
    return listing;
  }

  void pass_on() {
    for (const FrameNote& note : device_->filled())
      send(driver, Kind::frame, Writer()(note), -1, true);
    if (device_->is_lost() && !std::exchange(said_lost_, true))
      send(driver, Kind::lost, {}, -1, true);
  }

  // A driver that does not listen does without.
  void pulse(bool may_wait) {
    next_pulse_ = Clock::now() + between_pulses;
    send(driver, Kind::pulse, Writer()(device_ ? device_->pulse() : Pulse()), -1, may_wait);
  }

  std::unique_ptr<Device> device_;
  bool said_lost_ = false;
  Clock::time_point next_pulse_;
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fputs("previzd-aravis receives from a camera; previzd starts it.\n", stderr);
    return 2;
  }
  const bool usb = argv[1] == std::string("usb");
  if (!limit_resources(std::atoi(argv[3]))) return 1;
  try {
    // A driver that runs on after an upgrade has messages that this program may not know.
    if (argv[2] != std::string(PREVIZ_RECEIVER_MESSAGES))
      throw Error("it is from another version than the running previzd; restart previzd");
    enter_sandbox(usb);
    if (!usb) check_that_sockets_are_filtered();
  } catch (const Error& error) {
    send(driver, Kind::refused, Writer()(std::string(error.what())), -1, false);
    return 1;
  }
  arv_disable_interface(usb ? "GigEVision" : "USB3Vision");
  Service().run();
  _exit(0);  // libraries' own endings want what the sandbox does not allow
}
