#include "daemon/core/live/cameras.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <utility>

#include "daemon/core/session/replay_buttons.hpp"
#include "drivers/bracket.hpp"
#include "drivers/error.hpp"

namespace previz::live {
namespace {

// The first replayed frame is due so late that the threads and the device have started by then.
constexpr std::chrono::milliseconds replay_delay{200};

CameraOrder observer_order(const set::Set& set) {
  const double responsivity = set.observer.calibration ? set.observer.calibration->responsivity : 1;
  return {"observer",          set.observer.driver, set.observer.device,
          set.observer.camera, set.observer.faults, responsivity};
}

CameraOrder light_order(const set::Set& set) {
  const set::LightCamera& light = set.light_camera;
  const double responsivity = light.calibration ? light.calibration->responsivity : 1;
  return {"light", light.driver, light.device, light.camera, light.faults, responsivity};
}

// Replays a session's stream in its own time; under a lifeline if faults are to be rehearsed.
std::unique_ptr<Camera> start_replay(const set::Set& set, CameraOrder order,
                                     const session::Session& session,
                                     std::unique_ptr<session::StreamReader> stream,
                                     ReplayOptions options) {
  if (!order.faults.empty()) {
    options.position = std::make_shared<ReplayPosition>();
    order.device = (session.directory / order.role).string();
    return keep_alive(set, order, [directory = session.directory, role = order.role, options] {
      return open_replay(directory, role, options);
    });
  }
  std::unique_ptr<Camera> camera =
      replay(std::move(stream), order.role, options, {}, session.missing);
  camera->start();
  return camera;
}

std::unique_ptr<session::StreamReader> open_frames(session::Session& session,
                                                   const std::string& source) {
  auto stream = session::open_stream(session, source);
  if (!stream || stream->records().empty())
    throw Error(session.directory.string() + ": the session has no " + source + " frames");
  return stream;
}

std::size_t exposures_of(const session::StreamReader& stream) {
  std::set<long> steps;
  for (const session::FrameRecord& record : stream.records())
    if (record.exposure > 0 && std::isfinite(record.exposure))
      steps.insert(exposure_step(record.exposure));
  return steps.size();
}

}  // namespace

Cameras open_cameras(const set::Set& set, bool loop, const Usb& usb) {
  if (set.observer.driver == set::no_driver)
    throw Error(set.file.string() + ": observer.driver: \"none\" cannot run live");
  if (set.observer.device.empty())
    throw Error(set.file.string() + ": observer.device: is empty; give the folder of a session");
  const std::string light_driver =
      set.lighting.environment ? set::no_driver : set.light_camera.driver;

  Cameras cameras;
  ReplayOptions options;
  options.loop = loop;
  options.origin = {std::chrono::steady_clock::now() + replay_delay, 0};
  std::unique_ptr<session::StreamReader> observer;
  if (set.observer.driver == set::replay_driver) {
    cameras.recorded = session::open_session(set.observer.device);
    observer = open_frames(cameras.recorded, "observer");
    options.origin->timestamp_ns = observer->records().front().timestamp_ns;
    options.lap_ns = replay_lap_ns(observer->records());
  } else {
    cameras.observer = drive_camera(set, observer_order(set), usb);
  }

  if (light_driver == set::replay_driver) {
    session::Session session = session::open_session(
        set.light_camera.device.empty() ? set.observer.device : set.light_camera.device);
    auto light = open_frames(session, "light");
    ReplayOptions light_options = options;
    light_options.origin->timestamp_ns = light->records().front().timestamp_ns;
    light_options.lap_ns = replay_lap_ns(light->records());
    if (session.directory == cameras.recorded.directory) {
      options.origin->timestamp_ns =
          std::min(options.origin->timestamp_ns, light_options.origin->timestamp_ns);
      options.lap_ns = std::max(options.lap_ns, light_options.lap_ns);
      light_options = options;
    }
    cameras.light_exposures = exposures_of(*light);
    if (!cameras.recorded.info.light) cameras.recorded.info.light = session.info.light;
    cameras.light = start_replay(set, light_order(set), session, std::move(light), light_options);
  } else if (light_driver != set::no_driver) {
    cameras.light_exposures = set.light_camera.camera.bracket_s.size();
    cameras.light = drive_camera(set, light_order(set), usb);
  }
  if (observer) {
    if (loop) cameras.lap_ns = options.lap_ns;
    cameras.observer =
        start_replay(set, observer_order(set), cameras.recorded, std::move(observer), options);
    cameras.origin = *options.origin;
    cameras.clock_offset_ns =
        cameras.origin.timestamp_ns -
        std::chrono::nanoseconds(cameras.origin.due.time_since_epoch()).count();
  }
  return cameras;
}

std::vector<std::unique_ptr<Buttons>> open_buttons(const set::Set& set, const Cameras& cameras) {
  std::vector<std::unique_ptr<Buttons>> buttons;
  if (set.buttons.empty() || set.observer.driver != set::replay_driver) return buttons;
  ReplayButtonsOptions options;
  options.due = cameras.origin.due;
  options.timestamp_ns = cameras.origin.timestamp_ns;
  buttons.push_back(open_replay_buttons(cameras.recorded.directory, options));
  return buttons;
}

}  // namespace previz::live
