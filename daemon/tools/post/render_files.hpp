// Names the files in a folder of `previz render`, and says whether they are as they were written.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/set/set.hpp"
#include "daemon/tools/post/finished_frame.hpp"

namespace previz::post {

inline constexpr FrameRange all_frames{0, std::numeric_limits<std::uint64_t>::max()};
inline constexpr FrameRange no_frames{1, 0};
inline constexpr const char* settings_name = "render.json";
inline constexpr const char* lines_name = "frames.jsonl";
inline constexpr const char* sums_extension = ".sums.exr";

// Reads settings_name of a folder. Throws previz::Error where it cannot be read, is no plain file,
// or is larger than settings are.
std::string read_settings(const std::filesystem::path& folder);

// Returns "0007.exr" for frame 7 and ".exr".
std::string frame_file(std::uint64_t frame, const char* extension);

// Returns the frame whose file has this name, if it is that of a frame: "0007.exr".
std::optional<std::uint64_t> frame_of(const std::filesystem::path& name);

// Returns the endings of the files that a frame has where the set asks for this output: its
// pictures, a PNG also where there is a video, which is made of them; or the sums of a sample
// range, and nothing where the plate passes through untouched.
std::vector<const char*> extensions_of(const set::Output& output, bool has_sums,
                                       FrameStatus status);
// Returns whether all of them are there, as plain files.
bool has_files(const set::Output& output, bool has_sums, const FinishedFrame& frame);

using Frames = std::map<std::uint64_t, FinishedFrame>;

// Reads the lines of finished frames, of which there are none where there is no such file. A power
// cut may have left one half written: it counts for nothing. Throws previz::Error where the file
// cannot be read, or is no plain file.
Frames frames_in(const std::filesystem::path& lines);
// Returns the frames of the range of which the folder has a line and all files, without a look into
// these and without a lock. Throws like frames_in().
Frames finished_frames(const set::Output& output, bool has_sums = false,
                       FrameRange range = all_frames);

// Returns the settings that differ: "samples is 16 there and 64 now". Both are objects.
std::string differences(const nlohmann::json& there, const nlohmann::json& now);

// Returns the mark of a file that is there; throws previz::Error if it cannot be read.
FileMark mark_of(const std::filesystem::path& file);

// Returns why a file of a finished frame cannot be kept, as in "its .exr is missing", or an empty
// text. A line without any marks (`has_marks` is false) gets one for the file.
std::string why_broken(const std::filesystem::path& file, bool has_marks, FinishedFrame& record);

}  // namespace previz::post
