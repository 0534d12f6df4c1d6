#include "daemon/calibrate/tag_bundle.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>
#include <opencv2/core.hpp>

#include "daemon/tracking/pose_starts.hpp"
#include "drivers/calibration/pinhole.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

constexpr int tag_size = 7;         // rotation, shift, logarithm of the size
constexpr double size_prior = 0.2;  // standard deviation of that logarithm
constexpr int most_adjustments = 60;
constexpr double behind_cost = 1e4;  // of a coordinate, for a tag behind its camera

using TagRow = cv::Matx<double, 8, tag_size>;
using CameraRow = cv::Matx<double, 8, 6>;
using CameraTag = cv::Matx<double, 6, tag_size>;
using TagTag = cv::Matx<double, tag_size, tag_size>;
using TagVector = cv::Matx<double, tag_size, 1>;

glm::dmat3 turned_by(const glm::dvec3& w) {
  const double angle = glm::length(w);
  return angle > 0 ? glm::mat3_cast(glm::angleAxis(angle, w / angle)) : glm::dmat3(1.0);
}

glm::dmat3 orthonormal(const glm::dmat3& rotation) {
  return glm::mat3_cast(glm::normalize(glm::quat_cast(rotation)));
}

// The normal equations with the camera's blocks apart.
struct TagEquations {
  double cost = 0;
  std::vector<cv::Matx66d> cameras;
  std::vector<cv::Vec6d> camera_rhs;
  std::vector<TagTag> tags;
  std::vector<TagVector> tag_rhs;
  std::vector<CameraTag> mixed;  // a sighting each
};

class TagProblem {
 public:
  TagProblem(const TagWalk& walk, const PinholeIntrinsics& lens, const TagAdjustment& how)
      : walk_(walk), lens_(lens), how_(how), by_picture_(walk.pictures.size()) {
    for (std::size_t i = 0; i < walk.sightings.size(); ++i)
      if (how.used.empty() || how.used[i]) by_picture_[walk.sightings[i].picture].push_back(i);
  }

  TagEquations equations(const TagPlaces& places, bool derivatives) const {
    TagEquations sum;
    if (derivatives) {
      sum.cameras.assign(walk_.pictures.size(), cv::Matx66d::zeros());
      sum.camera_rhs.assign(walk_.pictures.size(), cv::Vec6d::all(0));
      sum.tags.assign(walk_.ids.size(), TagTag::zeros());
      sum.tag_rhs.assign(walk_.ids.size(), TagVector::zeros());
      sum.mixed.assign(walk_.sightings.size(), CameraTag::zeros());
    }
    for (const std::vector<std::size_t>& picture : by_picture_)
      for (const std::size_t index : picture) accumulate(index, places, derivatives, sum);
    if (how_.sizes_free) add_size_priors(places, derivatives, sum);
    return sum;
  }

  // Returns the tags' normal matrix and right side after the cameras are eliminated; unknowns that
  // are held, or that nothing was seen of, have 1 on the diagonal.
  void reduce(const TagEquations& all, double damping, cv::Mat1d& matrix, cv::Mat1d& rhs) const {
    const int size = tag_size * int(walk_.ids.size());
    matrix = cv::Mat1d::zeros(size, size);
    rhs = cv::Mat1d::zeros(size, 1);
    for (std::size_t t = 0; t < walk_.ids.size(); ++t) {
      const int at = tag_size * int(t);
      for (int r = 0; r < tag_size; ++r) {
        for (int c = 0; c < tag_size; ++c) matrix(at + r, at + c) += all.tags[t](r, c);
        matrix(at + r, at + r) += damping * all.tags[t](r, r);
        rhs(at + r) += all.tag_rhs[t](r);
      }
    }
    for (std::size_t p = 0; p < by_picture_.size(); ++p) {
      if (by_picture_[p].empty()) continue;
      const cv::Matx66d inverse = damped_inverse(all.cameras[p], damping);
      for (const std::size_t i : by_picture_[p]) {
        const int row = tag_size * int(walk_.sightings[i].tag);
        const cv::Matx<double, tag_size, 6> left = all.mixed[i].t() * inverse;
        const TagVector moved_rhs = left * all.camera_rhs[p];
        for (int r = 0; r < tag_size; ++r) rhs(row + r) -= moved_rhs(r);
        for (const std::size_t j : by_picture_[p]) {
          const int column = tag_size * int(walk_.sightings[j].tag);
          const TagTag block = left * all.mixed[j];
          for (int r = 0; r < tag_size; ++r)
            for (int c = 0; c < tag_size; ++c) matrix(row + r, column + c) -= block(r, c);
        }
      }
    }
    for (std::size_t t = 0; t < walk_.ids.size(); ++t)
      for (int r = 0; r < tag_size; ++r)
        if (all.tags[t](r, r) == 0) matrix(tag_size * int(t) + r, tag_size * int(t) + r) = 1;
  }

  // Returns the unknowns after the step of the tags and the steps of the cameras that follow.
  TagPlaces after(const TagPlaces& places, const TagEquations& all, double damping,
                  const cv::Mat1d& tag_steps) const {
    TagPlaces next = places;
    for (std::size_t t = 0; t < walk_.ids.size(); ++t) {
      const double* step = tag_steps[tag_size * int(t)];
      glm::dmat4& place = next.world_from_tag[t];
      const glm::dmat3 rotation(place);
      const glm::dvec3 shift = rotation * glm::dvec3(step[3], step[4], step[5]);
      const glm::dmat3 turned = orthonormal(rotation * turned_by({step[0], step[1], step[2]}));
      for (int c = 0; c < 3; ++c) place[c] = glm::dvec4(turned[c], 0);
      place[3] += glm::dvec4(shift, 0);
      next.sizes_m[t] *= std::exp(step[6]);
    }
    for (std::size_t p = 0; p < by_picture_.size(); ++p) {
      if (by_picture_[p].empty()) continue;
      cv::Vec6d rhs = all.camera_rhs[p];
      for (const std::size_t i : by_picture_[p]) {
        const TagVector step(tag_steps[tag_size * int(walk_.sightings[i].tag)]);
        rhs -= all.mixed[i] * step;
      }
      const cv::Vec6d step = damped_inverse(all.cameras[p], damping) * rhs;
      tracking::CameraFromWorld& camera = next.cameras[p];
      const glm::dmat3 turn = turned_by({step[0], step[1], step[2]});
      camera.rotation = orthonormal(turn * camera.rotation);
      camera.translation = turn * camera.translation + glm::dvec3(step[3], step[4], step[5]);
    }
    return next;
  }

 private:
  static cv::Matx66d damped_inverse(cv::Matx66d matrix, double damping) {
    // One tag determines its camera, if badly where it is far: the least eigenvalue is positive.
    for (int r = 0; r < 6; ++r) matrix(r, r) *= 1 + damping;
    return matrix.inv(cv::DECOMP_CHOLESKY);
  }

  void accumulate(std::size_t index, const TagPlaces& places, bool derivatives,
                  TagEquations& sum) const {
    const TagSighting& seen = walk_.sightings[index];
    const double variance = seen.variance_px2 + how_.model_error_px * how_.model_error_px;
    cv::Matx<double, 8, 1> residual;
    CameraRow by_camera;
    TagRow by_tag;
    const bool visible = linearise(seen, places, residual, derivatives ? &by_camera : nullptr,
                                   derivatives ? &by_tag : nullptr);
    const double squares = visible ? residual.dot(residual) / variance : 8 * behind_cost;
    const double scale2 = how_.loss_scale * how_.loss_scale;
    const double robust = scale2 > 0 ? 1 + squares / (8 * scale2) : 1;
    sum.cost += scale2 > 0 ? 8 * scale2 * std::log(robust) : squares;
    if (!derivatives || !visible) return;
    const double weight = 1 / (robust * variance);
    sum.cameras[seen.picture] += weight * by_camera.t() * by_camera;
    sum.camera_rhs[seen.picture] += weight * by_camera.t() * residual;
    sum.tags[seen.tag] += weight * by_tag.t() * by_tag;
    sum.tag_rhs[seen.tag] += weight * by_tag.t() * residual;
    sum.mixed[index] = weight * by_camera.t() * by_tag;
  }

  // Computes measured - projected and, where wanted, the projection's derivatives. A camera is
  // moved by a rotation and a shift along its axes, x' = x + w cross x + v; a tag likewise along
  // its own. Returns false if the tag is behind the camera.
  bool linearise(const TagSighting& seen, const TagPlaces& places, cv::Matx<double, 8, 1>& residual,
                 CameraRow* by_camera, TagRow* by_tag) const {
    const tracking::CameraFromWorld& camera = places.cameras[seen.picture];
    const glm::dmat4& place = places.world_from_tag[seen.tag];
    const glm::dmat3 camera_from_tag = camera.rotation * glm::dmat3(place);
    const glm::dvec3 centre = camera.rotation * glm::dvec3(place[3]) + camera.translation;
    const bool is_origin = seen.tag == how_.origin;
    for (std::size_t corner = 0; corner < 4; ++corner) {
      const glm::dvec3 s = tracking::tag_corner(places.sizes_m[seen.tag], corner);
      const glm::dvec3 x = camera_from_tag * s + centre;
      if (!(x.z > 1e-6)) return false;
      glm::dmat2 by_ray;
      const glm::dvec2 pixel = distort(lens_, {x.x / x.z, x.y / x.z}, by_tag ? &by_ray : nullptr);
      const int row = 2 * int(corner);
      residual(row) = seen.corners[corner].x - pixel.x;
      residual(row + 1) = seen.corners[corner].y - pixel.y;
      if (!by_tag) continue;
      const glm::dvec2 by_x = by_ray[0] / x.z, by_y = by_ray[1] / x.z;
      const glm::dvec2 by_z = -(by_ray[0] * x.x + by_ray[1] * x.y) / (x.z * x.z);
      for (int k = 0; k < 2; ++k) {
        const glm::dvec3 g(by_x[k], by_y[k], by_z[k]), in_tag = glm::transpose(camera_from_tag) * g;
        const glm::dvec3 turn = glm::cross(x, g), tag_turn = glm::cross(s, in_tag);
        for (int c = 0; c < 3; ++c) {
          (*by_camera)(row + k, c) = turn[c];
          (*by_camera)(row + k, 3 + c) = g[c];
          (*by_tag)(row + k, c) = is_origin ? 0 : tag_turn[c];
          (*by_tag)(row + k, 3 + c) = is_origin ? 0 : in_tag[c];
        }
        (*by_tag)(row + k, 6) = is_origin || !how_.sizes_free ? 0 : glm::dot(in_tag, s);
      }
    }
    return true;
  }

  void add_size_priors(const TagPlaces& places, bool derivatives, TagEquations& sum) const {
    constexpr double weight = 1 / (size_prior * size_prior);
    for (std::size_t t = 0; t < walk_.ids.size(); ++t) {
      if (t == how_.origin) continue;
      const double off = std::log(places.sizes_m[t] / walk_.sizes_m[t]);
      sum.cost += weight * off * off;
      if (!derivatives) continue;
      sum.tags[t](6, 6) += weight;
      sum.tag_rhs[t](6) -= weight * off;
    }
  }

  const TagWalk& walk_;
  const PinholeIntrinsics& lens_;
  const TagAdjustment& how_;
  std::vector<std::vector<std::size_t>> by_picture_;  // the sightings that are used
};

}  // namespace

TagPlaces adjust_tags(const TagWalk& walk, const PinholeIntrinsics& lens, TagPlaces places,
                      const TagAdjustment& how) {
  const TagProblem problem(walk, lens, how);
  double damping = 1e-3;
  for (int i = 0; i < most_adjustments; ++i) {
    const TagEquations all = problem.equations(places, true);
    double gain = 0;
    for (; damping < 1e9; damping *= 10) {
      cv::Mat1d matrix, rhs, steps;
      problem.reduce(all, damping, matrix, rhs);
      if (!cv::solve(matrix, rhs, steps, cv::DECOMP_CHOLESKY)) continue;
      TagPlaces next = problem.after(places, all, damping, steps);
      const double cost = problem.equations(next, false).cost;
      if (!(cost <= all.cost)) continue;
      gain = all.cost - cost;
      places = std::move(next);
      damping = std::max(damping / 10, 1e-9);
      break;
    }
    if (gain <= 1e-9 * all.cost) break;
  }
  return places;
}

std::vector<TagCovariance> tag_covariances(const TagWalk& walk, const PinholeIntrinsics& lens,
                                           const TagPlaces& places, const TagAdjustment& how) {
  const TagProblem problem(walk, lens, how);
  const TagEquations all = problem.equations(places, true);
  cv::Mat1d matrix, rhs, inverse;
  problem.reduce(all, 0, matrix, rhs);
  // The diagonal is brought to 1, so that radians, metres and logarithms have equal weight.
  cv::Mat1d scale(matrix.rows, 1);
  for (int r = 0; r < matrix.rows; ++r)
    scale(r) = matrix(r, r) > 0 ? 1 / std::sqrt(matrix(r, r)) : 1;
  const cv::Mat1d scales_of_both = scale * scale.t();
  if (!cv::invert(matrix.mul(scales_of_both), inverse, cv::DECOMP_CHOLESKY))
    throw Error("the pictures do not determine where the tags are: film them from more sides");
  inverse = inverse.mul(scales_of_both);
  std::vector<TagCovariance> covariances(walk.ids.size());
  for (std::size_t t = 0; t < walk.ids.size(); ++t)
    for (int r = 0; r < tag_size; ++r)
      for (int c = 0; c < tag_size; ++c) {
        const bool held = all.tags[t](r, r) == 0 || all.tags[t](c, c) == 0;
        covariances[t][std::size_t(tag_size * r + c)] =
            held ? 0 : inverse(tag_size * int(t) + r, tag_size * int(t) + c);
      }
  return covariances;
}

double sighting_gate_px(const TagSighting& sighting, double model_error_px) {
  constexpr double least_px = 1, sigmas = 4.5;
  return std::max(least_px,
                  sigmas * std::sqrt(sighting.variance_px2 + model_error_px * model_error_px));
}

tracking::CornerPixels projected_tag(const PinholeIntrinsics& lens,
                                     const tracking::CameraFromWorld& camera,
                                     const glm::dmat4& world_from_tag, double size_m) {
  tracking::CornerPixels pixels;
  for (std::size_t corner = 0; corner < 4; ++corner) {
    const glm::dvec3 world(world_from_tag * glm::dvec4(tracking::tag_corner(size_m, corner), 1));
    const glm::dvec3 x = camera.rotation * world + camera.translation;
    pixels[corner] = x.z > 1e-6 ? distort(lens, {x.x / x.z, x.y / x.z}) : glm::dvec2(HUGE_VAL);
  }
  return pixels;
}

double tag_squares_px2(const TagSighting& sighting, const PinholeIntrinsics& lens,
                       const TagPlaces& places) {
  const tracking::CornerPixels at =
      projected_tag(lens, places.cameras[sighting.picture], places.world_from_tag[sighting.tag],
                    places.sizes_m[sighting.tag]);
  double sum = 0;
  for (std::size_t corner = 0; corner < 4; ++corner) {
    const glm::dvec2 off = sighting.corners[corner] - at[corner];
    sum += glm::dot(off, off);
  }
  return sum;
}

}  // namespace previz::calibrate
