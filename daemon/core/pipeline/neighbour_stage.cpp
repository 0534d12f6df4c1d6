#include "daemon/core/pipeline/neighbour_stage.hpp"

#include <algorithm>
#include <iterator>
#include <limits>
#include <new>
#include <string>
#include <utility>

#include "daemon/core/render/picture/neighbours.hpp"
#include "drivers/error.hpp"

namespace previz::pipeline {

NeighbourStage::NeighbourStage(RenderStage& render, int neighbours)
    : render_(render), neighbours_(static_cast<std::uint64_t>(neighbours)) {}

std::vector<Shot> NeighbourStage::operator()(Shot shot) {
  std::vector<Shot> shown;
  const std::uint64_t index = shot.index;
  // Where shots before this one are missing, some may have all their neighbours already.
  if (index > 0) show_up_to(index - 1, shown);
  forget_before(waiting_.empty() ? index : waiting_.front().index);
  render::KeptFramePtr kept;
  if (!is_cancelled_) kept = keep(shot);
  const bool is_rendered = kept || !shot.untouched.empty();
  is_cancelled_ = is_cancelled_ || !is_rendered;
  if (kept) kept_.push_back({index, std::move(kept)});
  if (!shot.only_neighbour) waiting_.push_back(std::move(shot));
  show_up_to(index, shown);
  return shown;
}

std::vector<Shot> NeighbourStage::end(bool is_stopped) {
  is_cancelled_ = is_cancelled_ || is_stopped;
  std::vector<Shot> shown;
  show_up_to(std::numeric_limits<std::uint64_t>::max(), shown);
  kept_.clear();
  return shown;
}

// Shows those that wait for no shot after this one.
void NeighbourStage::show_up_to(std::uint64_t last_rendered, std::vector<Shot>& shown) {
  while (!waiting_.empty() &&
         (is_cancelled_ || last_rendered >= waiting_.front().index + neighbours_)) {
    Shot next = std::move(waiting_.front());
    waiting_.pop_front();
    if (is_cancelled_)
      next.whole = false;
    else if (next.untouched.empty())
      show(next);
    shown.push_back(std::move(next));
  }
}

void NeighbourStage::show(Shot& shot) {
  const std::uint64_t index = shot.index;
  const auto near = [&](std::uint64_t limit) {
    return std::ranges::lower_bound(kept_, limit, {}, &Kept::index);
  };
  const auto first = near(index - std::min(index, neighbours_)), own = near(index),
             last = near(index + neighbours_ + 1);
  std::vector<render::KeptFramePtr> chain;
  for (const int place :
       render::order_of_neighbours(static_cast<int>(own - first), static_cast<int>(last - own) - 1))
    chain.push_back((own + place)->frame);
  render_.show_among(shot, chain);
}

// Lets go of what is no neighbour of the shot with this index, nor of a later one.
void NeighbourStage::forget_before(std::uint64_t index) {
  while (!kept_.empty() && kept_.front().index + neighbours_ < index) kept_.pop_front();
}

render::KeptFramePtr NeighbourStage::keep(Shot& shot) {
  try {
    return render_.keep(shot);
  } catch (const std::bad_alloc&) {
    throw Error("quality.neighbours: " + std::to_string(kept_.size() + 1) + " frames of " +
                std::to_string(shot.frame->width) + "x" + std::to_string(shot.frame->height) +
                " do not fit into the computer's memory; lower it (--neighbours), 0 needs least");
  }
}

}  // namespace previz::pipeline
