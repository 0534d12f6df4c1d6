// Keeps the directory that a render leaves behind: pictures, a line per finished frame, and the
// settings of all of them. It knows which frames are finished, so that a run can go on where
// another ended.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <limits>
#include <map>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/pipeline/shot.hpp"
#include "daemon/post/finished_frame.hpp"
#include "daemon/set/set.hpp"
#include "drivers/session/timecode.hpp"

namespace previz::post {

class RenderDirectory {
 public:
  static constexpr FrameRange all_frames{0, std::numeric_limits<std::uint64_t>::max()};

  // Makes the directory. `settings` is JSON: an object whose values decide what the pictures look
  // like. If it holds frames made with other settings, throws previz::Error naming the differences;
  // with `force` these frames count as not finished. `clock` is the take's. Reads every file of the
  // frames of `range` that are kept and compares size and SHA-256 with their line; a file whose
  // line has neither (of an older previzd) is decoded instead, and its line gets them. A frame that
  // is not whole is no longer finished: rejected() names it. A stop ends the reading with
  // previz::Error, and nothing is changed.
  RenderDirectory(const set::Output& output, const std::string& settings, bool force,
                  const session::TakeClock& clock = {}, FrameRange range = all_frames,
                  const std::stop_token& stop = {});

  // Returns null if the frame is still to be rendered. A frame is finished if its line and all the
  // files that the set asks for are there, and, within the range, are whole.
  const FinishedFrame* finished(std::uint64_t frame) const;

  // Returns the frames of the range that left something behind and are not finished, by the reason:
  // "its .exr has another size than when it was written". Frames increase.
  const std::map<std::string, std::vector<std::uint64_t>>& rejected() const { return rejected_; }

  // Writes the shot's files, then its line, which is on the medium after the return.
  void write(const pipeline::Shot& shot, const set::Set& set);

  // Encodes the pictures of these frames to review.mp4 (or .mkv) and names the codec on `out`.
  std::filesystem::path write_video(const std::vector<FinishedFrame>& frames,
                                    std::ostream& out) const;

  const std::filesystem::path& path() const { return output_.directory; }

 private:
  std::filesystem::path file(std::uint64_t frame, const char* extension) const;
  std::vector<const char*> extensions() const;  // of the files that the set asks for
  bool wants_png() const { return output_.png || output_.video; }  // the video is made from PNGs
  void check_settings(const std::string& settings) const;
  void read_finished();
  void reject_broken(FrameRange range, const std::stop_token& stop);
  void reject_without_line(FrameRange range);

  const set::Output output_;
  const session::TakeClock clock_;
  std::map<std::uint64_t, FinishedFrame> finished_;
  std::map<std::string, std::vector<std::uint64_t>> rejected_;
};

}  // namespace previz::post
