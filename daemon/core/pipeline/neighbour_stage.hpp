// Shows each shot of a take averaged with its neighbours in time, on both sides.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <vector>

#include "daemon/core/pipeline/render_stage.hpp"
#include "daemon/core/pipeline/shot.hpp"

namespace previz::pipeline {

// A sliding window over the shots, of which each is rendered once: at most 2 * neighbours + 1 of
// them are kept (Renderer::keep() says how large they are). A shot's picture depends on the shots
// around it alone, those whose index differs by no more than `neighbours`. One that passes through
// untouched, or that is missing, is nobody's neighbour, and what is left keeps its order.
class NeighbourStage {
 public:
  // `render` must outlive this, with a set that is denoised and RenderStageOptions::seeds_shots.
  NeighbourStage(RenderStage& render, int neighbours);

  // Renders the shot, and returns those that are finished by it, in their order, without those that
  // are only neighbours. The indices of the shots must increase. After a shot that was cancelled,
  // that one and all that wait or come later are returned as not whole. Throws previz::Error where
  // memory does not suffice.
  std::vector<Shot> operator()(Shot shot);
  // Returns the rest when no shot follows: finished, as at the end of the take, or, where shots are
  // missing because of a stop, as not whole.
  std::vector<Shot> end(bool is_stopped);

 private:
  struct Kept {
    std::uint64_t index = 0;
    render::KeptFramePtr frame;
  };

  render::KeptFramePtr keep(Shot& shot);
  void show_up_to(std::uint64_t last_rendered, std::vector<Shot>& shown);
  void show(Shot& shot);
  void forget_before(std::uint64_t index);

  RenderStage& render_;
  const std::uint64_t neighbours_;
  bool is_cancelled_ = false;
  std::deque<Kept> kept_;     // increasing indices
  std::deque<Shot> waiting_;  // likewise; to be shown
};

}  // namespace previz::pipeline
