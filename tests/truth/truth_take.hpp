// Writes a ground truth set as a recorded session with its set file, as a crew's recorder would.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/truth/truth_set.hpp"

namespace previz::truth {

enum class LightFrom { truth, captured };  // env.exr, or the fisheye frames
enum class PoseFrom { truth, tracked };    // the set's poses, or the tags in the pictures

struct TakeOptions {
  LightFrom light = LightFrom::truth;
  PoseFrom pose = PoseFrom::truth;
  // Lines for the set file's sections, "key = value".
  std::vector<std::string> lighting = {}, estimator = {};
  bool hides_tags = false;
};

// The set file: calibration is the session's, objects and environment its assets. Truth was
// rendered with at most 16 bounces.
std::string set_file_text(const TruthSet& set, const TakeOptions& options);

// An 8- or 16-bit PNG as a camera would have delivered it.
Frame frame_from_png(const std::filesystem::path& file, const char* source);

// Writes the session; the directory must not exist or be empty. The i-th observer frame of the
// session is set.frames[i]. True poses go into the track. Throws previz::Error naming the file that
// cannot be read or written, or what the set lacks for these options.
void write_take(const TruthSet& set, const TakeOptions& options,
                const std::filesystem::path& session);

// Place of a frame in the session's stream.
std::uint64_t session_index(const TruthSet& set, int frame);

}  // namespace previz::truth
