// Says how far the edges of a model are from those of pictures.
#pragma once

#include <cstddef>
#include <glm/mat4x4.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/core/fit/parts.hpp"
#include "daemon/core/fit/real_model.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"

namespace previz::fit {

struct Figure {
  struct Off {
    double median_px = 0;  // >= 0, across the edges
    double most_px = 0;    // 90 % of the pieces are nearer
    // By how much the model would have to be moved in the picture to lie on most of the edges: the
    // median of the frames, to half a pixel. An edge that lies along the translation is not off, so
    // that the figures above can be much smaller.
    double shift_px = 0;
  };
  std::size_t frames = 0;           // pictures looked at
  std::size_t looked_at = 0;        // pieces of edges of 12 to 40 px in all of them
  std::size_t found = 0;            // of these, pieces where the picture has an edge of light
  std::optional<Off> off;           // absent: too few were found
  std::string why;                  // the reason then, in plain words
  std::vector<PartOff> things_off;  // while the rest fits; the worst first
  // Parts of which the last pictures show too few edges to say whether they are off.
  std::vector<std::string> not_judged;
};

// Returns how far off the model is, to compare with most_off_px: the median of its edges or the
// shift, whichever is more. It is 0 px without a figure.
double off_px(const Figure& figure);

class Measurement {
 public:
  // The model and the camera must outlive this. `parts` is that of an earlier measurement of the
  // same model, which is gone on with.
  Measurement(const RealModel& model, const ObserverCalibration& camera, Parts parts = {})
      : model_(model), camera_(camera), parts_(std::move(parts)) {}

  // A frame of another size than the camera is calibrated for is not looked at. The figure then
  // says why it is none.
  void look(const Frame& frame, const glm::dmat4& world_from_camera);

  Figure figure() const;
  const Parts& parts() const { return parts_; }

 private:
  const RealModel& model_;
  const ObserverCalibration& camera_;
  std::size_t frames_ = 0, looked_at_ = 0;
  std::vector<double> off_px_;    // a number for each piece that was found
  std::vector<double> shift_px_;  // a number for each frame in which some were found
  Parts parts_;
  std::string refused_;  // why a frame was not looked at
};

}  // namespace previz::fit
