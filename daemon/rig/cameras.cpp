#include "daemon/rig/cameras.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "drivers/error.hpp"
#include "drivers/replay/replay_buttons.hpp"

namespace previz::rig {
namespace {

// Threads and device start before the first frame is due.
constexpr std::chrono::milliseconds replay_delay{200};

void require_replay(const set::Set& set, const std::string& key, set::Driver driver) {
  if (driver != set::Driver::replay)
    throw Error(set.file.string() + ": " + key +
                ".driver: this build drives no such camera; \"replay\" is allowed");
}

std::unique_ptr<Camera> start(std::unique_ptr<session::StreamReader> stream,
                              const std::string& name, const ReplayOptions::Origin& origin,
                              bool loop, const std::vector<std::string>& trouble) {
  ReplayOptions options;
  options.origin = origin;
  options.loop = loop;
  std::unique_ptr<Camera> camera = replay(std::move(stream), name, options, {}, trouble);
  camera->start();
  return camera;
}

}  // namespace

Cameras open_cameras(const set::Set& set, bool loop) {
  require_replay(set, "observer", set.observer.driver);
  if (set.observer.device.empty())
    throw Error(set.file.string() + ": observer.device: names no session; a folder is needed here");
  Cameras cameras;
  cameras.recorded = session::open_session(set.observer.device);
  auto observer = session::open_stream(cameras.recorded, "observer");
  if (!observer || observer->records().empty())
    throw Error(set.observer.device + ": the session has no observer frames");
  ReplayOptions::Origin origin{std::chrono::steady_clock::now() + replay_delay,
                               observer->records().front().timestamp_ns};

  std::unique_ptr<session::StreamReader> light;
  ReplayOptions::Origin light_origin = origin;
  if (!set.lighting.environment && set.light_camera.driver != set::Driver::none) {
    require_replay(set, "light_camera", set.light_camera.driver);
    const std::string& device =
        set.light_camera.device.empty() ? set.observer.device : set.light_camera.device;
    session::Session session = session::open_session(device);
    light = session::open_stream(session, "light");
    if (!light || light->records().empty())
      throw Error(device + ": the session has no light frames");
    light_origin.timestamp_ns = light->records().front().timestamp_ns;
    if (session.directory == cameras.recorded.directory) {
      origin.timestamp_ns = std::min(origin.timestamp_ns, light_origin.timestamp_ns);
      light_origin = origin;
    }
    if (!cameras.recorded.info.light) cameras.recorded.info.light = session.info.light;
    cameras.light = start(std::move(light), "light", light_origin, loop, session.missing);
  }
  if (loop) cameras.lap_ns = replay_lap_ns(observer->records());
  cameras.observer = start(std::move(observer), "observer", origin, loop, cameras.recorded.missing);
  cameras.origin = origin;
  cameras.clock_offset_ns =
      origin.timestamp_ns - std::chrono::nanoseconds(origin.due.time_since_epoch()).count();
  return cameras;
}

std::vector<std::unique_ptr<Buttons>> open_buttons(const set::Set& set, const Cameras& cameras) {
  std::vector<std::unique_ptr<Buttons>> buttons;
  if (set.buttons.empty() || set.observer.driver != set::Driver::replay) return buttons;
  ReplayButtonsOptions options;
  options.due = cameras.origin.due;
  options.timestamp_ns = cameras.origin.timestamp_ns;
  buttons.push_back(open_replay_buttons(cameras.recorded.directory, options));
  return buttons;
}

}  // namespace previz::rig
