// One frame of a take that `previzd bench` and `previz trade` render over and over: its pixels,
// pose and light, and how it is rendered.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/core/lighting/response.hpp"
#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/core/set/set.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"
#include "drivers/plate.hpp"

namespace previz::timing {

// What is traded on: a session with its own set, or with another one; or a set file, whose take is
// the one that replaces its film camera or, if it has a camera, the newest in recording.directory.
struct FrameSource {
  std::filesystem::path set_or_session;
  std::optional<std::filesystem::path> set_file = {};  // for a session
  bool any_paths = false;  // the session's own set may name files outside of the session
};

// How a frame is rendered, besides its samples and size: what `previzd bench` and `trade` vary.
struct FrameSettings {
  set::Estimation estimation;
  set::Lighting lighting;
  std::optional<ThinLens> lens;
  bool adaptive = false;      // quality.adaptive
  bool denoise = false;       // quality.denoise
  double scale = 1;           // of the sweep's own picture size
  std::uint32_t carried = 0;  // FEATURE_* bits of features that the frame does not need

  friend bool operator==(const FrameSettings&, const FrameSettings&) = default;
};

class TimedFrame {
 public:
  // Takes frame `index` of the take, or, if absent, the first with a pose and light. Throws
  // previz::Error if there is none.
  TimedFrame(const FrameSource& source, std::optional<std::uint64_t> index);

  const set::Set& set() const { return take_.set; }
  const std::string& set_text() const { return take_.set_text; }
  const std::filesystem::path& take() const { return take_.session.directory; }
  double take_fps()
      const;  // frames a second of the take, over its whole length; 0: it has one frame
  std::uint64_t index() const { return shot_.index; }
  double exposure() const;
  const glm::dmat4& world_from_camera() const { return shot_.track.pose->world_from_camera; }
  const ObserverCalibration& calibration() const { return take_.observer; }
  const lighting::Response& response() const { return *response_; }
  PlatePtr plate(double scale) const;
  // Returns the frame as the camera gave it, with its pose and this light, ready to be rendered.
  pipeline::Shot shot(const set::Lighting& settings, const scene::Scene& scene);
  // Returns the light of the light frames before this frame with these settings, computed once for
  // each. Smoothing and tracked sources add nothing from earlier frames. Returns null if there are
  // no light frames.
  pipeline::LightPtr light(const set::Lighting& settings, const scene::Scene& scene);

 private:
  std::string what_lacks() const;

  const pipeline::Take take_;
  std::vector<std::pair<set::Lighting, pipeline::LightPtr>> lights_;
  pipeline::Shot shot_;
  std::optional<lighting::Response> response_;  // for the plate's bit depth
};

}  // namespace previz::timing
