#include "daemon/trade/frame.hpp"

#include <string>

#include "daemon/pipeline/light_stage.hpp"
#include "daemon/pipeline/preview_size.hpp"
#include "daemon/pipeline/take.hpp"
#include "daemon/pipeline/track_stage.hpp"
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

TradeFrame::TradeFrame(const fs::path& set_file, std::optional<std::uint64_t> index) {
  pipeline::Take take = open_replayed_take(set_file);
  set_ = take.set;
  calibration_ = take.observer;
  light_calibration_ = take.light;
  const std::size_t frames = take.observer_stream->records().size();
  if (index && *index >= frames)
    throw Error(take.session.directory.string() + ": --frame " + std::to_string(*index) +
                ": the last observer frame is " + std::to_string(frames - 1));

  pipeline::TrackStage track(set_, calibration_, take.session.track, pipeline::start_of(take));
  std::string lacks;
  for (std::size_t i = index.value_or(0); i < (index ? *index + 1 : frames); ++i) {
    shot_ = {};
    lights_.clear();
    shot_.index = i;
    shot_.frame = take.observer_stream->read(i);
    track(shot_);
    if (take.light_stream) see_light(*take.light_stream);
    lacks = what_lacks();
    if (lacks.empty()) break;
  }
  if (!lacks.empty())
    throw Error(take.session.directory.string() + ": " +
                (index ? "frame " + std::to_string(*index) + ": " + lacks
                       : "no frame can be rendered; the last: " + lacks));
  response_.emplace(calibration_.response, to_plate(*shot_.frame).bits);
}

// The light frames up to this observer frame.
void TradeFrame::see_light(session::StreamReader& stream) {
  if (set_.lighting.environment || set_.lighting.from != set::LightFrom::camera) return;
  const auto& records = stream.records();
  for (std::size_t next = light_frames_.size();
       next < records.size() && records[next].timestamp_ns <= shot_.frame->timestamp_ns; ++next)
    light_frames_.push_back(stream.read(next));
}

// Why the frame cannot be rendered; empty: it can.
std::string TradeFrame::what_lacks() {
  if (!shot_.track.pose)
    return std::string("pose ") + to_string(shot_.track.status) +
           (shot_.track.reason.empty() ? "" : ", " + shot_.track.reason);
  return light(set_.lighting) ? "" : "no light frame was seen before it";
}

double TradeFrame::exposure() const {
  return set_.observer.exposure.value_or(shot_.frame->exposure);
}

Plate TradeFrame::plate(double scale) const {
  const Plate full = to_plate(*shot_.frame);
  return scale == 1 ? full : pipeline::scaled(full, scale, *response_);
}

pipeline::LightPtr TradeFrame::light(const set::Lighting& settings) {
  for (const auto& [known, light] : lights_)
    if (known == settings) return light;
  set::Set set = set_;
  set.lighting = settings;
  pipeline::LightStage stage(set, light_calibration_, calibration_);
  for (std::size_t i = 0; i < light_frames_.size(); ++i) stage.see(light_frames_[i], i);
  if (shot_.track.pose) stage.see_observer(*shot_.frame, shot_.track.pose->world_from_camera);
  lights_.emplace_back(settings, stage.light_for(shot_));
  return lights_.back().second;
}

}  // namespace previz::trade
