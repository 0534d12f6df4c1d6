#include "daemon/tools/farm/plan.hpp"

#include <fmt/chrono.h>

#include <algorithm>
#include <ctime>
#include <memory>

#include "daemon/core/pipeline/preview_size.hpp"
#include "daemon/core/pipeline/refinement.hpp"
#include "daemon/core/render/device/gpu.hpp"
#include "daemon/core/render/picture/sample_sums.hpp"
#include "daemon/core/scene/assets.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/tools/post/render_plan.hpp"
#include "daemon/tools/post/sample_ranges.hpp"
#include "drivers/error.hpp"

namespace previz::farm {
namespace {

// A pixel takes no more in files that are not compressed: the floats of all layers or of the sums,
// and a PNG of 16 bits.
constexpr std::uint64_t exr_bytes_a_pixel = 4 * 44, png_bytes_a_pixel = 6;

// Returns how many sample ranges a frame can be divided into with these settings.
int most_sample_ranges(const set::Quality& quality) {
  const bool divides = pipeline::has_fixed_samples(quality) && post::neighbours_of(quality) == 0;
  return divides ? render::part_count(quality.samples) : 1;
}

std::uint64_t frame_bytes(const post::RenderPlan& plan, double scale) {
  const PinholeIntrinsics picture = pipeline::scaled(plan.take.observer, scale).intrinsics;
  const auto pixels =
      static_cast<std::uint64_t>(picture.width) * static_cast<std::uint64_t>(picture.height);
  return pixels * (exr_bytes_a_pixel + png_bytes_a_pixel);
}

JobTake job_take(const post::RenderPlan& plan, const post::RenderOptions& options) {
  const set::Output& output = plan.take.set.output;
  JobTake take;
  take.session = std::filesystem::absolute(options.session).lexically_normal();
  if (!take.session.has_filename()) take.session = take.session.parent_path();  // "TAKE/"
  take.pictures = std::filesystem::absolute(output.directory).lexically_normal();
  take.frames = plan.range;
  take.settings = plan.settings;
  take.exr = output.exr;
  take.png = output.png || output.video;
  take.video = output.video;
  take.frame_bytes = frame_bytes(plan, options.scale);
  take.hardware_rays = plan.take.set.quality.hardware_rays;
  return take;
}

post::RenderOptions options_of(const FarmOptions& options, const std::filesystem::path& session) {
  post::RenderOptions one = options.render;
  one.session = session;
  if (one.directory && options.takes.size() > 1)
    one.directory =
        *one.directory / std::filesystem::absolute(session / "").parent_path().filename();
  return one;
}

std::string place_of_asset(const std::filesystem::path& file) {
  return "set/" + session::sha256_of(file).substr(0, 16) + file.extension().string();
}

// Returns the files that the set names, but for those that a take brings along.
std::vector<std::pair<std::string, std::filesystem::path>> own_assets(
    const post::RenderPlan& plan, const std::filesystem::path& session) {
  auto assets = scene::assets_of(plan.take.set);
  const auto& brought = plan.take.session.info.assets;
  std::erase_if(assets, [&](const auto& asset) {
    const auto found = brought.find(asset.first);
    return found != brought.end() &&
           asset.second == std::filesystem::absolute(session / found->second).lexically_normal();
  });
  return assets;
}

// Lists the files that tasks read in place of those that the command line named.
void add_set(const FarmOptions& options, const post::RenderPlan& plan, Job& job) {
  const bool has_set = options.render.set_file.has_value(),
             has_with = options.render.with.has_value();
  if (has_set) job.set_file = "set/" + options.render.set_file->filename().string();
  if (has_with) job.with_file = "set/with/" + options.render.with->filename().string();
  if (!has_set && !has_with) return;
  for (const auto& [as_written, file] : own_assets(plan, options.takes.front()))
    job.set_assets[as_written] = place_of_asset(file);
}

void divide(const FarmOptions& options, const std::vector<set::Quality>& qualities, Job& job) {
  Division division = options.division;
  division.most_sample_ranges = 1024;
  for (const set::Quality& quality : qualities) {
    if (const int ranges = division.sample_ranges.value_or(1); ranges > 1)
      post::check_sample_range({1, ranges}, quality);
    division.most_sample_ranges =
        std::min(division.most_sample_ranges, most_sample_ranges(quality));
    division.averages_neighbours |= post::neighbours_of(quality) > 0;
  }
  job.sample_ranges = sample_ranges_for(division, job.frames());
  job.share = share_for(division, job.frames(), job.sample_ranges);
}

}  // namespace

Job make_job(const FarmOptions& options) {
  Job job;
  job.software = "previzd " PREVIZ_VERSION;
  job.made = fmt::format("{:%Y-%m-%d %H:%M} UTC", fmt::gmtime(std::time(nullptr)));
  job.render = options.render;
  job.any_device = options.any_device;
  job.wishes = options.wishes;
  job.on_gpu = options.on_gpu ? *options.on_gpu
                              : render::is_gpu(*render::open_device(options.render.device));
  std::vector<set::Quality> qualities;
  for (const std::filesystem::path& session : options.takes) {
    const post::RenderOptions one = options_of(options, session);
    const post::RenderPlan plan = post::plan_render(one);
    if (job.takes.empty()) add_set(options, plan, job);
    job.takes.push_back(job_take(plan, one));
    qualities.push_back(plan.take.set.quality);
    const JobTake& added = job.takes.back();
    for (const JobTake& other : job.takes)
      if (&other != &added && other.pictures == added.pictures)
        throw Error(added.session.string() + " and " + other.session.string() +
                    " would have their pictures in one folder, " + added.pictures.string() +
                    "; give another one with --out, or make a job of each");
  }
  divide(options, qualities, job);
  return job;
}

void make_folder(const FarmOptions& options, const JobFolder& folder, const Job& job) {
  if (std::filesystem::exists(std::filesystem::symlink_status(folder.plan())))
    throw Error(folder.path().string() +
                ": a job is there already; `previz farm status` says how it goes, `previz farm "
                "retry` renders what it is missing, and --job gives another folder");
  for (const char* name : {"state", "log", "set/with"}) session::make_folders(folder.place(name));
  const auto copy = [&](const std::filesystem::path& from, const std::string& place) {
    std::error_code code;
    std::filesystem::copy_file(from, folder.place(place),
                               std::filesystem::copy_options::overwrite_existing, code);
    if (code)
      throw Error(folder.place(place).string() + ": cannot be copied from " + from.string() + ": " +
                  code.message());
  };
  if (!job.set_file.empty()) copy(*options.render.set_file, job.set_file);
  if (!job.with_file.empty()) copy(*options.render.with, job.with_file);
  if (!job.set_assets.empty()) {
    const post::RenderPlan plan = post::plan_render(options_of(options, options.takes.front()));
    for (const auto& [as_written, file] : own_assets(plan, options.takes.front()))
      copy(file, job.set_assets.at(as_written));
  }
  const std::string plan = to_json(job);
  job_from_json(plan, folder.plan().string());  // what no machine could read is not handed out
  session::replace_file(folder.plan(), plan);
}

}  // namespace previz::farm
