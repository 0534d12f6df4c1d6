#include "daemon/tools/calibrate/tags/tag_lens.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <optional>

#include "daemon/tools/calibrate/lens/observer.hpp"
#include "daemon/tools/calibrate/lens/uncertainty.hpp"
#include "drivers/calibration/pinhole.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

// The grid for the rotation that is common to two lenses.
constexpr double rotation_step = 1e-6;

glm::dvec2 pixel_of(const PinholeIntrinsics& lens, const glm::dvec3& ray) {
  return distort(lens, {ray.x / ray.z, ray.y / ray.z});
}

// Returns the rotation vector by which `other`'s rays are turned to lie where `lens` shows them,
// by least squares over the picture.
glm::dvec3 common_rotation(const PinholeIntrinsics& lens, const PinholeIntrinsics& other,
                           const std::vector<glm::dvec3>& rays) {
  cv::Matx33d normal = cv::Matx33d::zeros();
  cv::Vec3d rhs(0, 0, 0);
  for (const glm::dvec3& ray : rays) {
    const glm::dvec2 at = pixel_of(other, ray), off = pixel_of(lens, ray) - at;
    cv::Matx<double, 2, 3> by_turn;
    for (int c = 0; c < 3; ++c) {
      glm::dvec3 axis(0);
      axis[c] = rotation_step;
      const glm::dvec2 d = (pixel_of(other, ray + glm::cross(axis, ray)) - at) / rotation_step;
      by_turn(0, c) = d.x, by_turn(1, c) = d.y;
    }
    normal += by_turn.t() * by_turn;
    rhs += by_turn.t() * cv::Vec2d(off.x, off.y);
  }
  const cv::Vec3d turn = normal.solve(rhs, cv::DECOMP_SVD);
  return {turn[0], turn[1], turn[2]};
}

// Surveys with the lens free, and widens the prior until the tags do not contradict it. Multiplies
// `factor` by what the prior's covariance is widened by.
TagSurvey survey_with_free_lens(const TagWalk& walk, const PinholeIntrinsics& lens,
                                TagSurveyOptions& options, double& factor) {
  constexpr int most_rounds = 8;
  constexpr double sigmas = 3;
  TagSurvey survey = survey_tags(walk, lens, options);
  for (int round = 0; round < most_rounds; ++round) {
    LensMatrix& information = options.lens_prior->information;
    const double redundancy = lens_size - cv::trace(survey.lens_covariance * information);
    if (!(redundancy > 0) ||
        survey.prior_chi_square < redundancy + sigmas * std::sqrt(2 * redundancy))
      break;
    const double wider = survey.prior_chi_square / redundancy;
    factor *= wider;
    information = information * (1 / wider);
    survey = survey_tags(walk, survey.lens, options);
  }
  return survey;
}

std::string why_it_stays(const RefinedLens& refined) {
  if (refined.survey.pictures < least_lens_pictures)
    return fmt::format("only {} pictures show tags; {} are needed", refined.survey.pictures,
                       least_lens_pictures);
  if (refined.sigma_px > refined.sigma_before_px / std::sqrt(2.0))
    return fmt::format(
        "the tags add little to the boards ({:.3f} px in doubt at worst, {:.3f} px by the boards "
        "alone)",
        refined.sigma_px, refined.sigma_before_px);
  return "";
}

}  // namespace

double worst_projection_px(const PinholeIntrinsics& lens, const LensMatrix& covariance) {
  BundleFit fit;
  const LensVector values = lens_vector(lens);
  fit.bundle.lens.assign(values.val, values.val + lens_size);
  fit.lens_covariance.assign(covariance.val, covariance.val + lens_size * lens_size);
  std::vector<glm::dvec3> rays = picture_rays(lens);
  for (const double x : {0.0, lens.width - 1.0})
    for (const double y : {0.0, lens.height - 1.0})
      if (const auto plane = undistort(lens, {x, y}))
        rays.push_back(glm::normalize(glm::dvec3(*plane, 1)));
  return worst_px(projection_uncertainty(fit, project_pinhole, rays));
}

double corner_difference_px(const PinholeIntrinsics& lens, const PinholeIntrinsics& other) {
  const std::vector<glm::dvec3> rays = picture_rays(lens);
  const glm::dvec3 turn = common_rotation(lens, other, rays);
  double farthest = 0;
  for (const double x : {0.0, lens.width - 1.0})
    for (const double y : {0.0, lens.height - 1.0})
      if (const auto plane = undistort(lens, {x, y})) {
        const glm::dvec3 ray(*plane, 1);
        farthest = std::max(farthest, glm::distance(glm::dvec2(x, y),
                                                    pixel_of(other, ray + glm::cross(turn, ray))));
      }
  return farthest;
}

RefinedLens survey_tags_and_lens(const TagWalk& walk, const PinholeIntrinsics& lens,
                                 const TagSurveyOptions& options, const LensPrior& prior) {
  RefinedLens refined;
  TagSurveyOptions held = options, free = options;
  held.lens_prior.reset();
  free.lens_prior = prior;
  std::optional<TagSurvey> before;
  std::string why_none;
  try {
    before = survey_tags(walk, lens, held);
    refined.rms_before_px = before->rms_px;
  } catch (const Error& error) {
    why_none = error.what();
  }
  try {
    refined.survey = survey_with_free_lens(walk, lens, free, refined.boards_factor);
  } catch (const Error& error) {
    if (!before) throw;
    refined.survey = *before;
    refined.why_not = error.what();
    return refined;
  }
  const LensMatrix boards = free.lens_prior->information.inv(cv::DECOMP_CHOLESKY);
  refined.sigma_before_px = worst_projection_px(refined.survey.lens, boards);
  refined.sigma_px = worst_projection_px(refined.survey.lens, refined.survey.lens_covariance);
  refined.corner_moved_px = corner_difference_px(lens, refined.survey.lens);
  refined.why_not = why_it_stays(refined);
  refined.is_refined = refined.why_not.empty();
  if (refined.is_refined) return refined;
  if (!before) throw Error(why_none);
  refined.survey = *before;
  return refined;
}

}  // namespace previz::calibrate
