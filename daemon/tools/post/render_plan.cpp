#include "daemon/tools/post/render_plan.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "daemon/core/session/files.hpp"
#include "daemon/core/session/nominal_rate.hpp"
#include "daemon/core/set/names.hpp"
#include "daemon/tools/post/render_folder.hpp"
#include "daemon/tools/post/sample_ranges.hpp"
#include "drivers/error.hpp"

namespace previz::post {
namespace {

void override_take(pipeline::Take& take, const RenderOptions& options) {
  set::Set& set = take.set;
  if (options.samples) set.quality.samples = *options.samples;
  if (options.adaptive) set.quality.adaptive = *options.adaptive;
  if (options.denoise) set.quality.denoise = *options.denoise;
  if (options.neighbours) set.quality.neighbours = *options.neighbours;
  if (options.error) set.quality.error = *options.error;
  if (options.seconds) set.quality.seconds = *options.seconds;
  if (options.seed) set.estimation.seed = *options.seed;
  if (options.hides_tags) {
    set.hides_tags = *options.hides_tags;
    for (session::TrackRecord& record : take.session.track) record.scene.hides_tags.reset();
  }
  if (options.estimator) set.estimation.estimator = *options.estimator;
  if (options.directory) set.output.directory = *options.directory;
  if (options.exr) set.output.exr = *options.exr;
  if (options.png) set.output.png = *options.png;
  if (options.video) set.output.video = *options.video;
  if (options.sample_range) set.output.video = false;
}

// Returns everything that decides what the pictures look like, as JSON that RenderDirectory
// compares.
std::string settings_of(const pipeline::Take& take, const set::Set& set,
                        const std::optional<set::Overlay>& with, const RenderOptions& options) {
  nlohmann::ordered_json json;
  json["software"] = "previzd " PREVIZ_VERSION;
  json["session"] = take.session.info.name;
  json["session_start_ns"] = take.observer_stream->records().front().timestamp_ns;
  json["scale"] = options.scale;
  json["samples"] = set.quality.samples;
  json["adaptive"] = set.quality.adaptive;
  json["denoise"] = set.quality.denoise;
  // Where it is unused the pictures are those of a previzd that did not know it.
  if (const int neighbours = neighbours_of(set.quality)) json["neighbours"] = neighbours;
  if (options.hides_tags) json["hides_tags"] = *options.hides_tags;
  json["error"] = set.quality.error;
  json["seconds"] = set.quality.seconds;
  json["seed"] = set.estimation.seed;
  json["estimator"] = set::name_of(set.estimation.estimator);
  if (options.sample_range) json["sample_range"] = to_string(*options.sample_range);
  json["set"] = take.set_text;
  if (with) json["with"] = with->text;
  for (const set::Object& object : set.objects)
    json["file " + object.file_as_written] = session::sha256_of(object.file);
  if (const auto& room = set.lighting.room; room && !room->size_m)
    json["file " + room->file_as_written] = session::sha256_of(room->file);
  if (set.lighting.environment)
    json["file " + set.lighting.environment_as_written] =
        session::sha256_of(*set.lighting.environment);
  return json.dump(2) + "\n";
}

session::TakeClock clock_of(const pipeline::Take& take) {
  std::vector<std::int64_t> times;
  for (const session::FrameRecord& frame : take.observer_stream->records())
    times.push_back(frame.timestamp_ns);
  return {session::nominal_rate(times).fps, session::timecode_of(take.session.info),
          times.empty() ? 0 : times.front()};
}

FrameRange range_of(const RenderOptions& options, const pipeline::Take& take) {
  const std::uint64_t last = take.observer_stream->records().size() - 1;
  FrameRange range = options.frames.value_or(FrameRange{0, last});
  if (range.first > last)
    throw Error(options.session.string() + ": --frames starts at " + std::to_string(range.first) +
                ", but the last frame is " + std::to_string(last));
  range.last = std::min(range.last, last);
  return range;
}

}  // namespace

int neighbours_of(const set::Quality& quality) {
  return quality.denoise ? quality.neighbours : 0;
}

RenderPlan plan_render(const RenderOptions& options) {
  RenderPlan plan;
  if (options.with) plan.with = set::read_overlay(*options.with);
  plan.take = pipeline::open_take(options.session, options.set_file, options.any_paths, {},
                                  plan.with, options.set_assets, options.of_set_file);
  set::Set& set = plan.take.set;
  override_take(plan.take, options);
  if (!options.directory && !options.set_file && !options.any_paths)
    pipeline::refuse_output_elsewhere(options.session, set);
  if (options.sample_range) check_sample_range(*options.sample_range, set.quality);
  if (!options.directory)
    set.output.directory = render_folder(options.session, plan.take.session.info.take.has_value(),
                                         set.output.directory);
  plan.range = range_of(options, plan.take);
  plan.settings = settings_of(plan.take, set, plan.with, options);
  plan.clock = clock_of(plan.take);
  return plan;
}

}  // namespace previz::post
