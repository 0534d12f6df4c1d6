// Computes the light around the set from the light camera's frames or from an environment's picture
// (P9).
#pragma once

#include <filesystem>
#include <memory>
#include <span>

#include "daemon/core/lighting/environment.hpp"
#include "daemon/core/lighting/observed.hpp"
#include "daemon/core/lighting/room.hpp"
#include "daemon/core/set/set.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"

namespace previz::lighting {

// Estimates the light from one light camera, frame after frame: a bracket is merged (merge,
// expand_clipped, undo_vignetting), averaged over time (Smoothing), resampled to the map
// (make_resampling, once) and completed (fill_unseen). Not thread-safe.
//
// The map is what the camera sees from where it stands, at infinity, including the real table and
// cubes near it; the renderer hits their phantoms before it looks up those directions. With a room,
// the map is what would be seen from Room::seen_from (Viewpoint).
class Estimator {
 public:
  // Resolution 0 stands for the smallest power of two whose texels are not larger than a pixel on
  // the optical axis, at most 2048. `room` is the room that settings.room describes; it may be
  // null.
  Estimator(const LightCameraCalibration& calibration, const set::Lighting& settings,
            std::shared_ptr<const Room> room = nullptr);
  ~Estimator();

  int resolution() const;
  // Takes one exposure, or a bracket of several of the same scene, in any order; the newest wins
  // where they contradict each other, and its time is the picture's. `observed` may be null; it is
  // used if settings.unseen asks for it. Frames must have the calibration's size; otherwise throws
  // previz::Error naming the frame.
  Lighting operator()(std::span<const FramePtr> frames, const ObservedLight* observed = nullptr);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Estimates the light from a single bracket, without earlier frames.
Lighting estimate(std::span<const FramePtr> frames, const LightCameraCalibration& calibration,
                  const set::Lighting& settings, std::shared_ptr<const Room> room = nullptr);

// Loads an OpenEXR or Radiance .hdr picture of the light from all around. If it is twice as wide as
// high it is a latitude-longitude picture: pixel centre column c, row r of w x h looks towards
// azimuth 2 pi (0.5 - (c + 0.5) / w) from +X to +Y and elevation pi (0.5 - (r + 0.5) / h), Z up;
// the centre of the picture is +X, seen from inside. With an aspect of 3:4 or 4:3 it is a cube
// cross (cube_cross.hpp). It is bilinear between pixel centres, integrated over each texel, turned
// and scaled by the settings. Resolution 0 gives the smallest power of two whose texels are not
// larger than a pixel on the equator, or than the mean pixel of a cube, at most 2048: 512 for
// 512x256. Pixels that hold no radiance are replaced and noted (picture_repair.hpp). Throws
// previz::Error naming the file and what is wrong with it; the channels allowed are R, G and B
// (others are ignored), or Y.
Lighting load_environment(const set::Lighting& settings);

}  // namespace previz::lighting
