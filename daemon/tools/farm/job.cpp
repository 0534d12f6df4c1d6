#include "daemon/tools/farm/job.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <nlohmann/json.hpp>

#include "daemon/core/session/json_numbers.hpp"
#include "daemon/core/set/names.hpp"
#include "drivers/error.hpp"

namespace previz::farm {
namespace {

constexpr int format = 2;
constexpr std::uint64_t most_tasks = 100'000;
constexpr std::uint64_t most_frames = 1'000'000;  // of a take: eleven hours of it
// Each machine gets about four tasks, so that one that ends early takes another one.
constexpr std::uint64_t tasks_a_machine = 4;
// A task costs the opening of the take and the scene, and a longer one is lost for longer.
constexpr std::uint64_t largest_share = 64;
// Where frames are averaged with up to four on each side, these are rendered, too.
constexpr std::uint64_t least_averaged_share = 16;

using Json = nlohmann::ordered_json;

// One list of members (visit()) writes a plan, and reads it. A number is from `low` to `high`.
class Writer {
 public:
  explicit Writer(Json& json) : json_(json) {}
  template <typename T>
  void operator()(const char* key, const T& value, double = 0, double = 0) {
    json_[key] = value;
  }
  template <typename T>
  void operator()(const char* key, const std::optional<T>& value, double = 0, double = 0) {
    if (value) (*this)(key, *value);
  }
  void operator()(const char* key, const std::filesystem::path& path) {
    json_[key] = path.string();
  }
  void operator()(const char* key, const post::FrameRange& range) {
    json_[key] = {range.first, range.last};
  }
  void operator()(const char* key, set::Estimator estimator) {
    json_[key] = set::name_of(estimator);
  }

 private:
  Json& json_;
};

class Reader {
 public:
  explicit Reader(const Json& json) : json_(json) {}
  template <typename T>
  void operator()(const char* key, T& value, double low = 0, double high = 1e15) {
    if constexpr (std::is_arithmetic_v<T> && !std::is_same_v<T, bool>) {
      value = session::number_at<T>(json_, key);
      const auto number = static_cast<double>(value);
      if (!(number >= low && number <= high))
        throw Error(fmt::format("\"{}\" is {}, and not in {} to {}", key, number, low, high));
    } else {
      json_.at(key).get_to(value);
    }
  }
  template <typename T>
  void operator()(const char* key, std::optional<T>& value, double low = 0, double high = 1e15) {
    if (json_.contains(key)) (*this)(key, value.emplace(), low, high);
  }
  void operator()(const char* key, std::filesystem::path& path) {
    path = std::filesystem::path(json_.at(key).get<std::string>()).lexically_normal();
    if (!path.is_absolute()) throw Error(path.string() + ": is not a full path");
  }
  void operator()(const char* key, post::FrameRange& range) {
    range = {session::number_of<std::uint64_t>(json_.at(key).at(0)),
             session::number_of<std::uint64_t>(json_.at(key).at(1))};
    if (range.first > range.last || range.last >= most_frames)
      throw Error("a range of frames runs from " + std::to_string(range.first) + " to " +
                  std::to_string(range.last));
  }
  void operator()(const char* key, set::Estimator& estimator, double = 0, double = 0) {
    estimator = json_.at(key) == set::name_of(set::Estimator::paired) ? set::Estimator::paired
                                                                      : set::Estimator::difference;
  }

 private:
  const Json& json_;
};

// In all of these, what is visited is const where it is written.
template <typename Visitor, typename Options>
void visit_render(Visitor visit, Options& render) {
  visit("scale", render.scale, 0.05, 1);
  visit("samples", render.samples, 1, 1e6);
  visit("error", render.error, 0, 1);
  visit("adaptive", render.adaptive);
  visit("denoise", render.denoise);
  visit("neighbours", render.neighbours, 0, 4);
  visit("memory", render.memory);
  visit("scratch", render.scratch);
  visit("seconds", render.seconds, 0, 86'400);
  visit("seed", render.seed);
  visit("estimator", render.estimator);
  visit("hides_tags", render.hides_tags);
  visit("any_paths", render.any_paths);
  visit("device", render.device.name);
  visit("hardware_rays", render.device.hardware_rays);
}

template <typename Visitor, typename Take>
void visit_take(Visitor visit, Take& take) {
  visit("session", take.session);
  visit("pictures", take.pictures);
  visit("frames", take.frames);
  visit("settings", take.settings);
  visit("exr", take.exr);
  visit("png", take.png);
  visit("video", take.video);
  visit("frame_bytes", take.frame_bytes);
  visit("hardware_rays", take.hardware_rays);
}

template <typename Visitor, typename Plan>
void visit_job(Visitor visit, Plan& job) {
  visit("software", job.software);
  visit("made", job.made);
  visit("set_file", job.set_file);
  visit("with_file", job.with_file);
  visit("set_assets", job.set_assets);
  visit("on_gpu", job.on_gpu);
  visit("any_device", job.any_device);
  visit("sample_ranges", job.sample_ranges, 1, 1024);
  visit("share", job.share, 1);
  visit("at_once", job.wishes.at_once);
  visit("partition", job.wishes.partition);
  visit("time", job.wishes.time);
  visit("memory", job.wishes.memory);
}

void refuse_outside_of_folder(const std::string& place) {
  const std::filesystem::path path = std::filesystem::path(place).lexically_normal();
  if (!place.empty() && (path.is_absolute() || *path.begin() == ".."))
    throw Error(place + ": is not in the job's folder");
}

// A plan of an earlier previz names a chunk of frames for each task.
Json of_format_1(Json json) {
  std::uint64_t share = 1;
  for (const Json& chunk : json.at("chunks")) {
    post::FrameRange frames;
    Reader reader(chunk);
    reader("frames", frames);
    share = std::max(share, length_of(frames));
  }
  json["share"] = share;
  json.update(Json(json.at("wishes")));
  return json;
}

Job read(Json json) {
  if (session::number_or(json, "format", 0) == 1)
    json = of_format_1(std::move(json));
  else if (session::number_or(json, "format", 0) != format)
    throw Error("its format is not one that this previzd reads; use the previzd that made the job");
  Job job;
  visit_job(Reader(json), job);
  job.render.of_set_file = set::Origin::job;
  visit_render(Reader(json.at("render")), job.render);
  for (const Json& take : json.at("takes")) visit_take(Reader(take), job.takes.emplace_back());
  refuse_outside_of_folder(job.set_file);
  refuse_outside_of_folder(job.with_file);
  for (const auto& [name, place] : job.set_assets) refuse_outside_of_folder(place);
  if (!std::has_single_bit(static_cast<unsigned>(job.sample_ranges)))
    throw Error("\"sample_ranges\" is " + std::to_string(job.sample_ranges));
  if (job.takes.empty()) throw Error("it has no take");
  for (const JobTake& take : job.takes)
    if (!Json::accept(take.settings) || !Json::parse(take.settings).is_object())
      throw Error("the settings of a take are no JSON object");
  if (job.tasks(job.frames()) > most_tasks)
    throw Error("it has more than " + std::to_string(most_tasks) +
                " tasks; make several jobs of it, or give more frames to each with --chunk");
  return job;
}

}  // namespace

std::uint64_t length_of(const post::FrameRange& range) {
  return range.last - range.first + 1;
}

std::uint64_t Job::frames() const {
  std::uint64_t frames = 0;
  for (const JobTake& take : takes) frames += length_of(take.frames);
  return frames;
}

std::uint64_t Job::tasks(std::uint64_t frames) const {
  return (frames * static_cast<std::uint64_t>(sample_ranges) + share - 1) / share;
}

std::string to_json(const Job& job) {
  Json json{{"format", format}};
  visit_job(Writer(json), job);
  visit_render(Writer(json["render"]), job.render);
  for (const JobTake& take : job.takes) {
    Json one;
    visit_take(Writer(one), take);
    json["takes"].push_back(std::move(one));
  }
  try {
    return json.dump(1) + "\n";
  } catch (const nlohmann::json::exception&) {
    throw Error(
        "the job cannot be written: a path or a text in the set is not UTF-8; rename the file");
  }
}

Job job_from_json(const std::string& text, const std::string& name) {
  try {
    return read(Json::parse(text));
  } catch (const std::exception& error) {
    throw JobFault(name + ": is not a job's plan: " + error.what());
  }
}

int sample_ranges_for(const Division& division, std::uint64_t frames) {
  if (division.sample_ranges) return *division.sample_ranges;
  if (frames == 0) return 1;
  const std::uint64_t wanted = static_cast<std::uint64_t>(division.machines) / frames;
  const std::uint64_t allowed = static_cast<std::uint64_t>(division.most_sample_ranges);
  return static_cast<int>(std::bit_floor(std::clamp<std::uint64_t>(wanted, 1, allowed)));
}

std::uint64_t share_for(const Division& division, std::uint64_t frames, int sample_ranges) {
  if (division.chunk) return *division.chunk;
  if (sample_ranges > 1) return 1;
  const std::uint64_t wanted = tasks_a_machine * static_cast<std::uint64_t>(division.machines);
  const std::uint64_t least = division.averages_neighbours ? least_averaged_share : 1;
  return std::clamp((frames + wanted - 1) / wanted, least, largest_share);
}

}  // namespace previz::farm
