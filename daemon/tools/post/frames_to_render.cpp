#include "daemon/tools/post/frames_to_render.hpp"

#include <algorithm>
#include <iterator>

namespace previz::post {
namespace {

// Longer runs share a take less evenly; of shorter ones more frames are rendered twice.
constexpr std::uint64_t longest_run = 16;

std::uint64_t run_of(std::uint64_t take_frames) {
  return std::clamp<std::uint64_t>(take_frames / 2 + take_frames % 2, 1, longest_run);
}

}  // namespace

FramesToRender::FramesToRender(RenderDirectory& directory, const std::set<std::uint64_t>& to_do,
                               int neighbours, std::uint64_t take_frames)
    : directory_(directory),
      to_do_(to_do),
      neighbours_(static_cast<std::uint64_t>(neighbours)),
      run_(neighbours > 0 ? run_of(take_frames) : 1),
      next_run_(*to_do.begin() / run_) {}

std::uint64_t FramesToRender::first() const {
  return *to_do_.begin() - std::min(*to_do_.begin(), neighbours_);
}

bool FramesToRender::is_rendered(std::uint64_t frame) {
  claim_to(frame);
  if (!is_near_own(frame)) claim_to(frame + neighbours_);
  return is_near_own(frame);
}

void FramesToRender::leave_out(std::uint64_t frame) {
  unreadable_.insert(frame);
  left_.erase(frame);
  if (own_.erase(frame) > 0) directory_.release(frame);
}

// Returns whether the frame, or one that it is a neighbour of, is written as far as is known.
bool FramesToRender::is_near_own(std::uint64_t frame) const {
  const auto nearest = own_.lower_bound(frame - std::min(frame, neighbours_));
  return nearest != own_.end() && *nearest <= frame + neighbours_;
}

void FramesToRender::claim_to(std::uint64_t last) {
  for (; next_run_ <= last / run_; ++next_run_) {
    std::set<std::uint64_t> run(to_do_.lower_bound(next_run_ * run_),
                                to_do_.lower_bound((next_run_ + 1) * run_));
    for (const std::uint64_t frame : unreadable_) run.erase(frame);
    if (run.empty()) continue;
    const std::set<std::uint64_t> taken = directory_.claim(run);
    own_.insert(taken.begin(), taken.end());
    std::ranges::set_difference(run, taken, std::inserter(left_, left_.end()));
  }
}

}  // namespace previz::post
