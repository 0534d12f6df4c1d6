#include "daemon/tools/post/render.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <ostream>
#include <set>
#include <utility>

#include "daemon/core/check/light_judgement.hpp"
#include "daemon/core/output/memory.hpp"
#include "daemon/core/output/progress.hpp"
#include "daemon/core/output/recorder.hpp"
#include "daemon/core/pipeline/neighbour_stage.hpp"
#include "daemon/core/pipeline/preview_size.hpp"
#include "daemon/core/pipeline/refinement.hpp"
#include "daemon/core/pipeline/render_stage.hpp"
#include "daemon/core/pipeline/stages.hpp"
#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/pipeline/take_shots.hpp"
#include "daemon/core/report/report.hpp"
#include "daemon/core/scene/check.hpp"
#include "daemon/core/scene/lamp_strength.hpp"
#include "daemon/core/scene/load.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/set/check.hpp"
#include "daemon/core/tracking/pose_judgement.hpp"
#include "daemon/tools/post/frames_to_render.hpp"
#include "daemon/tools/post/render_directory.hpp"
#include "daemon/tools/post/render_plan.hpp"
#include "daemon/tools/post/sample_ranges.hpp"
#include "daemon/tools/post/sums_folders.hpp"
#include "drivers/error.hpp"

namespace previz::post {
namespace {

using pipeline::Shot;

double now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Returns whether tags are hidden in any of the take's frames.
bool hides_tags(const pipeline::Take& take) {
  return take.set.hides_tags || std::ranges::any_of(take.session.track, [](const auto& record) {
           return record.scene.hides_tags.value_or(false);
         });
}

std::string size_words(const PinholeIntrinsics& picture) {
  return std::to_string(picture.width) + "x" + std::to_string(picture.height);
}

std::string percent_words(double share) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.2g %%", 100 * share);
  return text.data();
}

std::string gigabytes(std::uint64_t bytes) {
  return fmt::format("{:.1f}GB", std::ceil(static_cast<double>(bytes) / 1e8) / 10);
}

std::string done_text(const Shot& shot) {
  const std::string frame = "frame " + std::to_string(shot.index) + ": ";
  if (!shot.untouched.empty()) return frame + "plate untouched, " + shot.untouched;
  std::string text = frame + set::plural(std::uint64_t(samples_of(shot)), "sample") + " in " +
                     output::duration_words(shot.render_s);
  if (shot.error > 0) text += ", error " + percent_words(shot.error);
  return text;
}

std::string quality_words(const set::Quality& quality) {
  std::string text = set::plural(std::uint64_t(quality.samples), "sample");
  if (pipeline::spreads_samples(quality))
    text += " on average";
  else if (quality.adaptive)
    text += ", the same for every pixel (adaptive needs 32 or more, without error or seconds)";
  if (quality.error > 0) text += ", then to an error of " + percent_words(quality.error);
  if (quality.seconds > 0)
    text += ", then for " + output::duration_words(quality.seconds) + " per frame at most";
  if (quality.denoise) text += ", denoised";
  if (const int neighbours = neighbours_of(quality))
    text += ", over " + set::plural(std::uint64_t(neighbours), "frame") +
            " on either side, which are rendered too";
  return text;
}

// Reports NaN and negative samples, which are left out of the means, and paths that were cut short,
// so that nobody misses them.
std::string dropped_text(const render::Counters& counters) {
  std::string text;
  const auto add = [&](std::uint64_t count, const char* what) {
    if (count > 0) add_to_list(text, std::to_string(count) + what);
  };
  add(counters.dropped_not_finite, " non-finite samples");
  add(counters.dropped_negative, " negative samples");
  add(counters.stopped_in_layers, " rays stopped after too many transparent surfaces");
  add(counters.unfinished, " paths cut short");
  return text;
}

}  // namespace

FrameRange parse_frame_range(const std::string& text) {
  const Error error("--frames " + text +
                    ": write one frame (7), a range (3-9) or an open one (3-)");
  const auto number = [&](std::string_view digits) {
    std::uint64_t value = 0;
    const auto [end, code] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (code != std::errc() || end != digits.data() + digits.size()) throw error;
    return value;
  };
  const std::string_view view = text;
  const std::size_t dash = view.find('-');
  FrameRange range;
  range.first = number(view.substr(0, dash));
  range.last = range.first;
  if (dash != std::string_view::npos) {
    const std::string_view last = view.substr(dash + 1);
    range.last = last.empty() ? std::numeric_limits<std::uint64_t>::max() : number(last);
  }
  if (range.last < range.first) throw error;
  return range;
}

namespace {

// A take and where its pictures go.
struct Job {
  const RenderOptions& options;
  const pipeline::Take& take;
  const scene::Scene& scene;
  const std::shared_ptr<render::Device>& device;
  RenderDirectory& directory;
  pipeline::Metrics& metrics;
  const SumsFolders* sums;  // null: the samples are rendered here
  RenderReport& report;
  tracking::PoseJudgement& judgement;
  check::LightJudgement& light;
};

MadeOn made_on(const render::Device& device) {
  return {render::device_name(device), render::is_gpu(device)};
}

// Returns the merged sums of a shot, or reports why there are none.
std::optional<render::SampleSums> merged_sums(const Job& job, const Shot& shot,
                                              output::Progress& progress) {
  try {
    return job.sums->merged(shot.index, render::scratch_of(*job.device));
  } catch (const Error& error) {
    progress.note(error.what());
    job.report.failures.emplace_back(error.what());
    return std::nullopt;
  }
}

// Both must outlive the options.
pipeline::RenderStageOptions stage_options(const Job& job, output::Progress& progress) {
  const set::Quality& quality = job.take.set.quality;
  pipeline::RenderStageOptions options;
  options.layers = true;
  options.seeds_shots = neighbours_of(quality) > 0;
  options.scale = job.options.scale;
  options.cancelled = [&] { return job.options.stop.stop_requested(); };
  const int samples =
      samples_of(job.options.sample_range.value_or(render::SampleRange{}), quality.samples).count;
  options.progress = [&, samples](const Shot& shot, int done) {
    progress.sample(shot.index, done, samples, now_s());
  };
  options.sample_range = job.options.sample_range;
  if (job.sums) options.sums = [&](const Shot& shot) { return merged_sums(job, shot, progress); };
  options.note = [&](const std::string& what) { progress.note(what); };
  return options;
}

// Renders those of the frames that no other process has finished or is rendering, and returns the
// frames that were left to others.
std::set<std::uint64_t> render_frames(const Job& job, const std::set<std::uint64_t>& to_do,
                                      output::Progress& progress) {
  // No structured binding: clang 14's lambdas cannot capture one.
  const RenderOptions& options = job.options;
  const pipeline::Take& take = job.take;
  RenderDirectory& directory = job.directory;
  const set::Set& set = take.set;
  const int neighbours = neighbours_of(set.quality);
  FramesToRender frames(directory, to_do, neighbours, take.observer_stream->records().size());
  const auto is_rendered = [&](std::uint64_t frame) { return frames.is_rendered(frame); };
  const auto leave_out = [&](std::uint64_t frame) { frames.leave_out(frame); };
  pipeline::TakeShots shots(take, {.first = frames.first(),
                                   .last = frames.last(),
                                   .wanted = is_rendered,
                                   .unreadable = leave_out,
                                   .scene = &job.scene,
                                   .note = [&](const std::string& what) { progress.note(what); },
                                   .metrics = &job.metrics,
                                   .stop = options.stop});
  report::Once light_notes;
  set::Set written = set;  // with the lens of the pictures, for what is written beside them
  written.observer.calibration = pipeline::scaled(take.observer, options.scale);
  pipeline::RenderStage render(job.device, set, take.observer, job.scene,
                               stage_options(job, progress));
  pipeline::NeighbourStage among_neighbours(render, neighbours);

  // One shot ahead of each stage keeps them all busy; whole layers wait in the last queue.
  pipeline::BoundedQueue<Shot> lit(1), rendered(1);
  pipeline::StageThreads stages(job.metrics, options.stop);
  stages.source("observer", lit, [&] {
    std::optional<Shot> shot = shots.next();
    if (shot) shot->only_neighbour = !frames.is_written(shot->index);
    if (shot) job.judgement.add(shot->frame, shot->track);
    if (shot && shot->light)
      for (const std::string& what : shot->light->lighting.report.notes)
        if (light_notes.is_first(report::wording(what))) progress.note("light: " + what);
    return shot;
  });
  if (neighbours > 0)
    stages.stage_ahead("render", lit, rendered, [&](std::optional<Shot> shot) {
      if (!shot) return among_neighbours.end(options.stop.stop_requested());
      const std::uint64_t index = shot->index;
      std::vector<Shot> shown = among_neighbours(*std::move(shot));
      if (!options.stop.stop_requested()) progress.frame_rendered(index, now_s());
      return shown;
    });
  else
    stages.stage("render", lit, rendered, [&](Shot shot) {
      render(shot);
      return shot;
    });
  stages.sink("output", rendered, [&](const Shot& shot) {
    if (!shot.whole) return directory.release(shot.index);
    directory.write(shot, written, made_on(*job.device));
    if (const std::string dropped = dropped_text(shot.counters); !dropped.empty())
      progress.note("frame " + std::to_string(shot.index) + ": dropped " + dropped);
    progress.frame_done(done_text(shot), now_s());
    job.light.add(shot);
    if (options.on_frame) options.on_frame(shot);
  });
  stages.wait();
  return frames.left();
}

render::TakeOfPictures pictures_of(const RenderOptions& options, const pipeline::Take& take) {
  const set::Quality& quality = take.set.quality;
  const PinholeIntrinsics picture = pipeline::scaled(take.observer, options.scale).intrinsics;
  return {.width = picture.width,
          .height = picture.height,
          .each_side = neighbours_of(quality),
          .take_frames = take.observer_stream->records().size(),
          .parts = pipeline::has_fixed_samples(quality) ? render::part_count(quality.samples) : 1};
}

// Returns scratch files of so many bytes, for which each folder is tried. Throws previz::Error,
// with what is wrong with the first, where none can hold them.
std::shared_ptr<render::Scratch> scratch_files(const RenderOptions& options,
                                               const render::MemoryPlan& plan,
                                               const render::TakeMemory& needed,
                                               std::filesystem::path& folder) {
  std::vector<std::filesystem::path> folders{"/var/tmp"};
  if (const char* const own = std::getenv("TMPDIR"); own && *own != 0)
    folders.insert(folders.begin(), own);
  if (options.scratch) folders = {*options.scratch};
  std::string why;
  for (const std::filesystem::path& tried : folders) {
    try {
      auto scratch = std::make_shared<render::Scratch>(tried, plan.resident);
      folder = tried;
      const std::uint64_t room = render::Scratch::room(tried);
      if (needed.banded <= room) return scratch;
      add_to_list(why,
                  tried.string() + ": the scratch files of these pictures take " +
                      gigabytes(needed.banded) + ", and there is room for " + gigabytes(room) +
                      "; name another folder (--scratch), allow more memory (--memory " +
                      gigabytes(needed.whole()) + ") or make the pictures smaller (--scale)",
                  "\n");
    } catch (const Error& error) {
      add_to_list(why, error.what(), "\n");
    }
  }
  throw Error(why);
}

// Lets the device work in scratch files where the pictures need more memory than they may take.
// Throws previz::Error if that does not suffice, or the files cannot be there; nobody has asked for
// a limit, and the memory is free: all stays in memory.
void keep_to_memory(const RenderOptions& options, const pipeline::Take& take,
                    render::Device& device, std::ostream& out) {
  render::use_scratch(device, nullptr);  // of another take
  const render::TakeOfPictures pictures = pictures_of(options, take);
  const render::PictureMemory memory = render::memory_of(device);
  const std::uint64_t free_bytes =
      options.free_memory ? *options.free_memory
                          : output::free_memory_bytes().value_or(output::memory_bytes());
  std::optional<std::uint64_t> asked = options.memory;
  if (!asked && take.set.quality.memory_mb)
    asked = static_cast<std::uint64_t>(1e6 * *take.set.quality.memory_mb);
  const render::MemoryPlan plan = render::plan_memory(pictures, memory, asked, free_bytes);
  if (plan.in_scratch) {
    const render::TakeMemory needed = render::take_memory(pictures, memory);
    try {
      std::filesystem::path folder;
      render::use_scratch(device, scratch_files(options, plan, needed, folder));
      out << take.session.info.name << ": works in scratch files of up to "
          << gigabytes(needed.banded) << " in " << folder.string() << std::endl;
    } catch (const Error& error) {
      if (asked || options.scratch || needed.whole() > free_bytes / 10 * 9) throw;
      out << take.session.info.name << ": takes " << gigabytes(needed.whole())
          << " of memory, because " << error.what() << std::endl;
    }
  }
  render::refuse_too_large(pictures, render::memory_of(device));
}

// Returns how many frames are rendered only as neighbours of others.
std::uint64_t only_neighbours(const std::set<std::uint64_t>& to_do, std::uint64_t neighbours,
                              std::uint64_t take_frames) {
  std::set<std::uint64_t> rendered;
  for (const std::uint64_t frame : to_do)
    for (std::uint64_t at = frame - std::min(frame, neighbours);
         at <= frame + neighbours && at < take_frames; ++at)
      rendered.insert(at);
  return rendered.size() - to_do.size();
}

// Renders the frames, and then those that another process had and did not finish: it was killed.
void render_all(const RenderOptions& options, const pipeline::Take& take,
                std::set<std::uint64_t> to_do, RenderDirectory& directory,
                pipeline::Metrics& metrics, const SumsFolders* sums, RenderReport& report,
                std::ostream& out) {
  out << take.session.info.name << ": reading the scene" << std::endl;
  const scene::Scene scene = scene::load_scene(take.set);
  std::vector<std::string> notes = scene.notes;
  std::ranges::move(scene::remarks_on_bright_lamps(scene, take.set, pipeline::first_exposure(take)),
                    std::back_inserter(notes));
  for (const std::string& note : notes) out << "scene: " << note << std::endl;
  if (hides_tags(take)) {
    out << "tags: printed tags are hidden" << std::endl;
    for (const std::string& remark : scene::remarks_on_hidden_tags(scene, take.set))
      out << "tags: " << remark << std::endl;
  }
  const std::shared_ptr<render::Device> device =
      options.open_device ? options.open_device
                          : render::open_device(render::options_for(
                                options.device, take.set.quality.hardware_rays));
  keep_to_memory(options, take, *device, out);
  if (!options.set_file)
    out << take.session.info.name << ": uses the set recorded with it; --set FILE uses another"
        << std::endl;
  out << take.session.info.name << ": " << set::plural(to_do.size(), "frame") << " of "
      << size_words(pipeline::scaled(take.observer, options.scale).intrinsics) << ", "
      << quality_words(take.set.quality)
      << (options.sample_range ? ", range " + to_string(*options.sample_range) + " of them" : "")
      << (sums ? ", merged from their ranges" : "") << ", on " << render::device_name(*device)
      << std::endl;
  output::Progress progress(
      out, options.terminal, to_do.size(), now_s(),
      only_neighbours(to_do, static_cast<std::uint64_t>(neighbours_of(take.set.quality)),
                      take.observer_stream->records().size()));
  tracking::PoseJudgement judgement(take.set.tracking, take.observer);
  check::LightJudgement light(take, options.scale);
  const Job job{options, take, scene, device, directory, metrics, sums, report, judgement, light};
  while (!to_do.empty() && !options.stop.stop_requested()) {
    const std::set<std::uint64_t> left = render_frames(job, to_do, progress);
    to_do.clear();
    std::set<std::uint64_t> at_others;
    for (const auto& [who, frames] : directory.at_others(left))
      at_others.insert(frames.begin(), frames.end());
    for (const std::uint64_t frame : left)
      if (!directory.finished(frame) && !at_others.contains(frame)) to_do.insert(frame);
    if (!to_do.empty())
      progress.note(frames_words({to_do.begin(), to_do.end()}) +
                    (to_do.size() == 1 ? ": was" : ": were") +
                    " left unfinished by a process that ended, and " +
                    (to_do.size() == 1 ? "is" : "are") + " rendered here");
  }
  if (options.stop.stop_requested()) return;
  for (const std::string& doubt : judgement.doubts(options.stop))
    progress.note("tracking: " + doubt);
  for (const std::string& doubt : light.doubts()) progress.note("light: " + doubt);
}

void report_opened(const RenderDirectory& directory, const RenderReport& report, bool was_read,
                   std::ostream& out) {
  const std::string folder = directory.path().string();
  for (const std::string& note : directory.notes()) out << folder << ": " << note << std::endl;
  if (report.found_finished > 0)
    out << folder << ": " << set::plural(report.found_finished, "frame") << " already rendered"
        << (was_read ? ", and the files are as they were written" : "") << std::endl;
  for (const auto& [why, frames] : directory.rejected())
    out << folder << ": rendered again: " << frames_words(frames) << ": " << why << std::endl;
}

// Makes the review video if all frames are done, or says who is to be waited for.
void finish_video(const std::map<std::string, std::vector<std::uint64_t>>& at_others,
                  bool wants_video, RenderDirectory& directory, RenderReport& report,
                  std::ostream& out) {
  const std::string folder = directory.path().string();
  for (const auto& [who, frames] : at_others) {
    report.at_others += frames.size();
    out << folder << ": " << frames_words(frames) << (frames.size() == 1 ? " is" : " are")
        << " being rendered by " << who << std::endl;
  }
  if (report.at_others > 0 && wants_video)
    out << folder << ": no review video yet; when they are done, run the same command for it"
        << std::endl;
  if (report.at_others > 0 || !wants_video || report.frames.empty()) return;
  if (directory.claim_video())
    report.video = directory.write_video(report.frames, out);
  else
    out << folder << ": another process is making the review video" << std::endl;
}

}  // namespace

RenderReport render_session(const RenderOptions& options, std::ostream& out) {
  const RenderPlan plan = plan_render(options);
  const pipeline::Take& take = plan.take;
  const set::Set& set = take.set;
  const FrameRange range = plan.range;
  std::optional<SumsFolders> sums;
  if (!options.sums_from.empty())
    sums.emplace(options.sums_from, plan.settings, set.quality.samples);
  RenderDirectory directory(set.output, plan.settings, options.force, plan.clock,
                            options.share ? no_frames : range, options.stop, options.sample_range);

  RenderReport report;
  report.directory = directory.path();
  std::set<std::uint64_t> to_do;
  for (std::uint64_t frame = range.first; frame <= range.last; ++frame)
    if (options.is_left_out && options.is_left_out(frame))
      continue;
    else if (directory.finished(frame))
      ++report.found_finished;
    else
      to_do.insert(frame);
  for (const std::string& what : take.session.missing) out << "session: " << what << std::endl;
  report_opened(directory, report, /*was_read=*/!options.share, out);

  pipeline::Metrics metrics;
  const double start = now_s();
  const std::set<std::uint64_t> own =
      options.share ? directory.claim(to_do, *options.share) : to_do;
  if (!own.empty())
    render_all(options, take, own, directory, metrics, sums ? &*sums : nullptr, report, out);

  const auto at_others = directory.at_others(to_do);
  for (const std::uint64_t frame : own)
    if (options.share && !directory.finished(frame)) report.not_made.insert(frame);
  for (std::uint64_t frame = range.first; frame <= range.last; ++frame)
    if (const FinishedFrame* record = directory.finished(frame)) report.frames.push_back(*record);
  report.interrupted = options.stop.stop_requested();
  const bool wants_video = set.output.video && report.failures.empty();
  if (set.output.video && !wants_video)
    out << directory.path().string() << ": no review video, because frames are missing"
        << std::endl;
  if (!report.interrupted) finish_video(at_others, wants_video, directory, report, out);
  report.seconds = now_s() - start;
  report.metrics = metrics.snapshot(report.seconds);
  return report;
}

}  // namespace previz::post
