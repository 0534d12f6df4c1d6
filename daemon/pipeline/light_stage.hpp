// Lighting as a stage: light frames in, the newest estimate of the light out (P9, P11).
#pragma once

#include <map>
#include <optional>

#include "daemon/lighting/source_tracker.hpp"
#include "daemon/pipeline/shot.hpp"
#include "daemon/set/set.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"

namespace previz::pipeline {

// Keeps the newest light frame of every exposure seen so far; together they are the bracket that is
// merged. (Two exposures within 1 % are the same one: an auto-exposure that wanders does not pile
// up old frames.) A set that gives an environment file needs no light frames.
class LightStage {
 public:
  // Loads the environment if the set gives one. Throws previz::Error if it gives none and the light
  // camera's calibration is not known.
  LightStage(const set::Set& set, std::optional<LightCameraCalibration> calibration);

  // True where light() needs frames: no environment is given.
  bool needs_frames() const { return !given_; }

  // How the light is taken from what is seen, from the next light() on.
  void use(set::LightMode mode);

  // Frames in capture order. `index` is the frame's place in its stream, from 0; it matters only
  // where the set names the one to use (lighting.frame).
  void see(FramePtr frame, std::uint64_t index);

  // The light from what was seen so far, computed only if that changed. Null: nothing usable yet.
  LightPtr light();

 private:
  LightPtr finished(lighting::Lighting lighting, std::vector<std::uint64_t> sequences,
                    std::int64_t timestamp_ns);

  set::Lighting settings_;
  const std::optional<double> exposure_;  // overrides the frames' own
  const std::optional<LightCameraCalibration> calibration_;
  std::map<long, FramePtr> newest_;  // by exposure, in steps of 1 %
  bool changed_ = false;
  bool given_ = false;
  lighting::SourceTracker tracker_;
  LightPtr light_;
};

}  // namespace previz::pipeline
