// Estimates the light from light frames on a thread of its own, so that a reader of the newest
// light never waits for it (P11).
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "daemon/core/pipeline/channel.hpp"
#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/pipeline/stages.hpp"
#include "drivers/bracket.hpp"

namespace previz::pipeline {

struct LightFrame {
  FramePtr frame;
  std::uint64_t index = 0;  // place in its stream, from 0
};

// A picture of the film camera and its pose.
struct ObserverView {
  PlatePtr plate;
  double exposure = 1;  // the frame's
  glm::dmat4 world_from_camera{1.0};
};

class LightFeed {
 public:
  using Source = std::function<std::optional<LightFrame>()>;
  // Makes the light from all light frames that waited, at least one, and the newest view, if any.
  using Estimate =
      std::function<LightPtr(std::vector<LightFrame>, const std::optional<ObserverView>&)>;

  // Adds the two stages "light camera" and "lighting". `stages` ends before this object. The source
  // is asked for the next frame at once, however slow the estimate is, because its frames are
  // recorded as well: what an estimate cannot keep up with is dropped, the oldest first, and
  // counted.
  void start(StageThreads& stages, Source source, Estimate estimate);

  // Each of the two may be called from any one thread, and neither waits. newest() is null until
  // the first estimate.
  void see_observer(ObserverView view) { views_.push(std::move(view)); }
  LightPtr newest();

 private:
  // Every exposure of a bracket counts, so light frames queue; the estimate takes all that wait. A
  // whole bracket may always wait, and more of it in up to 256 MB.
  RecentQueue<LightFrame> frames_{most_exposures, 256'000'000, [](const LightFrame& waiting) {
                                    return std::uint64_t{waiting.frame->bytes.size()};
                                  }};
  Mailbox<ObserverView> views_;
  Mailbox<LightPtr> lights_;
  LightPtr newest_;
};

}  // namespace previz::pipeline
