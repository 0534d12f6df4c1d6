#include "daemon/trade/frame.hpp"

#include <string>

#include "daemon/pipeline/preview_size.hpp"
#include "daemon/pipeline/take_shots.hpp"
#include "drivers/error.hpp"
#include "drivers/session/session.hpp"

namespace previz::trade {
namespace {

namespace fs = std::filesystem;

pipeline::Take open_replayed_take(const fs::path& set_file) {
  const set::Set set = set::load_set(set_file);
  const set::Observer& observer = set.observer;
  if (observer.driver != set::replay_driver || observer.device.empty())
    throw Error(set_file.string() +
                ": observer: a trade needs a take that is replayed; driver = \"replay\" and the "
                "session's folder as device are allowed");
  pipeline::Take take = pipeline::open_take(observer.device, set_file);
  const set::LightCamera& light = set.light_camera;
  if (light.driver == set::replay_driver && !light.device.empty() &&
      !fs::equivalent(light.device, observer.device)) {
    session::Session session = session::open_session(light.device);
    take.light = pipeline::light_calibration(set, session.info);
    take.light_stream = session::open_stream(session, "light");
  }
  return take;
}

}  // namespace

TradeFrame::TradeFrame(const fs::path& set_file, std::optional<std::uint64_t> index)
    : take_(open_replayed_take(set_file)) {
  const std::size_t frames = take_.observer_stream->records().size();
  if (index && *index >= frames)
    throw Error(take_.session.directory.string() + ": --frame " + std::to_string(*index) +
                ": the last observer frame is " + std::to_string(frames - 1));

  pipeline::TakeShotsOptions options;
  options.first = index.value_or(0);
  options.last = index.value_or(frames - 1);
  options.from_start = false;
  std::string lacks = "no frame can be read";
  for (pipeline::Shot& shot : pipeline::TakeShots(take_, options)) {
    shot_ = std::move(shot);
    lacks = what_lacks();
    if (lacks.empty()) break;
  }
  if (!lacks.empty())
    throw Error(take_.session.directory.string() + ": " +
                (index ? "frame " + std::to_string(*index) + ": " + lacks
                       : "no frame can be rendered; the last: " + lacks));
  response_.emplace(calibration().response, plate_of(shot_)->bits);
}

// Returns why the frame cannot be rendered; empty if it can.
std::string TradeFrame::what_lacks() const {
  if (!shot_.track.pose)
    return std::string("pose ") + to_string(shot_.track.status) +
           (shot_.track.reason.empty() ? "" : ", " + shot_.track.reason);
  return shot_.light ? "" : "no light frame was seen before it";
}

double TradeFrame::exposure() const {
  return set().observer.exposure.value_or(shot_.frame->exposure);
}

PlatePtr TradeFrame::plate(double scale) const {
  if (scale == 1) return shot_.plate;
  return std::make_shared<const Plate>(pipeline::scaled(*shot_.plate, scale, *response_));
}

pipeline::LightPtr TradeFrame::light(const set::Lighting& settings, const scene::Scene& scene) {
  for (const auto& [known, light] : lights_)
    if (known == settings) return light;
  pipeline::TakeShotsOptions options;
  options.first = options.last = shot_.index;
  options.lighting = settings;
  options.scene = &scene;
  options.from_start = false;
  pipeline::LightPtr light;
  for (const pipeline::Shot& shot : pipeline::TakeShots(take_, options)) light = shot.light;
  lights_.emplace_back(settings, light);
  return light;
}

}  // namespace previz::trade
