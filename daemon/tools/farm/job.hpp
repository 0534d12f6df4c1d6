// The plan of a job: which frames of which takes are rendered in which chunk, with which settings.
// It is written once, as JOB/job.json, and every machine reads it. It may come from elsewhere, so
// that what is read is data: nothing in it names a program or an argument of one.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "daemon/tools/post/finished_frame.hpp"
#include "daemon/tools/post/render_options.hpp"
#include "drivers/error.hpp"

namespace previz::farm {

// What is wrong with a job on every machine, so that no retry mends it.
class JobFault : public Error {
 public:
  using Error::Error;
};

// A take of the job.
struct JobTake {
  std::filesystem::path session;   // absolute
  std::filesystem::path pictures;  // folder of the finished pictures, absolute
  post::FrameRange frames;         // that are wanted
  std::string settings;            // the text of its render.json
  // Which files a frame has; a PNG also where there is a video, which is made of them.
  bool exr = true, png = true, video = true;
  std::uint64_t frame_bytes = 0;  // that the files of a frame take at most
  bool hardware_rays = true;      // quality.hardware_rays of its set
};

// What a task makes of its frames.
enum class ChunkKind {
  pictures,  // what `previz render` makes
  sums,      // the sums of one sample range of every frame
  merge      // the pictures of sums that other chunks made
};

struct Chunk {
  std::size_t take = 0;  // index in Job::takes
  post::FrameRange frames;
  ChunkKind kind = ChunkKind::pictures;
  int range = 0;  // of ChunkKind::sums: from 1 to Job::sample_ranges; otherwise 0
};

// What Slurm is asked for, in the words of sbatch(1). Empty: not asked for.
struct Wishes {
  int at_once = 0;  // tasks; 0: as many as there are machines
  std::string partition, time, memory;
};

struct Job {
  std::string software;        // the exact version that every machine must have
  std::string made;            // when, "2026-11-28 20:03 UTC"
  post::RenderOptions render;  // those that the settings of all takes are made with
  // The set that replaces the takes' own, and the overlay, by their places in the job's folder;
  // empty: none.
  std::string set_file, with_file;
  std::map<std::string, std::string> set_assets;  // as the set writes them: place in the folder
  bool on_gpu = false;                            // every frame is rendered on a graphics card
  bool any_device = false;                        // or on whatever there is
  int sample_ranges = 1;
  Wishes wishes;
  std::vector<JobTake> takes;
  std::vector<Chunk> chunks;  // those of ChunkKind::merge come last

  // Returns the number of chunks that need no other.
  std::size_t first_merge() const;
};

// These write the plan as JSON and read it back. job_from_json() throws JobFault that begins with
// `name` and says what is wrong: not JSON, of another format, a number out of its range, or chunks
// that are not the frames of the takes, each once.
std::string to_json(const Job& job);
Job job_from_json(const std::string& text, const std::string& name);

// Returns the number of frames in a range.
std::uint64_t length_of(const post::FrameRange& range);
// Returns the number of the chunk as its folder and its log have it: at least four digits.
std::string chunk_number(std::size_t chunk);
// Returns "frames 12 to 15 of 12A_take003", "frame 7 of 12A_take003, sample range 2 of 4".
std::string words_of(const Job& job, const Chunk& chunk);

// What is asked for when frames are divided.
struct Division {
  int machines = 8;                    // that share the work
  std::optional<std::uint64_t> chunk;  // frames; absent: by the number of machines
  std::optional<int> sample_ranges;    // of each frame; absent: by the number of machines
  int most_sample_ranges = 1;          // that the settings allow
  bool averages_neighbours = false;    // long chunks render fewer frames twice
};

// Returns into how many sample ranges each of this number of frames is best divided: 1, unless
// there are fewer frames than machines.
int sample_ranges_for(const Division& division, std::uint64_t frames);
// Appends the chunks of these frames of a take: runs of frames without a gap, all but the
// last one of a run of the same length.
void divide(const std::set<std::uint64_t>& frames, std::size_t take, int sample_ranges,
            const Division& division, std::vector<Chunk>& chunks);

}  // namespace previz::farm
