#include "daemon/tools/farm/job.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <nlohmann/json.hpp>
#include <string_view>

#include "daemon/core/session/json_numbers.hpp"
#include "daemon/core/set/names.hpp"
#include "drivers/error.hpp"

namespace previz::farm {
namespace {

constexpr int format = 1;
constexpr std::size_t most_chunks = 100'000;
constexpr std::uint64_t most_frames = 1'000'000;  // of a take: eleven hours of it
constexpr std::array<const char*, 3> kinds{"pictures", "sums", "merge"};
// Each machine gets about four tasks, so that one that ends early takes another one.
constexpr std::uint64_t chunks_a_machine = 4;
// A chunk costs the opening of the take and the scene, and a longer one is lost for longer.
constexpr std::uint64_t longest_chunk = 64;
// Where frames are averaged with up to four on each side, these are rendered, too.
constexpr std::uint64_t least_averaged_chunk = 16;

using Json = nlohmann::ordered_json;

template <typename T>
void put(Json& json, const char* key, const std::optional<T>& value) {
  if (value) json[key] = *value;
}

template <typename T>
void get(const Json& json, const char* key, std::optional<T>& value) {
  if (!json.contains(key)) return;
  if constexpr (std::same_as<T, bool>)
    value = json.at(key).get<bool>();
  else
    value = session::number_at<T>(json, key);
}

Json json_of(const post::RenderOptions& options) {
  Json json;
  json["scale"] = options.scale;
  put(json, "samples", options.samples);
  put(json, "error", options.error);
  put(json, "adaptive", options.adaptive);
  put(json, "denoise", options.denoise);
  put(json, "neighbours", options.neighbours);
  put(json, "seconds", options.seconds);
  put(json, "seed", options.seed);
  if (options.estimator) json["estimator"] = set::name_of(*options.estimator);
  put(json, "hides_tags", options.hides_tags);
  json["any_paths"] = options.any_paths;
  json["device"] = options.device.name;
  put(json, "hardware_rays", options.device.hardware_rays);
  return json;
}

post::RenderOptions options_of(const Json& json) {
  post::RenderOptions options;
  options.of_set_file = set::Origin::job;
  options.scale = session::number_at<decltype(options.scale)>(json, "scale");
  if (!(options.scale >= 0.05 && options.scale <= 1)) throw Error("\"scale\" is not in 0.05 to 1");
  get(json, "samples", options.samples);
  if (options.samples && (*options.samples < 1 || *options.samples > 1'000'000))
    throw Error("\"samples\" is not in 1 to 1000000");
  get(json, "error", options.error);
  if (options.error && !(*options.error >= 0 && *options.error <= 1))
    throw Error("\"error\" is not in 0 to 1");
  get(json, "adaptive", options.adaptive);
  get(json, "denoise", options.denoise);
  get(json, "neighbours", options.neighbours);
  if (options.neighbours && (*options.neighbours < 0 || *options.neighbours > 4))
    throw Error("\"neighbours\" is not in 0 to 4");
  get(json, "seconds", options.seconds);
  if (options.seconds && !(*options.seconds >= 0 && *options.seconds <= 86'400))
    throw Error("\"seconds\" is not in 0 to 86400");
  get(json, "seed", options.seed);
  if (json.contains("estimator"))
    options.estimator = json.at("estimator") == set::name_of(set::Estimator::paired)
                            ? set::Estimator::paired
                            : set::Estimator::difference;
  get(json, "hides_tags", options.hides_tags);
  json.at("any_paths").get_to(options.any_paths);
  json.at("device").get_to(options.device.name);
  get(json, "hardware_rays", options.device.hardware_rays);
  return options;
}

Json range_json(const post::FrameRange& range) {
  return {range.first, range.last};
}

post::FrameRange range_of(const Json& json) {
  const post::FrameRange range{session::number_of<std::uint64_t>(json.at(0)),
                               session::number_of<std::uint64_t>(json.at(1))};
  if (range.first > range.last || range.last >= most_frames)
    throw Error("a range of frames runs from " + std::to_string(range.first) + " to " +
                std::to_string(range.last));
  return range;
}

std::filesystem::path absolute_path(const Json& json) {
  auto path = std::filesystem::path(json.get<std::string>()).lexically_normal();
  if (!path.is_absolute()) throw Error(path.string() + ": is not a full path");
  return path;
}

// Returns a place below the job's folder.
std::string place_in_folder(const Json& json) {
  auto place = json.get<std::string>();
  const std::filesystem::path path = std::filesystem::path(place).lexically_normal();
  if (!place.empty() && (path.is_absolute() || *path.begin() == ".."))
    throw Error(place + ": is not in the job's folder");
  return place;
}

JobTake take_of(const Json& json) {
  JobTake take;
  take.session = absolute_path(json.at("session"));
  take.pictures = absolute_path(json.at("pictures"));
  take.frames = range_of(json.at("frames"));
  json.at("settings").get_to(take.settings);
  if (!Json::accept(take.settings) || !Json::parse(take.settings).is_object())
    throw Error("the settings of a take are no JSON object");
  json.at("exr").get_to(take.exr);
  json.at("png").get_to(take.png);
  json.at("video").get_to(take.video);
  take.frame_bytes = session::number_at<std::uint64_t>(json, "frame_bytes");
  json.at("hardware_rays").get_to(take.hardware_rays);
  return take;
}

Chunk chunk_of(const Json& json, const Job& job) {
  Chunk chunk;
  chunk.take = session::number_at<std::size_t>(json, "take");
  if (chunk.take >= job.takes.size()) throw Error("a chunk is of a take that there is not");
  chunk.frames = range_of(json.at("frames"));
  const auto kind = std::ranges::find(kinds, json.at("kind").get<std::string_view>());
  if (kind == kinds.end()) throw Error("a chunk is of an unknown kind");
  chunk.kind = static_cast<ChunkKind>(kind - kinds.begin());
  chunk.range = session::number_or(json, "range", 0);
  const bool has_range = chunk.kind == ChunkKind::sums;
  if (has_range ? chunk.range < 1 || chunk.range > job.sample_ranges : chunk.range != 0)
    throw Error("a chunk is of sample range " + std::to_string(chunk.range) + " of " +
                std::to_string(job.sample_ranges));
  return chunk;
}

// Throws unless the chunks have every frame of every take once, in their order: as pictures, or
// merged and in every sample range.
void check_cover(const Job& job) {
  const auto refuse = [](std::uint64_t frame) {
    throw Error("its chunks do not have every frame once: frame " + std::to_string(frame) +
                " is not where it belongs");
  };
  const bool in_ranges = job.first_merge() < job.chunks.size();
  std::vector<std::vector<std::uint64_t>> next;  // frame, by take and range
  for (const JobTake& take : job.takes)
    next.emplace_back(in_ranges ? job.sample_ranges + 1 : 1, take.frames.first);
  for (const Chunk& chunk : job.chunks) {
    const auto range = static_cast<std::size_t>(chunk.range);
    const bool is_pictures = chunk.kind == ChunkKind::pictures;
    if (range >= next[chunk.take].size() || is_pictures == in_ranges) refuse(chunk.frames.first);
    if (chunk.frames.first != next[chunk.take][range]) refuse(chunk.frames.first);
    next[chunk.take][range] = chunk.frames.last + 1;
  }
  for (std::size_t take = 0; take < job.takes.size(); ++take)
    for (const std::uint64_t frame : next[take])
      if (frame != job.takes[take].frames.last + 1) refuse(frame);
  if (job.takes.empty()) throw Error("it has no take");
}

Job read(const Json& json) {
  if (session::number_or(json, "format", 0) != format)
    throw Error("its format is not the one that this previzd writes, " + std::to_string(format) +
                "; use the previzd that made the job");
  Job job;
  json.at("software").get_to(job.software);
  json.at("made").get_to(job.made);
  job.render = options_of(json.at("render"));
  job.set_file = place_in_folder(json.at("set_file"));
  job.with_file = place_in_folder(json.at("with_file"));
  for (const auto& [name, place] : json.at("set_assets").items())
    job.set_assets[name] = place_in_folder(place);
  json.at("on_gpu").get_to(job.on_gpu);
  json.at("any_device").get_to(job.any_device);
  job.sample_ranges = session::number_at<int>(json, "sample_ranges");
  if (job.sample_ranges < 1 || job.sample_ranges > 1024 ||
      !std::has_single_bit(static_cast<unsigned>(job.sample_ranges)))
    throw Error("\"sample_ranges\" is " + std::to_string(job.sample_ranges));
  const Json& wishes = json.at("wishes");
  job.wishes.at_once = session::number_at<int>(wishes, "at_once");
  wishes.at("partition").get_to(job.wishes.partition);
  wishes.at("time").get_to(job.wishes.time);
  wishes.at("memory").get_to(job.wishes.memory);
  for (const Json& take : json.at("takes")) job.takes.push_back(take_of(take));
  if (json.at("chunks").size() > most_chunks)
    throw Error("it has more than " + std::to_string(most_chunks) +
                " chunks; make several jobs of it, or give longer chunks with --chunk");
  for (const Json& chunk : json.at("chunks")) job.chunks.push_back(chunk_of(chunk, job));
  for (std::size_t i = job.first_merge(); i < job.chunks.size(); ++i)
    if (job.chunks[i].kind != ChunkKind::merge) throw Error("its chunks are not in their order");
  check_cover(job);
  return job;
}

}  // namespace

std::uint64_t length_of(const post::FrameRange& range) {
  return range.last - range.first + 1;
}

std::size_t Job::first_merge() const {
  const auto merge = std::ranges::find(chunks, ChunkKind::merge, &Chunk::kind);
  return static_cast<std::size_t>(merge - chunks.begin());
}

std::string to_json(const Job& job) {
  Json json;
  json["format"] = format;
  json["software"] = job.software;
  json["made"] = job.made;
  json["render"] = json_of(job.render);
  json["set_file"] = job.set_file;
  json["with_file"] = job.with_file;
  json["set_assets"] = job.set_assets;
  json["on_gpu"] = job.on_gpu;
  json["any_device"] = job.any_device;
  json["sample_ranges"] = job.sample_ranges;
  json["wishes"] = {{"at_once", job.wishes.at_once},
                    {"partition", job.wishes.partition},
                    {"time", job.wishes.time},
                    {"memory", job.wishes.memory}};
  json["takes"] = Json::array();
  for (const JobTake& take : job.takes)
    json["takes"].push_back({{"session", take.session.string()},
                             {"pictures", take.pictures.string()},
                             {"frames", range_json(take.frames)},
                             {"settings", take.settings},
                             {"exr", take.exr},
                             {"png", take.png},
                             {"video", take.video},
                             {"frame_bytes", take.frame_bytes},
                             {"hardware_rays", take.hardware_rays}});
  json["chunks"] = Json::array();
  for (const Chunk& chunk : job.chunks) {
    Json one{{"take", chunk.take},
             {"frames", range_json(chunk.frames)},
             {"kind", kinds[static_cast<std::size_t>(chunk.kind)]}};
    if (chunk.range > 0) one["range"] = chunk.range;
    json["chunks"].push_back(std::move(one));
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

std::string chunk_number(std::size_t chunk) {
  std::string number = std::to_string(chunk);
  return std::string(number.size() < 4 ? 4 - number.size() : 0, '0') + number;
}

std::string words_of(const Job& job, const Chunk& chunk) {
  const auto& [first, last] = chunk.frames;
  std::string text = first == last
                         ? "frame " + std::to_string(first)
                         : "frames " + std::to_string(first) + " to " + std::to_string(last);
  text += " of " + job.takes.at(chunk.take).session.filename().string();
  if (chunk.kind == ChunkKind::sums)
    text += ", sample range " + std::to_string(chunk.range) + " of " +
            std::to_string(job.sample_ranges);
  if (chunk.kind == ChunkKind::merge) text += ", merged";
  return text;
}

int sample_ranges_for(const Division& division, std::uint64_t frames) {
  if (division.sample_ranges) return *division.sample_ranges;
  if (frames == 0) return 1;
  const std::uint64_t wanted = static_cast<std::uint64_t>(division.machines) / frames;
  const std::uint64_t allowed = static_cast<std::uint64_t>(division.most_sample_ranges);
  return static_cast<int>(std::bit_floor(std::clamp<std::uint64_t>(wanted, 1, allowed)));
}

void divide(const std::set<std::uint64_t>& frames, std::size_t take, int sample_ranges,
            const Division& division, std::vector<Chunk>& chunks) {
  const std::uint64_t count = frames.size();
  const std::uint64_t wanted = chunks_a_machine * static_cast<std::uint64_t>(division.machines);
  const std::uint64_t least = division.averages_neighbours ? least_averaged_chunk : 1;
  std::uint64_t length =
      division.chunk.value_or(std::clamp((count + wanted - 1) / wanted, least, longest_chunk));
  if (sample_ranges > 1 && !division.chunk) length = 1;
  std::vector<post::FrameRange> runs;
  for (const std::uint64_t frame : frames) {
    const bool follows = !runs.empty() && runs.back().last + 1 == frame;
    if (follows && frame - runs.back().first < length)
      runs.back().last = frame;
    else
      runs.push_back({frame, frame});
  }
  const ChunkKind kind = sample_ranges > 1 ? ChunkKind::sums : ChunkKind::pictures;
  for (const post::FrameRange& run : runs)
    for (int range = 1; range <= sample_ranges; ++range)
      chunks.push_back({take, run, kind, sample_ranges > 1 ? range : 0});
  if (sample_ranges == 1) return;
  for (const post::FrameRange& run : runs) chunks.push_back({take, run, ChunkKind::merge, 0});
}

}  // namespace previz::farm
