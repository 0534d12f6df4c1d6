// These read the folder of a farm's job, which may come from elsewhere: its plan, the lines of
// its frames, and the sums that its tasks merge.
#include <array>
#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "daemon/core/output/sums_exr.hpp"
#include "daemon/tools/farm/job.hpp"
#include "daemon/tools/post/finished_frame.hpp"
#include "drivers/error.hpp"
#include "tests/fuzz/mutators.hpp"
#include "tests/fuzz/targets.hpp"

namespace previz::fuzz {
namespace farm_targets_cpp {

void read_job_plan(Bytes bytes) {
  const farm::Job job = farm::job_from_json(text_of(bytes), "job.json");
  expect(job.tasks(job.frames()) > 0 && job.tasks(job.frames()) <= 100'000, "there are tasks");
  for (const farm::JobTake& take : job.takes)
    expect(take.pictures.is_absolute() && take.session.is_absolute(), "paths are full ones");
  const std::string text = farm::to_json(job);
  expect(farm::to_json(farm::job_from_json(text, "job.json")) == text,
         "what is read and written is read again");
}

// Sums that are read are those of every pixel, and are read again with the same bits.
void read_sums(Bytes bytes) {
  const output::RangeSums first = output::read_sums_exr(file_of(bytes, "sums.exr"));
  const std::size_t pixels =
      static_cast<std::size_t>(first.sums.width) * static_cast<std::size_t>(first.sums.height);
  expect(first.sums.sums.pixels.size() == pixels, "every pixel has its sums");
  expect(first.sums.sums.caustics.empty() || first.sums.sums.caustics.size() == pixels,
         "every pixel has caustics, or none");
  const std::filesystem::path file = work_folder() / "again.exr";
  output::write_sums_exr(file, first);
  const output::RangeSums second = output::read_sums_exr(file);
  expect(std::memcmp(first.sums.sums.pixels.data(), second.sums.sums.pixels.data(),
                     pixels * sizeof(gpu::GpuPixel)) == 0,
         "what is read and written is read again");
}

// A line that is read and written is the same when it is read again.
void read_finished_line(Bytes bytes) {
  const auto read = [](const std::string& line) {
    try {
      return post::from_json(line);
    } catch (const nlohmann::json::exception& error) {
      throw Error(error.what());
    } catch (const std::invalid_argument& error) {
      throw Error(error.what());
    }
  };
  const std::string line = post::to_json(read(text_of(bytes)));
  expect(post::to_json(read(line)) == line, "what is read and written is read again");
}

constexpr std::array<Target, 3> all{
    {{"job_plan", "the plan of a farm's job", read_job_plan, mutate_json},
     {"finished_line", "a line of a render's frames.jsonl", read_finished_line, mutate_json},
     {"sums", "the sums of a range of a frame's samples: OpenEXR", read_sums}}};

}  // namespace farm_targets_cpp

std::span<const Target> farm_targets() {
  return farm_targets_cpp::all;
}

}  // namespace previz::fuzz
