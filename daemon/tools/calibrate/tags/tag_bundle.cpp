#include "daemon/tools/calibrate/tags/tag_bundle.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <opencv2/core.hpp>

#include "daemon/core/tracking/least_squares.hpp"
#include "daemon/core/tracking/pose_starts.hpp"
#include "daemon/core/tracking/tag_place.hpp"
#include "drivers/calibration/pinhole.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

constexpr int tag_size = 7;          // rotation, shift, logarithm of the size
constexpr double size_prior = 0.2;   // standard deviation of that logarithm
constexpr double behind_cost = 1e4;  // of a coordinate, for a tag behind its camera

using TagRow = cv::Matx<double, 8, tag_size>;
using CameraRow = cv::Matx<double, 8, 6>;
using CameraTag = cv::Matx<double, 6, tag_size>;
using TagTag = cv::Matx<double, tag_size, tag_size>;
using TagVector = cv::Matx<double, tag_size, 1>;
using LensRow = cv::Matx<double, 8, lens_size>;
using CameraLens = cv::Matx<double, 6, lens_size>;
using TagLens = cv::Matx<double, tag_size, lens_size>;

// Computes the derivative of one pixel by the lens's parameters, which project a point of the
// normalised image plane (OpenCV's documentation of calib3d gives the model).
cv::Matx<double, 2, lens_size> pixel_by_lens(const PinholeIntrinsics& lens, double x, double y) {
  const double s = x * x + y * y;
  const double divisor = 1 + s * (lens.k4 + s * (lens.k5 + s * lens.k6));
  const double radial = (1 + s * (lens.k1 + s * (lens.k2 + s * lens.k3))) / divisor;
  const double u = x * radial + 2 * lens.p1 * x * y + lens.p2 * (s + 2 * x * x);
  const double v = y * radial + lens.p1 * (s + 2 * y * y) + 2 * lens.p2 * x * y;
  const double powers[] = {s / divisor, s * s / divisor, s * s * s / divisor};
  const double fx = lens.fx, fy = lens.fy;
  return {u,
          0,
          1,
          0,
          fx * x * powers[0],
          fx * x * powers[1],
          fx * 2 * x * y,
          fx * (s + 2 * x * x),
          fx * x * powers[2],
          0,
          v,
          0,
          1,
          fy * y * powers[0],
          fy * y * powers[1],
          fy * (s + 2 * y * y),
          fy * 2 * x * y,
          fy * y * powers[2]};
}

template <int Rows, int Columns>
void add_block(cv::Mat1d& to, int row, int column, const cv::Matx<double, Rows, Columns>& block,
               double factor = 1) {
  for (int r = 0; r < Rows; ++r)
    for (int c = 0; c < Columns; ++c) to(row + r, column + c) += factor * block(r, c);
}

// The normal equations with the camera's blocks apart.
struct TagEquations {
  double cost = 0;
  std::vector<cv::Matx66d> cameras;
  std::vector<cv::Vec6d> camera_rhs;
  std::vector<TagTag> tags;
  std::vector<TagVector> tag_rhs;
  std::vector<CameraTag> mixed;  // a sighting each
  LensMatrix lens = LensMatrix::zeros();
  LensVector lens_rhs = LensVector::all(0);
  std::vector<CameraLens> camera_lens;
  std::vector<TagLens> tag_lens;
};

// The derivatives of the corners of one sighting.
struct SightingRows {
  cv::Matx<double, 8, 1> residual;  // measured - projected
  CameraRow camera;
  TagRow tag;
  LensRow lens = LensRow::zeros();
};

class TagProblem {
 public:
  TagProblem(const TagWalk& walk, const TagAdjustment& how)
      : walk_(walk), how_(how), by_picture_(walk.pictures.size()) {
    for (std::size_t i = 0; i < walk.sightings.size(); ++i)
      if (how.used.empty() || how.used[i]) by_picture_[walk.sightings[i].picture].push_back(i);
  }

  TagEquations equations(const TagsAndLens& at, bool derivatives) const {
    TagEquations sum;
    if (derivatives) {
      sum.cameras.assign(walk_.pictures.size(), cv::Matx66d::zeros());
      sum.camera_rhs.assign(walk_.pictures.size(), cv::Vec6d::all(0));
      sum.tags.assign(walk_.ids.size(), TagTag::zeros());
      sum.tag_rhs.assign(walk_.ids.size(), TagVector::zeros());
      sum.mixed.assign(walk_.sightings.size(), CameraTag::zeros());
      sum.camera_lens.assign(walk_.pictures.size(), CameraLens::zeros());
      sum.tag_lens.assign(walk_.ids.size(), TagLens::zeros());
    }
    for (const std::vector<std::size_t>& picture : by_picture_)
      for (const std::size_t index : picture) accumulate(index, at, derivatives, sum);
    if (how_.sizes_free) add_size_priors(at.places, derivatives, sum);
    if (how_.lens_prior) add_lens_prior(at.lens, derivatives, sum);
    return sum;
  }

  TagEquations evaluate(const TagsAndLens& at) const { return equations(at, false); }

  void linearise(const TagsAndLens& at, TagEquations& all) const { all = equations(at, true); }

  std::optional<TagsAndLens> stepped(const TagsAndLens& at, const TagEquations& all,
                                     double damping) const {
    cv::Mat1d matrix, rhs;
    reduce(all, damping, matrix, rhs);
    const auto steps = tracking::damped_step(matrix, rhs, 0);
    return steps ? std::optional(after(at, all, damping, *steps)) : std::nullopt;
  }

  // Returns where the lens's unknowns begin in the reduced equations, behind those of the tags.
  int lens_at() const { return tag_size * int(walk_.ids.size()); }

  // Returns the normal matrix and right side of tags and lens after the cameras are eliminated;
  // unknowns that are held, or that nothing was seen of, have rows of 0.
  void reduce(const TagEquations& all, double damping, cv::Mat1d& matrix, cv::Mat1d& rhs) const {
    const int size = lens_at() + lens_size;
    matrix = cv::Mat1d::zeros(size, size);
    rhs = cv::Mat1d::zeros(size, 1);
    for (std::size_t t = 0; t < walk_.ids.size(); ++t) {
      const int at = tag_size * int(t);
      add_block(matrix, at, at, all.tags[t]);
      add_block(matrix, at, lens_at(), all.tag_lens[t]);
      add_block(rhs, at, 0, all.tag_rhs[t]);
      for (int r = 0; r < tag_size; ++r) matrix(at + r, at + r) += damping * all.tags[t](r, r);
    }
    add_block(matrix, lens_at(), lens_at(), all.lens);
    add_block<lens_size, 1>(rhs, lens_at(), 0, all.lens_rhs);
    for (int r = 0; r < lens_size; ++r)
      matrix(lens_at() + r, lens_at() + r) += damping * all.lens(r, r);
    for (std::size_t p = 0; p < by_picture_.size(); ++p)
      if (!by_picture_[p].empty()) eliminate(all, p, damping, matrix, rhs);
    for (int r = 0; r < lens_at(); ++r)
      for (int c = lens_at(); c < size; ++c) matrix(c, r) = matrix(r, c);
  }

  // Returns the unknowns after the step of tags and lens, and the steps of the cameras that follow.
  TagsAndLens after(const TagsAndLens& at, const TagEquations& all, double damping,
                    const cv::Mat1d& tag_steps) const {
    TagsAndLens result = at;
    TagPlaces& next = result.places;
    const LensVector lens_step(tag_steps[lens_at()]);
    if (how_.lens_prior) result.lens = with_parameters(at.lens, lens_vector(at.lens) + lens_step);
    for (std::size_t t = 0; t < walk_.ids.size(); ++t) {
      const double* step = tag_steps[tag_size * int(t)];
      glm::dmat4& place = next.world_from_tag[t];
      const glm::dmat3 rotation(place);
      const glm::dvec3 shift = rotation * glm::dvec3(step[3], step[4], step[5]);
      const glm::dmat3 turned =
          tracking::orthonormal(rotation * tracking::rotation_by({step[0], step[1], step[2]}));
      for (int c = 0; c < 3; ++c) place[c] = glm::dvec4(turned[c], 0);
      place[3] += glm::dvec4(shift, 0);
      next.sizes_m[t] *= std::exp(step[6]);
    }
    for (std::size_t p = 0; p < by_picture_.size(); ++p) {
      if (by_picture_[p].empty()) continue;
      cv::Vec6d rhs = all.camera_rhs[p] - all.camera_lens[p] * lens_step;
      for (const std::size_t i : by_picture_[p]) {
        const TagVector step(tag_steps[tag_size * int(walk_.sightings[i].tag)]);
        rhs -= all.mixed[i] * step;
      }
      const cv::Vec6d step = damped_inverse(all.cameras[p], damping) * rhs;
      tracking::CameraFromWorld& camera = next.cameras[p];
      const glm::dmat3 turn = tracking::rotation_by({step[0], step[1], step[2]});
      camera.rotation = tracking::orthonormal(turn * camera.rotation);
      camera.translation = turn * camera.translation + glm::dvec3(step[3], step[4], step[5]);
    }
    return result;
  }

 private:
  // Takes the camera of a picture out of the equations of tags and lens. Of the mixed blocks of
  // both, those right of the diagonal are built.
  void eliminate(const TagEquations& all, std::size_t p, double damping, cv::Mat1d& matrix,
                 cv::Mat1d& rhs) const {
    const cv::Matx66d inverse = damped_inverse(all.cameras[p], damping);
    for (const std::size_t i : by_picture_[p]) {
      const int row = tag_size * int(walk_.sightings[i].tag);
      const cv::Matx<double, tag_size, 6> left = all.mixed[i].t() * inverse;
      add_block<tag_size, 1>(rhs, row, 0, left * all.camera_rhs[p], -1);
      for (const std::size_t j : by_picture_[p])
        add_block(matrix, row, tag_size * int(walk_.sightings[j].tag), left * all.mixed[j], -1);
      add_block(matrix, row, lens_at(), left * all.camera_lens[p], -1);
    }
    const cv::Matx<double, lens_size, 6> left = all.camera_lens[p].t() * inverse;
    add_block<lens_size, 1>(rhs, lens_at(), 0, left * all.camera_rhs[p], -1);
    add_block(matrix, lens_at(), lens_at(), left * all.camera_lens[p], -1);
  }

  static cv::Matx66d damped_inverse(cv::Matx66d matrix, double damping) {
    // One tag determines its camera, if badly where it is far: the least eigenvalue is positive.
    for (int r = 0; r < 6; ++r) matrix(r, r) *= 1 + damping;
    return matrix.inv(cv::DECOMP_CHOLESKY);
  }

  void accumulate(std::size_t index, const TagsAndLens& at, bool derivatives,
                  TagEquations& sum) const {
    const TagSighting& seen = walk_.sightings[index];
    const double variance = seen.variance_px2 + how_.model_error_px * how_.model_error_px;
    SightingRows rows;
    const bool visible = linearise(seen, at, derivatives, rows);
    const double squares = visible ? rows.residual.dot(rows.residual) / variance : 8 * behind_cost;
    const double scale2 = how_.loss_scale * how_.loss_scale;
    const double robust = scale2 > 0 ? 1 + squares / (8 * scale2) : 1;
    sum.cost += scale2 > 0 ? 8 * scale2 * std::log(robust) : squares;
    if (!derivatives || !visible) return;
    const double weight = 1 / (robust * variance);
    sum.cameras[seen.picture] += weight * rows.camera.t() * rows.camera;
    sum.camera_rhs[seen.picture] += weight * rows.camera.t() * rows.residual;
    sum.tags[seen.tag] += weight * rows.tag.t() * rows.tag;
    sum.tag_rhs[seen.tag] += weight * rows.tag.t() * rows.residual;
    sum.mixed[index] = weight * rows.camera.t() * rows.tag;
    if (!how_.lens_prior) return;
    sum.lens += weight * rows.lens.t() * rows.lens;
    sum.lens_rhs += weight * rows.lens.t() * rows.residual;
    sum.camera_lens[seen.picture] += weight * rows.camera.t() * rows.lens;
    sum.tag_lens[seen.tag] += weight * rows.tag.t() * rows.lens;
  }

  // Computes the residuals and, where wanted, the projection's derivatives. A camera is moved by a
  // rotation and a shift along its axes, x' = x + w cross x + v; a tag likewise along its own.
  // Returns false if the tag is behind the camera.
  bool linearise(const TagSighting& seen, const TagsAndLens& at, bool derivatives,
                 SightingRows& rows) const {
    const tracking::CameraFromWorld& camera = at.places.cameras[seen.picture];
    const glm::dmat4& place = at.places.world_from_tag[seen.tag];
    const glm::dmat3 camera_from_tag = camera.rotation * glm::dmat3(place);
    const glm::dvec3 centre = camera.rotation * glm::dvec3(place[3]) + camera.translation;
    for (std::size_t corner = 0; corner < 4; ++corner) {
      const glm::dvec3 s = tracking::tag_corner(at.places.sizes_m[seen.tag], corner);
      const glm::dvec3 x = camera_from_tag * s + centre;
      if (!(x.z > 1e-6)) return false;
      glm::dmat2 by_ray;
      const glm::dvec2 pixel =
          distort(at.lens, {x.x / x.z, x.y / x.z}, derivatives ? &by_ray : nullptr);
      const int row = 2 * int(corner);
      rows.residual(row) = seen.corners[corner].x - pixel.x;
      rows.residual(row + 1) = seen.corners[corner].y - pixel.y;
      if (!derivatives) continue;
      differentiate(seen, camera_from_tag, s, x, by_ray, row, rows);
      if (how_.lens_prior) differentiate_by_lens(at.lens, x, row, rows);
    }
    return true;
  }

  // Fills the two rows of a corner: s is where it is on its tag, x in the camera's axes.
  void differentiate(const TagSighting& seen, const glm::dmat3& camera_from_tag,
                     const glm::dvec3& s, const glm::dvec3& x, const glm::dmat2& by_ray, int row,
                     SightingRows& rows) const {
    const bool is_origin = seen.tag == how_.origin;
    const glm::dvec2 by_x = by_ray[0] / x.z, by_y = by_ray[1] / x.z;
    const glm::dvec2 by_z = -(by_ray[0] * x.x + by_ray[1] * x.y) / (x.z * x.z);
    for (int k = 0; k < 2; ++k) {
      const glm::dvec3 g(by_x[k], by_y[k], by_z[k]), in_tag = glm::transpose(camera_from_tag) * g;
      const glm::dvec3 turn = glm::cross(x, g), tag_turn = glm::cross(s, in_tag);
      for (int c = 0; c < 3; ++c) {
        rows.camera(row + k, c) = turn[c];
        rows.camera(row + k, 3 + c) = g[c];
        rows.tag(row + k, c) = is_origin ? 0 : tag_turn[c];
        rows.tag(row + k, 3 + c) = is_origin ? 0 : in_tag[c];
      }
      rows.tag(row + k, 6) = is_origin || !how_.sizes_free ? 0 : glm::dot(in_tag, s);
    }
  }

  void differentiate_by_lens(const PinholeIntrinsics& lens, const glm::dvec3& x, int row,
                             SightingRows& rows) const {
    const cv::Matx<double, 2, lens_size> by_lens = pixel_by_lens(lens, x.x / x.z, x.y / x.z);
    for (int k = 0; k < 2; ++k)
      for (int p = 0; p < lens_size; ++p)
        if (how_.lens_prior->free[std::size_t(p)]) rows.lens(row + k, p) = by_lens(k, p);
  }

  void add_lens_prior(const PinholeIntrinsics& lens, bool derivatives, TagEquations& sum) const {
    const LensPrior& prior = *how_.lens_prior;
    const LensVector off = prior.values - lens_vector(lens), pull = prior.information * off;
    sum.cost += off.dot(pull);
    if (!derivatives) return;
    for (int r = 0; r < lens_size; ++r) {
      if (!prior.free[std::size_t(r)]) continue;
      sum.lens_rhs[r] += pull[r];
      for (int c = 0; c < lens_size; ++c)
        if (prior.free[std::size_t(c)]) sum.lens(r, c) += prior.information(r, c);
    }
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
  const TagAdjustment& how_;
  std::vector<std::vector<std::size_t>> by_picture_;  // the sightings that are used
};

// Returns the inverse of the reduced equations: the covariances of tags and lens.
cv::Mat1d reduced_inverse(const TagProblem& problem, const TagsAndLens& at) {
  TagEquations all = problem.evaluate(at);
  problem.linearise(at, all);
  cv::Mat1d matrix, rhs;
  problem.reduce(all, 0, matrix, rhs);
  const auto inverse = tracking::inverse_of(matrix);
  if (!inverse)
    throw Error("the pictures do not fix the tags' positions: film them from more sides");
  return *inverse;
}

}  // namespace

TagsAndLens adjust_tags_and_lens(const TagWalk& walk, TagsAndLens at, const TagAdjustment& how) {
  const tracking::LeastSquaresLimits limits{.settled_gain = 1e-9};
  return tracking::least_squares(TagProblem(walk, how), std::move(at), limits).at;
}

TagPlaces adjust_tags(const TagWalk& walk, const PinholeIntrinsics& lens, TagPlaces places,
                      const TagAdjustment& how) {
  TagAdjustment held = how;
  held.lens_prior.reset();
  return adjust_tags_and_lens(walk, {std::move(places), lens}, held).places;
}

std::vector<TagCovariance> tag_covariances(const TagWalk& walk, const PinholeIntrinsics& lens,
                                           const TagPlaces& places, const TagAdjustment& how) {
  const TagProblem problem(walk, how);
  const cv::Mat1d inverse = reduced_inverse(problem, {places, lens});
  std::vector<TagCovariance> covariances(walk.ids.size());
  for (std::size_t t = 0; t < walk.ids.size(); ++t)
    for (int r = 0; r < tag_size; ++r)
      for (int c = 0; c < tag_size; ++c)
        covariances[t][std::size_t(tag_size * r + c)] =
            inverse(tag_size * int(t) + r, tag_size * int(t) + c);
  return covariances;
}

LensMatrix lens_covariance(const TagWalk& walk, const TagsAndLens& at, const TagAdjustment& how) {
  const TagProblem problem(walk, how);
  const cv::Mat1d inverse = reduced_inverse(problem, at);
  LensMatrix covariance;
  for (int r = 0; r < lens_size; ++r)
    for (int c = 0; c < lens_size; ++c)
      covariance(r, c) = inverse(problem.lens_at() + r, problem.lens_at() + c);
  return covariance;
}

double chi_square(const TagWalk& walk, const TagsAndLens& at, const TagAdjustment& how) {
  TagAdjustment squares = how;
  squares.loss_scale = 0;
  return TagProblem(walk, squares).evaluate(at).cost;
}

double sighting_gate_px(const TagSighting& sighting, double model_error_px) {
  constexpr double least_px = 1, sigmas = 4.5;
  return std::max(least_px,
                  sigmas * std::sqrt(sighting.variance_px2 + model_error_px * model_error_px));
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
