// Learns from the times of frames what a frame costs: a fixed part, which neither samples nor
// pixels change (conversion, upload, placing, denoising), and a part for each sample of each pixel.
#pragma once

#include <array>
#include <cstddef>
#include <optional>

namespace previz::pipeline {

// The model is seconds = fixed + per_work * work, where `work` is samples times pixels, the latter
// as a share of the full picture. A Kalman filter (recursive least squares whose forgetting is a
// random walk of both parameters, and whose prior is the first frame's time in two equal parts)
// follows the two. While the work stays the same, only the sum is seen; the filter's covariance
// then says how little is known of the parts, so that the caller can see when a try would pay.
//
// A frame that took far longer than the model and its noise allow is believed at once, in
// proportion to what each part already costs; if the next frame fits the old model better, the slow
// frame was a hiccup, and the old model is back. A frame that was far faster is believed when a
// second one follows.
class FrameCost {
 public:
  enum class Saw {
    usual,   // a frame as the model has it
    odd,     // a frame that the model does not have, which may be a hiccup
    changed  // a second frame says that costs are others than they were
  };
  Saw took(double work, double seconds);  // both above 0

  bool known() const { return model_.seconds > 0; }
  // Returns the expected time of a frame.
  double seconds(double work) const { return model_.fixed + model_.per_work * work; }
  // Returns the standard deviation of that expectation; the noise of a single frame comes on top.
  double deviation(double work) const;
  double fixed() const { return model_.fixed; }
  double per_work() const { return model_.per_work; }
  // Returns the standard deviation of per_work() over its value.
  double share_unknown() const;
  // Returns whether the last frame was odd, and it is not known yet whether costs have changed.
  bool is_in_doubt() const { return before_.has_value() || was_fast_; }
  // Returns whether that frame was a fast one, so that a second frame of the same work would say.
  bool asks_again() const { return was_fast_; }

  // Takes the fixed part for another one, such as that of another size of the picture. It was found
  // by taking per_work() times `work` from a time that is known to this standard deviation.
  void use_fixed(double seconds, double deviation, double work);

  // Returns the 99th percentile of time over expected time among the last frames, hiccups included;
  // nothing while there are fewer than 20.
  std::optional<double> late_ratio() const;

 private:
  struct Model {
    double fixed = 0, per_work = 0;
    double fixed_variance = 0, per_work_variance = 0, covariance = 0;
    double seconds = 0;  // of the last frame, as expected; 0: no frame yet
  };
  static double variance(const Model& model, double work);
  static void update(Model& model, double work, double seconds, double noise);
  void begin(double work, double seconds);
  void doubt(double work, double seconds);
  double noise(double expected) const;  // variance of a single frame's time
  void remember(double ratio);

  Model model_;
  std::optional<Model> before_;  // the model before an odd slow frame
  double odd_ratio_ = 1;         // of that frame
  bool was_fast_ = false;
  double relative_variance_ = 0.05 * 0.05;  // of a frame's time, over its square
  int settled_ = 0;                         // usual frames since the model changed
  std::array<double, 128> ratios_{};        // a ring
  std::size_t ratio_count_ = 0;
};

}  // namespace previz::pipeline
