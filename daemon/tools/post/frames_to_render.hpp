// Says which frames of a take this process renders, where several share the take.
#pragma once

#include <cstdint>
#include <set>

#include "daemon/tools/post/render_directory.hpp"

namespace previz::post {

// Says which frames are rendered, and takes those to be written for this process. Where frames are
// averaged with their neighbours, it takes runs of them, because the neighbours beyond the ends of
// a run are rendered too: 16 frames, or half of a take that is shorter than two runs, so that two
// processes can share it. A run is taken when its first frame is asked for, or earlier, when a
// frame before it is a neighbour of no frame that this process writes so far, and would be one of
// that run's. The questions come in the order of the frames.
class FramesToRender {
 public:
  // `take_frames` is the length of the take. Both references must outlive this, and there must be a
  // frame to do.
  FramesToRender(RenderDirectory& directory, const std::set<std::uint64_t>& to_do, int neighbours,
                 std::uint64_t take_frames);

  std::uint64_t first() const;
  std::uint64_t last() const { return *to_do_.rbegin() + neighbours_; }
  bool is_written(std::uint64_t frame) const { return own_.contains(frame); }
  // True also for the neighbours of frames that are written.
  bool is_rendered(std::uint64_t frame);
  // This frame cannot be read. It is given back if it was taken, and is not left to others either.
  // It is called in the place of is_rendered().
  void leave_out(std::uint64_t frame);
  // Returns the frames that others have finished or are rendering.
  const std::set<std::uint64_t>& left() const { return left_; }

 private:
  bool is_near_own(std::uint64_t frame) const;
  void claim_to(std::uint64_t last);

  RenderDirectory& directory_;
  const std::set<std::uint64_t>& to_do_;
  const std::uint64_t neighbours_, run_;
  std::uint64_t next_run_;
  std::set<std::uint64_t> own_, left_, unreadable_;
};

}  // namespace previz::post
