// Runs the daemon's pipeline over a recorded session, without a clock and without drops, as
// `previz render` does.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <set>
#include <string>
#include <vector>

#include "daemon/core/pipeline/metrics.hpp"
#include "daemon/tools/post/finished_frame.hpp"
#include "daemon/tools/post/render_options.hpp"

namespace previz::post {

// Reads "7", "3-9" or "3-" (to the end); throws previz::Error saying what is allowed.
FrameRange parse_frame_range(const std::string& text);

struct RenderReport {
  std::filesystem::path directory;
  std::vector<FinishedFrame> frames;  // every finished frame of the range, in order
  std::size_t found_finished = 0;     // number that an earlier run had finished
  std::size_t at_others = 0;          // number that other processes are rendering; not in `frames`
  std::set<std::uint64_t> not_made;  // that this process took, and could not read or was stopped at
  bool interrupted = false;
  double seconds = 0;           // wall clock, without opening the session, scene and device
  std::filesystem::path video;  // empty: none was made
  pipeline::MetricsSnapshot metrics;
  // A sentence for each frame whose sums could not be had (RenderOptions::sums_from); the others
  // are made, but no video.
  std::vector<std::string> failures;
};

// Writes NNNN.exr and NNNN.png for every frame, then review.mp4 over all pictures of the range, and
//   DIR/render.json   the settings; a run with other settings refuses to mix its frames with these
//   DIR/frames.jsonl  a line a finished frame (FinishedFrame), with the SHA-256 of its files
//   DIR/render.lock   who is at work there (FolderLocks)
// Several processes may render into one DIR: each takes frames that no other is at, and whoever
// finishes the last frame of its range makes the video. A frame that a killed process had is
// rendered by another. Where frames are averaged with their neighbours (set::Quality::neighbours),
// a process takes runs of frames (FramesToRender), and renders the neighbours beyond them too,
// without writing these; a picture has the same bits whichever frames were asked for. Then every
// frame has random numbers of its own, by the set's seed and its number, and composite, mask and
// variance of its EXR file are those of the averaged picture. Where the memory for that is not
// there, nothing is rendered (refuse_too_many_neighbours()). What others are still rendering at the
// end is named. Frames that are finished, and whose files are as they were written, are skipped. A
// frame whose pose is lost, or that no light frame precedes, passes through untouched and is
// reported so; one that cannot be read is reported and left out. Progress and notes go to `out`.
// Throws previz::Error on anything that keeps the job from being done.
RenderReport render_session(const RenderOptions& options, std::ostream& out);

}  // namespace previz::post
