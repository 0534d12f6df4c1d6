#include "daemon/core/live/driven_camera.hpp"

#include <chrono>
#include <utility>

#include "drivers/bracket.hpp"
#include "drivers/camera_drivers.hpp"
#include "drivers/error.hpp"

namespace previz::live {
namespace {

std::string table_of(const CameraOrder& order) {
  return order.role == "light" ? "light_camera" : order.role;
}

std::vector<Fault> faults_of(const set::Set& set, const CameraOrder& order) {
  std::vector<Fault> faults;
  for (const std::string& text : order.faults) {
    try {
      faults.push_back(parse_fault(text));
    } catch (const Error& error) {
      throw Error(set.file.string() + ": " + table_of(order) + ".faults: " + error.what());
    }
  }
  return faults;
}

std::chrono::milliseconds milliseconds_of(double seconds) {
  return std::chrono::round<std::chrono::milliseconds>(std::chrono::duration<double>(seconds));
}

std::optional<std::string> reset(const CameraDriver& driver, const std::string& device) {
  const std::optional<usb::Place> place = driver.usb_place(device);
  return place ? std::optional(usb::reset(*place)) : std::nullopt;
}

}  // namespace

std::unique_ptr<Camera> keep_alive(const set::Set& set, const CameraOrder& order, CameraOpener open,
                                   LifelineHooks hooks) {
  if (!order.faults.empty()) open = with_faults(std::move(open), faults_of(set, order));
  LifelineOptions options;
  options.start_timeout = milliseconds_of(order.wish.start_timeout_s);
  options.stall_timeout = milliseconds_of(order.wish.stall_timeout_s);
  auto camera = std::make_unique<Lifeline>(order.device, std::move(open), options, HostClock{},
                                           std::move(hooks));
  camera->start();
  return camera;
}

std::unique_ptr<Camera> drive_camera(const set::Set& set, const CameraOrder& order,
                                     const Usb& usb) {
  const CameraDriver* driver = nullptr;
  try {
    driver = &camera_driver(order.driver);
  } catch (const Error& error) {
    throw Error(set.file.string() + ": " + table_of(order) + ".driver: " + error.what());
  }
  CameraSettings settings = order.wish.settings;
  settings.source = order.role;
  settings.device = order.device;
  settings.responsivity = order.responsivity;
  // A camera that takes brackets must not expose automatically.
  if (!order.wish.bracket_s.empty()) settings.exposure_s = order.wish.bracket_s.front();
  LifelineHooks hooks;
  if (usb) hooks.arrivals = [usb] { return usb->arrivals(); };
  // A triggered camera is silent as long as nobody triggers it.
  if (!settings.trigger)
    hooks.reset = [driver, device = order.device] { return reset(*driver, device); };
  const auto open = [driver, settings, bracket_s = order.wish.bracket_s] {
    std::unique_ptr<Camera> camera = driver->open(settings);
    return bracket_s.empty() ? std::move(camera) : bracket(std::move(camera), bracket_s);
  };
  return keep_alive(set, order, open, std::move(hooks));
}

}  // namespace previz::live
