// The pictures in which points are marked, and where their cameras stood.
#pragma once

#include <array>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/set/set.hpp"
#include "daemon/core/tracking/joint_pose.hpp"
#include "daemon/core/tracking/rays.hpp"
#include "daemon/core/tracking/tag_detector.hpp"
#include "daemon/tools/calibrate/lens/source.hpp"
#include "daemon/tools/model/parts.hpp"
#include "drivers/calibration.hpp"

namespace previz::model {

struct MarkedView {
  std::string name;
  std::vector<Mark> marks;
  tracking::FittedPose pose;  // by the tags it shows
  FramePtr frame = nullptr;   // the picture; null in tests that make marks without one
};

struct Views {
  PinholeIntrinsics lens;
  std::string family = "tag36h11";  // of the tags
  std::vector<MarkedView> views;    // as the parts list them
};

using tracking::Ray;

// Returns how a file of parts names a picture of a source: "frame 7" of "takes/12A/observer frame
// 7", "0012.png" of "walk/0012.png".
std::string short_name(const std::string& name);

// Throws previz::Error naming the picture if it is not of the lens's size.
void insist_on_size(const Frame& frame, const PinholeIntrinsics& lens, const std::string& picture);

// Looks for the marked pictures, and for the set's tags in each of them. A picture is named as the
// source names it, or by the end of that name: "0000.png" of a folder, "frame 7" or
// "frame_7.png" of a session.
// Throws previz::Error naming a picture that is not there, that is not of the lens's size, in which
// a mark lies outside, or that shows no tag of the set.
Views find_views(calibrate::PictureSource& source, const ObserverCalibration& camera,
                 const set::Tracking& tracking, const Parts& parts);

// Returns the best pose by the tags of the set among these; nothing if there are none, or none
// fits.
std::optional<tracking::FittedPose> pose_by_tags(
    const std::vector<tracking::TagDetection>& detections, const PinholeIntrinsics& lens,
    const set::Tracking& tracking);

// Returns the ray of a pixel, as the tags place the camera. Throws previz::Error naming the mark if
// the lens shows nothing there.
Ray ray_of(const Views& views, const MarkedView& view, const Mark& mark);

// Returns the pose of a view's camera where it is off by rotation and shift along its own axes: see
// FittedPose::covariance.
tracking::CameraFromWorld adjusted_pose(const MarkedView& view, const std::array<double, 6>& off);

// Returns where the lens shows a point of the camera's axes; NaN behind the camera.
glm::dvec2 projected(const PinholeIntrinsics& lens, const glm::dvec3& in_camera);

}  // namespace previz::model
