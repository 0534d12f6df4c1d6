#include "daemon/core/timing/frame.hpp"

#include <string>

#include "daemon/core/pipeline/preview_size.hpp"
#include "daemon/core/pipeline/take_shots.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/core/set/load.hpp"
#include "drivers/error.hpp"

namespace previz::timing {
namespace {

namespace fs = std::filesystem;

// Returns the folder of the take that was recorded last.
fs::path newest_take(const set::Set& set) {
  fs::path newest;
  fs::file_time_type latest = fs::file_time_type::min();
  std::error_code none;
  for (const fs::directory_entry& entry : fs::directory_iterator(set.recording.directory, none)) {
    const fs::path description = entry.path() / "session.toml";
    std::error_code gone;
    const auto time = fs::last_write_time(description, gone);
    if (gone || time < latest) continue;
    latest = time;
    newest = entry.path();
  }
  if (newest.empty())
    throw Error(set.file.string() +
                ": observer: a trade needs a take; allowed: driver = \"replay\" with the session's "
                "folder as device, or a take in " +
                set.recording.directory.string() + ", or `previz trade SESSION --set " +
                set.file.filename().string() + "`");
  return newest;
}

pipeline::Take open_traded_take(const FrameSource& source) {
  if (fs::is_directory(source.set_or_session))
    return pipeline::open_take(source.set_or_session, source.set_file, source.any_paths);
  const fs::path& set_file = source.set_or_session;
  if (source.set_file)
    throw Error("--set " + source.set_file->string() + ": " + set_file.string() +
                " is a set file, not a session");
  const set::Set set = set::load_set(set_file);
  const set::Observer& observer = set.observer;
  if (observer.driver != set::replay_driver || observer.device.empty())
    return pipeline::open_take(newest_take(set), set_file);
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

TimedFrame::TimedFrame(const FrameSource& source, std::optional<std::uint64_t> index)
    : take_(open_traded_take(source)) {
  const std::size_t frames = take_.observer_stream->records().size();
  if (index && *index >= frames)
    throw Error(take_.session.directory.string() + ": --frame " + std::to_string(*index) +
                ": the last frame is " + std::to_string(frames - 1));

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
std::string TimedFrame::what_lacks() const {
  if (!shot_.track.pose)
    return std::string("pose ") + to_string(shot_.track.status) +
           (shot_.track.reason.empty() ? "" : ", " + shot_.track.reason);
  return shot_.light ? "" : "no light frame was seen before it";
}

double TimedFrame::take_fps() const {
  const auto& frames = take_.observer_stream->records();
  const std::int64_t span_ns = frames.back().timestamp_ns - frames.front().timestamp_ns;
  return span_ns > 0 ? 1e9 * static_cast<double>(frames.size() - 1) / static_cast<double>(span_ns)
                     : 0;
}

double TimedFrame::exposure() const {
  return set().observer.exposure.value_or(shot_.frame->exposure);
}

PlatePtr TimedFrame::plate(double scale) const {
  if (scale == 1) return shot_.plate;
  return std::make_shared<const Plate>(pipeline::scaled(*shot_.plate, scale, *response_));
}

pipeline::Shot TimedFrame::shot(const set::Lighting& settings, const scene::Scene& scene) {
  pipeline::Shot shot = shot_;
  shot.plate.reset();  // its conversion is a part of each frame
  shot.light = light(settings, scene);
  return shot;
}

pipeline::LightPtr TimedFrame::light(const set::Lighting& settings, const scene::Scene& scene) {
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

}  // namespace previz::timing
