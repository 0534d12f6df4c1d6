// Makes the calibrate::Views that a camera would have of a board, for the tests of the
// calibrations.
#pragma once

#include "daemon/core/session/session.hpp"
#include "daemon/core/tracking/joint_pose.hpp"
#include "daemon/tools/calibrate/lens/source.hpp"
#include "daemon/tools/calibrate/lens/views.hpp"
#include "daemon/tools/calibrate/sensor/brackets.hpp"
#include "tests/support/test.hpp"
#include "tests/support/units.hpp"

namespace previz::test {

using Lens = std::function<std::optional<glm::dvec2>(const glm::dvec3& point)>;

// The pose of a board before the camera: turned about the picture's vertical and horizontal axis
// and about the line of sight, with its middle at `middle` (camera axes, metres).
struct Held {
  double turn_deg = 0, tip_deg = 0, roll_deg = 0;
  glm::dvec3 middle{0, 0, 1};
};

// Returns one view for each Held. Corners have Gaussian noise; corners outside the picture are left
// out.
calibrate::Views hold(const calibrate::Board& board, const std::vector<Held>& how, const Lens& lens,
                      int width, int height, double noise_px, std::mt19937& random);

// A 9x6 chessboard of 25 mm, seen through a pinhole lens.
calibrate::Views hold(const std::vector<Held>& how, const PinholeIntrinsics& lens, double noise_px,
                      unsigned seed);

// A capture that a careful operator would make of a 9x6 board of 25 mm for a lens of about 60
// degrees: near and tilted all over the picture.
std::vector<Held> careful_capture();

// Footage that is not in files.
class Pictures final : public calibrate::PictureSource {
 public:
  explicit Pictures(std::vector<FramePtr> frames) : frames_(std::move(frames)) {}
  std::optional<calibrate::NamedFrame> next() override {
    if (index_ == frames_.size()) return std::nullopt;
    const std::string name = "picture " + std::to_string(index_);
    return calibrate::NamedFrame{frames_[index_++], name};
  }
  std::optional<std::size_t> count() const override { return frames_.size(); }

 private:
  std::vector<FramePtr> frames_;
  std::size_t index_ = 0;
};

// Writes a session of these pictures, 40 ms apart, as one camera ("observer" or "light") has them.
void record(const std::filesystem::path& session, const session::SessionInfo& info,
            const std::string& source, const std::vector<calibrate::BracketPicture>& pictures);

}  // namespace previz::test
