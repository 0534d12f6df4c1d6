#include "daemon/tools/post/sums_folders.hpp"

#include <nlohmann/json.hpp>
#include <tuple>
#include <utility>

#include "daemon/core/output/sums_exr.hpp"
#include "daemon/tools/post/render_files.hpp"
#include "daemon/tools/post/sample_ranges.hpp"
#include "drivers/error.hpp"

namespace previz::post {
namespace {

constexpr const char* range_key = "sample_range";

nlohmann::json settings_in(const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / settings_name;
  std::error_code unknown;
  if (!std::filesystem::exists(file, unknown))
    throw Error(folder.string() + ": has no " + settings_name +
                "; name folders that `previz render --sample-range` has made");
  auto json = nlohmann::json::parse(read_settings(folder), nullptr,
                                    /*allow_exceptions=*/false);
  if (!json.is_object() || !json.contains(range_key) || !json[range_key].is_string())
    throw Error(file.string() +
                (json.is_object()
                     ? ": was not written with --sample-range: its frames are whole pictures"
                     : ": cannot be read"));
  return json;
}

}  // namespace

SumsFolders::SumsFolders(const std::vector<std::filesystem::path>& folders,
                         const std::string& settings, int samples)
    : samples_(samples) {
  const nlohmann::json now = nlohmann::json::parse(settings);
  for (const std::filesystem::path& path : folders) {
    nlohmann::json there = settings_in(path);
    const render::SampleRange range = parse_sample_range(there[range_key].get<std::string>());
    there.erase(range_key);
    if (there != now)
      throw Error((path / settings_name).string() +
                  ": its samples were rendered with other settings (" + differences(there, now) +
                  "); give the options to this command that they were rendered with");
    if (count_ != 0 && count_ != range.count)
      throw Error((path / settings_name).string() + ": is one of " + std::to_string(range.count) +
                  " ranges, and the folders before it are of " + std::to_string(count_));
    count_ = range.count;
    folders_[range.index].push_back({path, frames_in(path / lines_name)});
  }
  for (int index = 1; index <= count_; ++index)
    if (const std::string range = to_string(render::SampleRange{index, count_});
        !folders_.contains(index))
      throw Error("no folder has the samples of range " + range +
                  "; render them with --sample-range " + range + " and name its folder, too");
}

render::SampleSums SumsFolders::merged(std::uint64_t frame,
                                       const std::shared_ptr<render::Scratch>& scratch) const {
  render::SumTree tree;
  std::tuple<int, int, bool> of_first;  // the size, and whether there are photons
  for (int index = 1; index <= count_; ++index) {
    const render::SampleRange range{index, count_};
    render::SampleSums sums = sums_of(frame, range, scratch);
    const std::tuple own{sums.width, sums.height, !sums.sums.caustics.empty()};
    if (index == 1) of_first = own;
    if (own != of_first)
      throw Error("frame " + std::to_string(frame) + ": sample range " + to_string(range) +
                  " has another size than range 1, or only one of the two has photons; render both "
                  "again");
    tree.add(std::move(sums));
  }
  return tree.take();
}

render::SampleSums SumsFolders::sums_of(std::uint64_t frame, render::SampleRange range,
                                        const std::shared_ptr<render::Scratch>& scratch) const {
  const std::string what =
      "frame " + std::to_string(frame) + ": sample range " + to_string(range) + ": ";
  const std::string again = "; render it again with --sample-range " + to_string(range) +
                            " --frames " + std::to_string(frame);
  const std::string name = frame_file(frame, sums_extension);
  std::string why;
  for (const Folder& folder : folders_.at(range.index)) {
    const auto found = folder.frames.find(frame);
    if (found == folder.frames.end()) continue;
    const std::filesystem::path file = folder.path / name;
    FinishedFrame record = found->second;
    why = folder.path.string() + ": ";
    if (record.status == FrameStatus::untouched) {
      why += "the plate passed through untouched there: " + record.reason;
      continue;
    }
    if (const std::string broken = why_broken(file, !record.files.empty(), record);
        !broken.empty()) {
      why += broken;
      continue;
    }
    output::RangeSums read = output::read_sums_exr(file, scratch);
    if (read.frame == frame && read.range == range &&
        read.sums.samples == render::samples_of(range, samples_).count)
      return std::move(read.sums);
    why += name + " has the samples of frame " + std::to_string(read.frame) + ", range " +
           to_string(read.range);
  }
  if (why.empty())
    why = "no line of " + (folders_.at(range.index).front().path / lines_name).string() +
          " is of this frame";
  throw Error(what + why + again);
}

}  // namespace previz::post
