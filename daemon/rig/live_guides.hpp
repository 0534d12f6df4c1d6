// Gives the screen the lines over its pictures, and measures about once a second how far the model
// is from what the camera sees, on a thread that nothing waits for.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <thread>

#include "daemon/core/fit/figure.hpp"
#include "daemon/core/output/guide_page.hpp"
#include "daemon/core/pipeline/channel.hpp"
#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/pipeline/stage_keeper.hpp"
#include "daemon/rig/controls.hpp"
#include "daemon/rig/guides.hpp"

namespace previz::rig {

// Computes the lines over one picture that a look asks for, on the thread that shows it; null:
// there are none, or not yet. It may be called as long as there is a picture, also after LiveGuides
// has gone.
using GuidesOf = std::function<std::shared_ptr<const output::GuidePage>(const live::Look&)>;

// Nothing is measured or kept while Look::guides is false, but for the model that was made before.
class LiveGuides {
 public:
  struct Parts {  // outlive the guides
    const set::Set& set;
    const scene::Scene& scene;
    const pipeline::Newest<live::Look>& look;
    pipeline::StageKeeper::Parts kept;
  };

  LiveGuides(Parts parts, const ObserverCalibration& camera);
  ~LiveGuides();  // waits for the picture in hand
  LiveGuides(const LiveGuides&) = delete;
  LiveGuides& operator=(const LiveGuides&) = delete;

  // Call this with every picture that is shown, from one thread. It returns at once.
  GuidesOf look_at(const pipeline::Shot& shot);

  // Returns how far the model was from the picture that was measured last; nothing while the guides
  // are off or nothing was measured yet. May be called from any thread.
  std::optional<fit::Figure> figure() const { return *figure_.get(); }

 private:
  using ModelPtr = std::shared_ptr<const GuideModel>;
  struct Seen {
    FramePtr frame;
    std::optional<glm::dmat4> world_from_camera;  // absent: not known
  };

  void run();
  void make_model();
  void measure(const Seen& seen);
  void publish(const std::optional<fit::Figure>& figure);

  const Parts parts_;
  const ObserverCalibration camera_;
  // Null until somebody wants it. Pictures on the screen share it.
  const std::shared_ptr<pipeline::Newest<ModelPtr>> model_;
  pipeline::Newest<std::optional<fit::Figure>> figure_{std::nullopt};
  pipeline::Mailbox<Seen> seen_;
  fit::Parts things_;  // of the pictures that were measured last; the thread's own
  std::chrono::steady_clock::time_point offered_;
  std::jthread thread_;  // last: it uses all of the above
};

}  // namespace previz::rig
