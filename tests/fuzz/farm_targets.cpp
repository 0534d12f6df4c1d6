// The plan of a farm's job, which lies in a folder that may come from elsewhere.
#include <array>

#include "daemon/farm/job.hpp"
#include "tests/fuzz/mutators.hpp"
#include "tests/fuzz/targets.hpp"

namespace previz::fuzz {
namespace farm_targets_cpp {

bool has_its_frames(const farm::Job& job) {
  std::uint64_t wanted = 0, pictures = 0;
  for (const farm::JobTake& take : job.takes) wanted += take.frames.last - take.frames.first + 1;
  for (const farm::Chunk& chunk : job.chunks)
    if (chunk.kind != farm::ChunkKind::sums) pictures += chunk.frames.last - chunk.frames.first + 1;
  return wanted == pictures;
}

void read_job_plan(Bytes bytes) {
  const farm::Job job = farm::job_from_json(text_of(bytes), "job.json");
  expect(has_its_frames(job), "chunks have every frame of the takes once");
  for (const farm::JobTake& take : job.takes)
    expect(take.pictures.is_absolute() && take.session.is_absolute(), "paths are full ones");
  const std::string text = farm::to_json(job);
  expect(farm::to_json(farm::job_from_json(text, "job.json")) == text,
         "what is read and written is read again");
}

constexpr std::array<Target, 1> all{
    {{"job_plan", "the plan of a farm's job", read_job_plan, mutate_json}}};

}  // namespace farm_targets_cpp

std::span<const Target> farm_targets() {
  return farm_targets_cpp::all;
}

}  // namespace previz::fuzz
