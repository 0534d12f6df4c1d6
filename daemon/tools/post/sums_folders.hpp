// Finds what `previz render --sample-range` made of a take, and merges it frame by frame.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "daemon/core/render/picture/sample_sums.hpp"
#include "daemon/tools/post/finished_frame.hpp"

namespace previz::post {

class SumsFolders {
 public:
  // Reads render.json and frames.jsonl of each folder. `settings` is that of the pictures to be
  // made (RenderDirectory), a JSON object: the folders must have the same, but for "sample_range".
  // Several folders may have different frames of one range. `samples` is the number of samples of a
  // pixel of the frames. Throws previz::Error naming the folder that has other settings or was not
  // made with --sample-range, or the range that no folder has.
  SumsFolders(const std::vector<std::filesystem::path>& folders, const std::string& settings,
              int samples);

  // Returns the sums of all samples of a frame. Throws previz::Error naming frame, range and file
  // where a range is missing, its file is not as it was written (size and SHA-256 in its line), or
  // what it contains does not go together with the other ranges.
  render::SampleSums merged(std::uint64_t frame,
                            const std::shared_ptr<render::Scratch>& scratch = {}) const;

 private:
  struct Folder {
    std::filesystem::path path;
    std::map<std::uint64_t, FinishedFrame> frames;
  };
  render::SampleSums sums_of(std::uint64_t frame, render::SampleRange range,
                             const std::shared_ptr<render::Scratch>& scratch) const;

  const int samples_;
  int count_ = 0;                               // of ranges
  std::map<int, std::vector<Folder>> folders_;  // by the range's index
};

}  // namespace previz::post
