#include "daemon/core/tracking/joint_pose.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <numeric>
#include <opencv2/core.hpp>

#include "daemon/core/tracking/least_squares.hpp"
#include "daemon/core/tracking/pose_starts.hpp"
#include "drivers/calibration/pinhole.hpp"

namespace previz::tracking {
namespace {

constexpr double kDecisiveDrop = 4;

using Vector6 = cv::Matx<double, 6, 1>;
using Whitening = cv::Matx<double, 8, 8>;  // lower triangular; whitened = W * residual

glm::dvec3 corner_in_world(const TagObservation& tag, std::size_t i) {
  return glm::dvec3(tag.world_from_tag * glm::dvec4(tag_corner(tag.size_m, i), 1));
}

Whitening whitening(const TagObservation& tag, double model_error_px) {
  Whitening c(tag.covariance.data());
  for (int i = 0; i < 8; ++i) c(i, i) += model_error_px * model_error_px;
  Whitening l = Whitening::zeros();  // Cholesky
  for (int i = 0; i < 8; ++i) {
    for (int j = 0; j <= i; ++j) {
      double sum = c(i, j);
      for (int k = 0; k < j; ++k) sum -= l(i, k) * l(j, k);
      l(i, j) = i == j ? std::sqrt(std::max(sum, 1e-12)) : sum / l(j, j);
    }
  }
  Whitening inverse = Whitening::zeros();
  for (int i = 0; i < 8; ++i) {
    inverse(i, i) = 1 / l(i, i);
    for (int j = 0; j < i; ++j) {
      double sum = 0;
      for (int k = j; k < i; ++k) sum += l(i, k) * inverse(k, j);
      inverse(i, j) = -sum / l(i, i);
    }
  }
  return inverse;
}

// A tag prepared for the fit: world corners and the whitening of its residuals.
struct Prepared {
  std::array<glm::dvec3, 4> world;
  CornerPixels corners;
  Whitening whiten;
};

Prepared prepared(const TagObservation& tag) {
  Prepared p{{}, tag.corners, whitening(tag, kCornerFloorPx)};
  for (std::size_t i = 0; i < 4; ++i) p.world[i] = corner_in_world(tag, i);
  return p;
}

using Residual = cv::Matx<double, 8, 1>;
using Jacobian = cv::Matx<double, 8, 6>;

// Computes measured - projected of corner i and the derivative by a small motion of the camera.
// Returns false if the corner is behind the camera.
bool residual(const Prepared& tag, std::size_t i, const PinholeIntrinsics& lens,
              const CameraFromWorld& pose, Residual* r, Jacobian* jacobian) {
  const glm::dvec3 x = pose.rotation * tag.world[i] + pose.translation;
  if (!(x.z > 1e-9)) return false;
  glm::dmat2 by_ray;
  const glm::dvec2 pixel = distort(lens, {x.x / x.z, x.y / x.z}, &by_ray);
  const int row = int(2 * i);
  (*r)(row) = tag.corners[i].x - pixel.x;
  (*r)(row + 1) = tag.corners[i].y - pixel.y;
  const glm::dvec2 by_x = by_ray[0] / x.z, by_y = by_ray[1] / x.z;
  const glm::dvec2 by_z = -(by_ray[0] * x.x + by_ray[1] * x.y) / (x.z * x.z);
  for (int k = 0; k < 2; ++k) {
    // The point moves by x cross w for a rotation w of the camera, by -v for a translation v.
    const glm::dvec3 g(by_x[k], by_y[k], by_z[k]);
    const glm::dvec3 by_rotation = glm::cross(g, x);
    for (int c = 0; c < 3; ++c) {
      (*jacobian)(row + k, c) = by_rotation[c];
      (*jacobian)(row + k, 3 + c) = -g[c];
    }
  }
  return true;
}

bool residual(const Prepared& tag, const PinholeIntrinsics& lens, const CameraFromWorld& pose,
              Residual* r, Jacobian* jacobian) {
  for (std::size_t i = 0; i < 4; ++i)
    if (!residual(tag, i, lens, pose, r, jacobian)) return false;
  return true;
}

CameraFromWorld pose_after(const CameraFromWorld& pose, const Vector6& step) {
  const glm::dmat3 back = rotation_by({-step(0), -step(1), -step(2)});
  return {orthonormal(back * pose.rotation),
          back * (pose.translation - glm::dvec3(step(3), step(4), step(5)))};
}

// The cost function: whitened squares, or a redescending loss of each tag's distance in px (Geman
// and McClure), which drops tags at odds with the rest as `scale_px` shrinks.
struct Loss {
  bool robust = false;
  double scale_px = 0;
};

using Accumulated = NormalEquations<6>;
using PoseMinimum = Minimum<CameraFromWorld, Accumulated>;

class Problem {
 public:
  Problem(const std::vector<TagObservation>& tags, const PinholeIntrinsics& lens)
      : lens_(lens), observations_(tags) {
    for (const TagObservation& tag : tags) tags_.push_back(prepared(tag));
  }

  void set_model_error(double px) {
    for (std::size_t i = 0; i < tags_.size(); ++i)
      tags_[i].whiten = whitening(observations_[i], px);
  }

  Accumulated accumulate(const std::vector<std::size_t>& used, const CameraFromWorld& pose,
                         Loss loss) const {
    Accumulated sum;
    for (std::size_t index : used) {
      const Prepared& tag = tags_[index];
      Residual r;
      Jacobian j;
      if (!residual(tag, lens_, pose, &r, &j)) {
        sum.cost = HUGE_VAL;
        return sum;
      }
      if (loss.robust) {
        const double e2 = r.dot(r) / 4, c2 = loss.scale_px * loss.scale_px;
        sum.add(j, r, c2 / (c2 + e2) * (c2 / (c2 + e2)));
        sum.cost += 4 * e2 * c2 / (c2 + e2);
      } else {
        r = tag.whiten * r;
        sum.add<8>(tag.whiten * j, r);
        sum.cost += r.dot(r);
      }
    }
    return sum;
  }

  // Returns nothing if the start is behind the camera.
  std::optional<PoseMinimum> minimise(const std::vector<std::size_t>& used,
                                      const CameraFromWorld& start, Loss loss, int trials) const {
    const auto minimum = least_squares(OfTags{*this, used, loss}, start, {trials, 1e-4});
    return minimum.why == Stopped::outside ? std::nullopt : std::optional(minimum);
  }

 private:
  struct OfTags {
    const Problem& problem;
    const std::vector<std::size_t>& used;
    Loss loss;

    Accumulated evaluate(const CameraFromWorld& pose) const {
      return problem.accumulate(used, pose, loss);
    }

    static CameraFromWorld moved(const CameraFromWorld& pose, const Vector6& step) {
      return pose_after(pose, step);
    }
  };

  const PinholeIntrinsics& lens_;
  const std::vector<TagObservation>& observations_;
  std::vector<Prepared> tags_;
};

double rms_px(const std::vector<TagObservation>& tags, const PinholeIntrinsics& lens,
              const CameraFromWorld& pose, const std::vector<std::size_t>& used) {
  double squares = 0;
  for (std::size_t i : used) {
    const double e = tag_error_px(tags[i], pose, lens);
    squares += e * e;
  }
  return std::sqrt(squares / double(used.size()));
}

FittedPose describe(const PoseMinimum& minimum, const std::vector<TagObservation>& tags,
                    const PinholeIntrinsics& lens, const std::vector<std::size_t>& used) {
  FittedPose fit;
  fit.pose = minimum.at;
  fit.used = used;
  fit.chi_square = minimum.equations.cost;
  fit.degrees_of_freedom = int(8 * used.size()) - 6;
  fit.rms_px = rms_px(tags, lens, fit.pose, used);
  const auto covariance = inverse_of(minimum.equations.information, cv::DECOMP_SVD);
  if (covariance) std::copy(covariance->val, covariance->val + 36, fit.covariance.begin());
  return fit;
}

bool same_pose(const CameraFromWorld& a, const CameraFromWorld& b) {
  return rotation_between(a, b) < 1e-4 &&
         glm::distance(a.translation, b.translation) < 1e-4 * glm::length(a.translation);
}

bool better(const FittedPose& a, const FittedPose& b) {
  return a.chi_square < b.chi_square;
}

// Returns the distinct minima over exactly these tags, best first, each seeing every tag from its
// front.
std::vector<FittedPose> minima(const Problem& problem, const std::vector<TagObservation>& tags,
                               const PinholeIntrinsics& lens, const std::vector<std::size_t>& used,
                               const std::vector<CameraFromWorld>& starts) {
  std::vector<FittedPose> found;
  for (const CameraFromWorld& start : starts) {
    const auto minimum = problem.minimise(used, start, {}, 50);
    if (!minimum) continue;
    FittedPose fit = describe(*minimum, tags, lens, used);
    if (!std::isfinite(fit.rms_px)) continue;
    if (std::none_of(found.begin(), found.end(),
                     [&](const FittedPose& f) { return same_pose(f.pose, fit.pose); }))
      found.push_back(std::move(fit));
  }
  std::sort(found.begin(), found.end(), better);
  return found;
}

std::vector<std::size_t> explained(const std::vector<TagObservation>& tags,
                                   const PinholeIntrinsics& lens, const CameraFromWorld& pose) {
  const double gate_px = consistency_gate_px(lens);
  std::vector<std::size_t> used;
  for (std::size_t i = 0; i < tags.size(); ++i)
    if (tag_error_px(tags[i], pose, lens) <= gate_px) used.push_back(i);
  return used;
}

// Moves from a pose that fits some tags to one that fits as many as agree: the loss is first as
// wide as the errors of the better half of the tags, then narrows to the gate.
std::optional<CameraFromWorld> agree(const Problem& problem,
                                     const std::vector<TagObservation>& tags,
                                     const PinholeIntrinsics& lens, const CameraFromWorld& start) {
  std::vector<std::size_t> all;
  std::vector<double> errors;
  for (std::size_t i = 0; i < tags.size(); ++i) {
    all.push_back(i);
    errors.push_back(tag_error_px(tags[i], start, lens));
  }
  std::nth_element(errors.begin(), errors.begin() + std::ptrdiff_t(errors.size() / 2),
                   errors.end());
  const double gate_px = consistency_gate_px(lens);
  const double widest = 0.5 * (lens.width + lens.height);
  double scale = std::clamp(2 * errors[errors.size() / 2], gate_px, std::max(gate_px, widest));
  CameraFromWorld pose = start;
  while (const auto minimum = problem.minimise(all, pose, {true, scale}, 6)) {
    pose = minimum->at;
    if (scale <= 0.5 * gate_px) return pose;
    scale = std::max(0.5 * gate_px, scale / 2.5);
  }
  return std::nullopt;
}

// The camera's pose at the picture's middle row, and its motion while the height is read.
struct MovingPose {
  CameraFromWorld pose;
  Vector6 motion = Vector6::zeros();
};

struct RowsProblem {
  const std::vector<Prepared>& tags;
  const PinholeIntrinsics& lens;
  int motions;  // 3: it turns; 6: it moves, too

  double time_of(const glm::dvec2& corner) const { return (corner.y + 0.5) / lens.height - 0.5; }

  NormalEquations<12> evaluate(const MovingPose& at) const {
    NormalEquations<12> sum;
    for (const Prepared& tag : tags) {
      Residual r;
      Jacobian j;
      cv::Matx<double, 8, 12> by;
      for (std::size_t i = 0; i < 4; ++i) {
        const double time = time_of(tag.corners[i]);
        if (!residual(tag, i, lens, pose_after(at.pose, time * at.motion), &r, &j)) {
          sum.cost = HUGE_VAL;
          return sum;
        }
        for (int row = int(2 * i); row < int(2 * i) + 2; ++row)
          for (int c = 0; c < 6; ++c) {
            by(row, c) = j(row, c);
            by(row, 6 + c) = c < motions ? time * j(row, c) : 0;
          }
      }
      r = tag.whiten * r;
      sum.add<8>(tag.whiten * by, r);
      sum.cost += r.dot(r);
    }
    return sum;
  }

  static MovingPose moved(const MovingPose& at, const cv::Matx<double, 12, 1>& step) {
    return {pose_after(at.pose, step.get_minor<6, 1>(0, 0)),
            at.motion + step.get_minor<6, 1>(6, 0)};
  }
};

struct Consensus {
  std::vector<std::size_t> used;
  CameraFromWorld pose;
};

// Drops tags that were moved by so little that bending the pose explains them. A tag is dropped if
// the others (at least two) agree kDecisiveDrop times better without it.
void let_go(const Problem& problem, const std::vector<TagObservation>& tags,
            const PinholeIntrinsics& lens, Consensus* consensus) {
  while (consensus->used.size() >= 3) {
    const auto joint = problem.minimise(consensus->used, consensus->pose, {}, 30);
    if (!joint) return;
    const double limit = rms_px(tags, lens, joint->at, consensus->used) / kDecisiveDrop;
    if (limit < kCornerFloorPx) return;
    Consensus least;
    double least_rms = limit;
    for (std::size_t i = 0; i < consensus->used.size(); ++i) {
      Consensus without{consensus->used, joint->at};
      without.used.erase(without.used.begin() + std::ptrdiff_t(i));
      const auto pose = problem.minimise(without.used, joint->at, {}, 30);
      if (!pose) continue;
      const double rms = rms_px(tags, lens, pose->at, without.used);
      if (rms >= least_rms) continue;
      least_rms = rms;
      without.pose = pose->at;
      least = without;
    }
    if (least.used.empty()) return;
    *consensus = least;
  }
}

// Returns the least model error at which the residuals are no larger than expected for their
// degrees of freedom, with one standard deviation allowed, since few tags determine little.
double model_error_px(Problem& problem, const PinholeIntrinsics& lens, const Consensus& consensus) {
  const double degrees = 8.0 * double(consensus.used.size()) - 6;
  const double expected = degrees + std::sqrt(2 * degrees);
  double error = kCornerFloorPx;
  CameraFromWorld pose = consensus.pose;
  while (error < consistency_gate_px(lens)) {
    problem.set_model_error(error);
    const auto minimum = problem.minimise(consensus.used, pose, {}, 20);
    if (minimum && minimum->equations.cost <= expected) break;
    if (minimum) pose = minimum->at;
    error *= 1.2;
  }
  return error;
}

}  // namespace

double tag_error_px(const TagObservation& tag, const CameraFromWorld& pose,
                    const PinholeIntrinsics& lens) {
  const glm::dvec3 centre = pose.rotation * glm::dvec3(tag.world_from_tag[3]) + pose.translation;
  const glm::dvec3 normal = pose.rotation * glm::dvec3(tag.world_from_tag[2]);
  if (!(glm::dot(normal, centre) < 0)) return HUGE_VAL;
  double squares = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const glm::dvec3 x = pose.rotation * corner_in_world(tag, i) + pose.translation;
    if (!(x.z > 1e-9)) return HUGE_VAL;
    const glm::dvec2 d = tag.corners[i] - distort(lens, {x.x / x.z, x.y / x.z});
    squares += glm::dot(d, d);
  }
  return std::isfinite(squares) ? std::sqrt(squares / 4) : HUGE_VAL;
}

std::optional<FittedPose> refitted_pose(const std::vector<TagObservation>& tags,
                                        const PinholeIntrinsics& lens,
                                        const CameraFromWorld& start) {
  std::vector<std::size_t> all(tags.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  const auto minimum = Problem(tags, lens).minimise(all, start, {}, 50);
  return minimum ? std::optional(describe(*minimum, tags, lens, all)) : std::nullopt;
}

std::optional<RowsFit> fit_of_rows(const std::vector<TagObservation>& tags,
                                   const PinholeIntrinsics& lens, const CameraFromWorld& start,
                                   bool also_moves) {
  std::vector<Prepared> all;
  for (const TagObservation& tag : tags) all.push_back(prepared(tag));
  const RowsProblem problem{all, lens, also_moves ? 6 : 3};
  const auto minimum = least_squares(problem, MovingPose{start, {}}, {50, 1e-4});
  RowsFit fit{minimum.equations.cost, int(8 * tags.size()) - 6 - problem.motions, 0, 0};
  if (minimum.why == Stopped::outside || fit.degrees_of_freedom <= 0) return std::nullopt;
  double squares = 0;
  for (const Prepared& tag : all)
    for (std::size_t i = 0; i < 4; ++i) {
      Residual r, first, last;
      Jacobian j;
      const Vector6& motion = minimum.at.motion;
      const CameraFromWorld& pose = minimum.at.pose;
      if (!residual(tag, i, lens, pose_after(pose, problem.time_of(tag.corners[i]) * motion), &r,
                    &j) ||
          !residual(tag, i, lens, pose_after(pose, -0.5 * motion), &first, &j) ||
          !residual(tag, i, lens, pose_after(pose, 0.5 * motion), &last, &j))
        return std::nullopt;
      const auto k = int(2 * i);
      squares += r(k) * r(k) + r(k + 1) * r(k + 1);
      fit.moved_px += std::hypot(first(k) - last(k), first(k + 1) - last(k + 1));
    }
  fit.moved_px /= 4.0 * double(tags.size());
  fit.rms_px = std::sqrt(squares / (4.0 * double(tags.size())));
  return fit;
}

double expected_rms_px(const std::vector<TagObservation>& tags, int degrees_of_freedom) {
  std::vector<double> variances;
  for (const TagObservation& tag : tags) {
    double sum = 0;
    for (std::size_t i = 0; i < 8; ++i) sum += tag.covariance[9 * i];
    variances.push_back(sum / 8 + kCornerFloorPx * kCornerFloorPx);
  }
  const auto middle = variances.begin() + std::ptrdiff_t(variances.size() / 2);
  std::nth_element(variances.begin(), middle, variances.end());
  return std::sqrt(2 * *middle * degrees_of_freedom / (8.0 * double(tags.size())));
}

double consistency_gate_px(const PinholeIntrinsics& lens) {
  return 2 * std::max(1.0, lens.width / 1280.0);
}

std::vector<FittedPose> solve_joint_pose(const std::vector<TagObservation>& tags,
                                         const PinholeIntrinsics& lens,
                                         const std::optional<CameraFromWorld>& seed) {
  if (tags.empty()) return {};
  Problem problem(tags, lens);
  std::vector<CameraFromWorld> starts = pose_starts(tags, lens);
  if (seed) starts.insert(starts.begin(), *seed);

  std::vector<Consensus> largest;
  const auto offer = [&](const CameraFromWorld& pose) {
    Consensus c{explained(tags, lens, pose), pose};
    if (c.used.empty()) return;
    if (!largest.empty() && c.used.size() > largest.front().used.size()) largest.clear();
    if (!largest.empty() && c.used.size() < largest.front().used.size()) return;
    if (std::none_of(largest.begin(), largest.end(),
                     [&](const Consensus& l) { return l.used == c.used; }))
      largest.push_back(std::move(c));
  };
  for (const CameraFromWorld& start : starts) {
    if (tags.size() == 1) {
      largest.push_back({{0}, start});
      break;
    }
    offer(start);
    if (const auto pose = agree(problem, tags, lens, start)) offer(*pose);
    if (!largest.empty() && largest.front().used.size() == tags.size()) break;
  }

  double error = HUGE_VAL;
  for (Consensus& c : largest) {
    problem.set_model_error(kCornerFloorPx);
    let_go(problem, tags, lens, &c);
    error = std::min(error, model_error_px(problem, lens, c));
  }
  problem.set_model_error(error);
  std::vector<FittedPose> poses;
  for (const Consensus& c : largest) {
    std::vector<CameraFromWorld> from = starts;
    from.insert(from.begin(), c.pose);
    for (FittedPose& fit : minima(problem, tags, lens, c.used, from))
      poses.push_back(std::move(fit));
  }
  std::sort(poses.begin(), poses.end(), better);
  return poses;
}

}  // namespace previz::tracking
