// The plan of a job: which frames of which takes are rendered, with which settings, and how many of
// them by each task. Every task is the same command: it takes frames that no other has.
// It is written once, as JOB/job.json, and every machine reads it. It may come from elsewhere, so
// that what is read is data: nothing in it names a program or an argument of one.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
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
  int sample_ranges = 1;                          // that each frame's samples are rendered in
  std::uint64_t share = 1;  // frames, or sample ranges of frames, that a task renders at most
  Wishes wishes;
  std::vector<JobTake> takes;

  std::uint64_t frames() const;
  // Returns how many tasks render so many frames.
  std::uint64_t tasks(std::uint64_t frames) const;
};

// These write the plan as JSON and read it back. job_from_json() throws JobFault that begins with
// `name` and says what is wrong: not JSON, of another format, or a number out of its range.
std::string to_json(const Job& job);
Job job_from_json(const std::string& text, const std::string& name);

// Returns the number of frames in a range.
std::uint64_t length_of(const post::FrameRange& range);
// What is asked for when frames are divided.
struct Division {
  int machines = 8;                    // that share the work
  std::optional<std::uint64_t> chunk;  // frames; absent: by the number of machines
  std::optional<int> sample_ranges;    // of each frame; absent: by the number of machines
  int most_sample_ranges = 1;          // that the settings allow
  bool averages_neighbours = false;    // a task of many frames renders fewer of them twice
};

// Returns into how many sample ranges each of this number of frames is best divided: 1, unless
// there are fewer frames than machines.
int sample_ranges_for(const Division& division, std::uint64_t frames);
// Returns how many of the frames, each in so many sample ranges, a task renders at most.
std::uint64_t share_for(const Division& division, std::uint64_t frames, int sample_ranges);

}  // namespace previz::farm
