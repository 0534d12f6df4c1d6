#include "daemon/core/tracking/carrier_pose.hpp"

#include <glm/mat3x3.hpp>
#include <opencv2/core.hpp>

#include "daemon/core/tracking/joint_pose.hpp"

namespace previz::tracking {
namespace {

// Returns the matrix that brings a small motion (rotation, translation) along the camera's axes
// into the carrier's frame: carrier_from_camera * motion * camera_from_carrier = [R 0; [t]x R  R]
// applied to the motion.
cv::Matx<double, 6, 6> adjoint(const glm::dmat4& carrier_from_camera) {
  const glm::dmat3 r(carrier_from_camera);
  const glm::dvec3 t(carrier_from_camera[3]);
  cv::Matx<double, 6, 6> result = cv::Matx<double, 6, 6>::zeros();
  for (int column = 0; column < 3; ++column) {
    const glm::dvec3 moment = glm::cross(t, r[column]);
    for (int row = 0; row < 3; ++row) {
      result(row, column) = result(row + 3, column + 3) = r[column][row];
      result(row + 3, column) = moment[row];
    }
  }
  return result;
}

}  // namespace

CarrierPose carrier_pose(const Pose& on_stage, const Pose& on_carrier) {
  const CameraFromWorld camera_from_carrier = camera_from_world(on_carrier.world_from_camera);
  glm::dmat4 camera_from(camera_from_carrier.rotation);
  camera_from[3] = glm::dvec4(camera_from_carrier.translation, 1);

  CarrierPose pose;
  pose.world_from_carrier = on_stage.world_from_camera * camera_from;
  pose.tags = on_carrier.tags;
  const cv::Matx<double, 6, 6> into = adjoint(on_carrier.world_from_camera);
  const cv::Matx<double, 6, 6> covariance = cv::Matx<double, 6, 6>(on_stage.covariance.data()) +
                                            cv::Matx<double, 6, 6>(on_carrier.covariance.data());
  const cv::Matx<double, 6, 6> brought = into * covariance * into.t();
  std::copy_n(brought.val, 36, pose.covariance.begin());
  return pose;
}

}  // namespace previz::tracking
