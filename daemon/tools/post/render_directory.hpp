// Keeps the directory that a render leaves behind: pictures, a line per finished frame, and the
// settings of all of them. It knows which frames are finished, so that a run can go on where
// another ended, and which are at other processes, so that several can share the work.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <iosfwd>
#include <limits>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/render/picture/sample_sums.hpp"
#include "daemon/core/session/timecode.hpp"
#include "daemon/core/set/set.hpp"
#include "daemon/tools/post/finished_frame.hpp"
#include "daemon/tools/post/folder_locks.hpp"
#include "daemon/tools/post/render_files.hpp"

namespace previz::post {

// claim(), release() and write() are for several threads at once.
class RenderDirectory {
 public:
  // Makes the directory. `settings` is JSON: an object whose values decide what the pictures look
  // like. If it holds frames made with other settings, throws previz::Error naming the differences;
  // with `force` all frames, or those of `range` if the settings are the same, count as not
  // finished. While other processes render there, other settings are refused even so, and with the
  // same ones `force` is not in effect: what the others finish stays. `clock` is the take's. Reads
  // every file of the frames of `range` that are kept and compares size and SHA-256 with their
  // line; a file whose line has neither (of an older previzd) is decoded instead, and its line gets
  // them. A frame that is not whole is no longer finished: rejected() names it. A stop ends the
  // reading with previz::Error, and no line is changed. Throws previz::Error, too, where one of its
  // own files is a link. With `sample_range`, frames have sums of this range in place of pictures:
  // NNNN.sums.exr, or no file where the plate passes through untouched.
  RenderDirectory(const set::Output& output, const std::string& settings, bool force,
                  const session::TakeClock& clock = {}, FrameRange range = all_frames,
                  const std::stop_token& stop = {},
                  std::optional<render::SampleRange> sample_range = {});

  // Returns null if the frame is still to be rendered. A frame is finished if its line and all the
  // files that the set asks for are there, and, within the range, are whole. The record is valid
  // until another call.
  const FinishedFrame* finished(std::uint64_t frame) const;

  // Returns the frames of the range that left something behind and are not finished, by the reason:
  // "its .exr has another size than when it was written". Frames increase.
  const std::map<std::string, std::vector<std::uint64_t>>& rejected() const { return rejected_; }

  // Returns what else the opening found, in words: drafts of dead processes that were removed, who
  // else is at work here, that the file system has no locks.
  const std::vector<std::string>& notes() const { return notes_; }

  // Returns whether other processes were at work here when the folder was opened.
  bool has_others() const { return has_others_; }
  // Counts the frames of the range that are such as not finished, as long as this object lives, and
  // returns them; their lines and files stay.
  std::vector<FinishedFrame> reject(const std::function<bool(const FinishedFrame&)>& is_such);

  // Takes those of the frames that are neither finished nor at another process, the first of them
  // and at most `most`, and returns them. No other process takes any of them meanwhile.
  std::set<std::uint64_t> claim(const std::set<std::uint64_t>& frames,
                                std::uint64_t most = std::numeric_limits<std::uint64_t>::max());
  // Gives back a frame that was not written.
  void release(std::uint64_t frame);
  // Returns those of the frames that are neither finished nor free, by the process that has them:
  // "previz 4711 on host a, since 2026-11-25 14:03 UTC".
  std::map<std::string, std::vector<std::uint64_t>> at_others(
      const std::set<std::uint64_t>& frames);
  // Takes the review video, until this object ends; returns false if another process is making it.
  bool claim_video();

  // Writes the shot's files, then its line, which is on the medium after the return, and gives the
  // frame back. Whoever shares the directory has claimed it.
  void write(const pipeline::Shot& shot, const set::Set& set, const MadeOn& made_on = {});

  // Takes away the lines of these frames, which are then not finished; no file is removed.
  void forget(const std::vector<FinishedFrame>& frames);
  // Puts the lines in the order of the frames.
  void put_in_order();

  // Encodes the pictures of these frames to review.mp4 (or .mkv) and names the codec on `out`.
  std::filesystem::path write_video(const std::vector<FinishedFrame>& frames,
                                    std::ostream& out) const;

  const std::filesystem::path& path() const { return output_.directory; }

 private:
  std::filesystem::path file(std::uint64_t frame, const char* extension) const;
  // Returns the endings of the files that a frame has.
  std::vector<const char*> extensions(FrameStatus status) const;
  void write_files(const pipeline::Shot& shot, const set::Set& set) const;
  void begin(const std::string& settings, bool force, FrameRange range,
             const std::stop_token& stop);
  std::string differences_from(const std::string& settings) const;
  void read_lines();
  void write_lines(const Frames& frames) const;
  void verify(FrameRange range, const std::stop_token& stop);
  void reject_without_line(FrameRange range);

  const set::Output output_;
  const session::TakeClock clock_;
  const std::optional<render::SampleRange> sample_range_;
  std::vector<std::string> notes_;
  std::mutex mutex_;  // of all below
  std::optional<FolderLocks> locks_;
  std::string lines_state_;  // of frames.jsonl when it was read last
  std::map<std::uint64_t, FinishedFrame> finished_;
  std::map<std::string, std::vector<std::uint64_t>> rejected_;
  FrameRange range_;
  bool has_others_ = false;
};

}  // namespace previz::post
