// Keeps the directory that a render leaves behind: pictures, a line per finished frame, and the
// settings of all of them. It knows which frames are finished, so that a run can go on where
// another ended.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <map>
#include <string>
#include <vector>

#include "daemon/pipeline/shot.hpp"
#include "daemon/post/finished_frame.hpp"
#include "daemon/set/set.hpp"
#include "drivers/session/timecode.hpp"

namespace previz::post {

class RenderDirectory {
 public:
  // Makes the directory. `settings` is JSON: an object whose values decide what the pictures look
  // like. If it holds frames made with other settings, throws previz::Error naming the differences;
  // with `force` these frames count as not finished. `clock` is the take's.
  RenderDirectory(const set::Output& output, const std::string& settings, bool force,
                  const session::TakeClock& clock = {});

  // Returns null if the frame is still to be rendered. A frame is finished if its line and all the
  // files that the set asks for are there.
  const FinishedFrame* finished(std::uint64_t frame) const;

  // Writes the shot's files, then its line.
  void write(const pipeline::Shot& shot, const set::Set& set);

  // Encodes the pictures of these frames to review.mp4 (or .mkv) and names the codec on `out`.
  std::filesystem::path write_video(const std::vector<FinishedFrame>& frames,
                                    std::ostream& out) const;

  const std::filesystem::path& path() const { return output_.directory; }

 private:
  std::filesystem::path file(std::uint64_t frame, const char* extension) const;
  bool wants_png() const { return output_.png || output_.video; }  // the video is made from PNGs
  void check_settings(const std::string& settings) const;
  void read_finished();

  const set::Output output_;
  const session::TakeClock clock_;
  std::map<std::uint64_t, FinishedFrame> finished_;
};

}  // namespace previz::post
