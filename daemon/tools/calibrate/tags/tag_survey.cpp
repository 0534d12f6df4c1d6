#include "daemon/tools/calibrate/tags/tag_survey.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <map>
#include <opencv2/core.hpp>

#include "daemon/core/tracking/tag_map.hpp"
#include "daemon/tools/calibrate/lens/observer.hpp"
#include "daemon/tools/calibrate/tags/moved_tags.hpp"
#include "daemon/tools/calibrate/tags/tag_start.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

constexpr double least_model_error_px = 0.03;
constexpr double median_of_chi_square_8 = 7.344;
constexpr double map_loss_scale = 3;  // standard deviations
constexpr double size_gate = 0.015, size_gate_sigmas = 4;

std::size_t index_of(const TagWalk& walk, int id) {
  const auto found = std::ranges::find(walk.ids, id);
  if (found == walk.ids.end())
    throw Error("tag " + std::to_string(id) +
                " is in no picture; visible: " + tracking::tags_in_words(walk.ids));
  return std::size_t(found - walk.ids.begin());
}

// Leaves only the sightings for which keep(sighting) holds.
template <typename Keep>
void keep_sightings(TagWalk& walk, const Keep& keep) {
  std::erase_if(walk.sightings, [&](const TagSighting& seen) { return !keep(seen); });
}

// Takes out the tags that nothing links to the origin; returns their groups.
std::vector<std::vector<int>> take_out_unlinked(TagWalk& walk, std::size_t origin) {
  std::vector<bool> seen(walk.ids.size(), false), linked(walk.ids.size(), false);
  for (const TagSighting& sighting : walk.sightings) seen[sighting.tag] = true;
  std::vector<std::vector<int>> apart;
  for (const std::vector<std::size_t>& group : linked_tags(walk)) {
    if (std::ranges::find(group, origin) != group.end()) {
      for (const std::size_t t : group) linked[t] = true;
      continue;
    }
    if (!seen[group.front()]) continue;
    apart.emplace_back();
    for (const std::size_t t : group) apart.back().push_back(walk.ids[t]);
  }
  keep_sightings(walk, [&](const TagSighting& sighting) { return linked[sighting.tag]; });
  return apart;
}

std::size_t count_of_pictures(const TagWalk& walk) {
  std::vector<bool> used(walk.pictures.size(), false);
  for (const TagSighting& seen : walk.sightings) used[seen.picture] = true;
  return std::size_t(std::ranges::count(used, true));
}

std::size_t count_of_pairs(const TagWalk& walk) {
  std::vector<int> tags(walk.pictures.size(), 0);
  for (const TagSighting& seen : walk.sightings) ++tags[seen.picture];
  return std::size_t(std::ranges::count(tags, 2));
}

std::size_t count_of_tags(const TagWalk& walk) {
  std::vector<bool> used(walk.ids.size(), false);
  for (const TagSighting& seen : walk.sightings) used[seen.tag] = true;
  return std::size_t(std::ranges::count(used, true));
}

// Returns observations minus unknowns, at least 1.
double degrees_of_freedom(const TagWalk& walk) {
  const double unknowns = 6.0 * double(count_of_pictures(walk)) + 6.0 * double(count_of_tags(walk));
  return std::max(1.0, 8.0 * double(walk.sightings.size()) - unknowns + 6);
}

double middle_of(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

// Returns what is left of the residuals' median when the noise of the pictures is taken out.
double model_error(const TagWalk& walk, const PinholeIntrinsics& lens, const TagPlaces& places) {
  std::vector<double> squares, variances;
  for (const TagSighting& seen : walk.sightings) {
    squares.push_back(tag_squares_px2(seen, lens, places) / median_of_chi_square_8);
    variances.push_back(seen.variance_px2);
  }
  const double fitted = 8.0 * double(walk.sightings.size()) / degrees_of_freedom(walk);
  const double rest = fitted * middle_of(squares) - middle_of(variances);
  return std::sqrt(std::max(rest, least_model_error_px * least_model_error_px));
}

// The state of a survey between its steps.
struct Surveying {
  TagWalk walk;
  PinholeIntrinsics lens;
  std::size_t origin;
  std::optional<LensPrior> lens_prior;
  TagPlaces places;
  double model_error_px = 1;

  TagAdjustment how() const {
    TagAdjustment result;
    result.origin = origin;
    result.model_error_px = model_error_px;
    result.lens_prior = lens_prior;
    return result;
  }
  // Adjusts the places, and the lens if there is a prior of it.
  void adjust(const TagAdjustment& adjustment) {
    TagsAndLens at = adjust_tags_and_lens(walk, {std::move(places), lens}, adjustment);
    places = std::move(at.places);
    lens = at.lens;
  }
  // Adjusts with the loss that keeps what disagrees from bending the rest.
  void adjust_robustly() {
    TagAdjustment robust_how = how();
    robust_how.loss_scale = map_loss_scale;
    adjust(robust_how);
    model_error_px = model_error(walk, lens, places);
  }
};

// Fits with free sizes, and changes the sizes of the walk where the fit contradicts them. Returns
// the standard deviation of the logarithm of each.
std::vector<double> settle_sizes(Surveying& state) {
  TagAdjustment free = state.how();
  free.sizes_free = true;
  free.loss_scale = map_loss_scale;
  TagsAndLens at = adjust_tags_and_lens(state.walk, {state.places, state.lens}, free);
  free.model_error_px = state.model_error_px = model_error(state.walk, at.lens, at.places);
  at = adjust_tags_and_lens(state.walk, std::move(at), free);
  TagPlaces places = std::move(at.places);
  state.lens = at.lens;
  const std::vector<TagCovariance> all = tag_covariances(state.walk, at.lens, places, free);
  std::vector<double> off, sigma(state.walk.ids.size()), seen_off;
  for (std::size_t t = 0; t < state.walk.ids.size(); ++t) {
    off.push_back(std::log(places.sizes_m[t] / state.walk.sizes_m[t]));
    sigma[t] = std::sqrt(all[t][48]);
    if (t == state.origin || sigma[t] > 0) seen_off.push_back(off[t]);
  }
  // The origin's size is held, and may be the one that is wrong: the middle of all is right.
  const double common = middle_of(seen_off);
  bool changed = false;
  for (std::size_t t = 0; t < state.walk.ids.size(); ++t) {
    const double error = off[t] - common;
    if (std::abs(error) < std::max(size_gate, size_gate_sigmas * sigma[t])) continue;
    state.walk.sizes_m[t] *= std::exp(error);
    changed = true;
  }
  // The shape of the free fit, at the scale of the sizes that are right.
  if (changed) {
    const double scale = std::exp(-common);
    state.places = std::move(places);
    for (glm::dmat4& place : state.places.world_from_tag)
      place[3] = glm::dvec4(scale * glm::dvec3(place[3]), 1);
    for (tracking::CameraFromWorld& camera : state.places.cameras) camera.translation *= scale;
  }
  state.places.sizes_m = state.walk.sizes_m;
  return sigma;
}

void insist_that_it_stays(const Surveying& state, const MovedTag& moved) {
  if (moved.id == state.walk.ids[state.origin])
    throw Error("tag " + std::to_string(moved.id) +
                ", which defines the world, did not stay in place (" + words_of(moved) +
                "); fix it in place and film again, or choose another with --origin");
}

// Returns how a tag that was taken out moved, seen by cameras that the other tags place: before
// that they had followed it half the way. `before` is the walk with the tag.
MovedTag measured_by_others(const Surveying& state, TagWalk before, const MovedTag& moved) {
  std::vector<bool> placed(state.walk.pictures.size(), false);
  for (const TagSighting& seen : state.walk.sightings) placed[seen.picture] = true;
  keep_sightings(before, [&](const TagSighting& seen) {
    return before.ids[seen.tag] == moved.id && placed[seen.picture];
  });
  const auto again = most_moved_tag(before, state.lens, state.places, state.model_error_px);
  return again && !again->until.empty() ? *again : moved;
}

// Takes out the tags that do not stay in one place, the worst first.
std::vector<MovedTag> take_out_moved(Surveying& state, std::vector<std::vector<int>>& apart) {
  std::vector<MovedTag> all;
  const std::size_t tags = count_of_tags(state.walk);
  while (true) {
    const auto moved = most_moved_tag(state.walk, state.lens, state.places, state.model_error_px);
    if (!moved) return all;
    insist_that_it_stays(state, *moved);
    all.push_back(*moved);
    const TagWalk before = state.walk;
    if (tags >= 3 && 2 * all.size() > tags)
      throw Error(
          "most of the tags seem to move: is the lens calibration the one "
          "for this camera, at this zoom and focus?");
    keep_sightings(state.walk,
                   [&](const TagSighting& seen) { return state.walk.ids[seen.tag] != moved->id; });
    for (std::vector<int>& group : take_out_unlinked(state.walk, state.origin))
      apart.push_back(std::move(group));
    state.adjust_robustly();
    all.back() = measured_by_others(state, before, *moved);
  }
}

// Takes out sightings that are off, and adjusts the rest by least squares.
void finish(Surveying& state) {
  constexpr int most_rounds = 5;
  for (int round = 0; round < most_rounds; ++round) {
    state.adjust(state.how());
    const std::size_t before = state.walk.sightings.size();
    keep_sightings(state.walk, [&](const TagSighting& seen) {
      const double gate = sighting_gate_px(seen, state.model_error_px);
      return tag_squares_px2(seen, state.lens, state.places) <= 4 * gate * gate;
    });
    state.model_error_px = model_error(state.walk, state.lens, state.places);
    if (state.walk.sightings.size() == before && round > 0) break;
  }
  state.adjust(state.how());
}

constexpr auto all_free = std::array{true, true, true, true, true, true, true, true, true};

// Keeps those coefficients of the lens that boards and tags hold: the sum of squares may grow by
// the logarithm of the number of residuals for each one that is left at 0.
void choose_coefficients(Surveying& state) {
  using Free = std::array<bool, lens_size>;
  const double price = std::log(8.0 * double(state.walk.sightings.size()));
  std::optional<Surveying> best;
  double least = 0;
  // k1, k2, p1, p2, k3: the models of fit_observer.
  for (const auto& [k2, p, k3] :
       {std::array{true, true, true}, std::array{true, true, false}, std::array{true, false, false},
        std::array{false, true, false}, std::array{false, false, false}}) {
    Surveying tried = state;
    tried.lens_prior->free = Free{true, true, true, true, true, k2, p, p, k3};
    LensVector values = lens_vector(tried.lens);
    for (int i = 0; i < lens_size; ++i)
      if (!tried.lens_prior->free[std::size_t(i)]) values[i] = 0;
    tried.lens = with_parameters(tried.lens, values);
    tried.adjust(tried.how());
    const double criterion = chi_square(tried.walk, {tried.places, tried.lens}, tried.how()) +
                             price * double(std::ranges::count(tried.lens_prior->free, true));
    if (folds(tried.lens) || (best && criterion >= least)) continue;
    best = std::move(tried);
    least = criterion;
  }
  if (!best)
    throw Error(
        "every lens that fits boards and tags folds within the picture; calibrate the lens again "
        "with boards near the picture's edges");
  state = std::move(*best);
}

double longest_sigma(const TagCovariance& covariance, int first) {
  cv::Matx33d part;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) part(r, c) = covariance[std::size_t(7 * (first + r) + first + c)];
  cv::Mat1d values;
  cv::eigen(part, values);
  return std::sqrt(std::max(0.0, values(0)));
}

// Returns the largest angle between directions from the tag's middle to the cameras that saw it.
double angle_of_views(const Surveying& state, std::size_t tag) {
  std::vector<glm::dvec3> directions;
  for (const TagSighting& seen : state.walk.sightings) {
    if (seen.tag != tag) continue;
    const glm::dvec3 eye(tracking::world_from_camera(state.places.cameras[seen.picture])[3]);
    directions.push_back(glm::normalize(eye - glm::dvec3(state.places.world_from_tag[tag][3])));
  }
  double widest = 0;
  for (const glm::dvec3& a : directions)
    for (const glm::dvec3& b : directions)
      widest = std::max(widest, std::acos(std::clamp(glm::dot(a, b), -1.0, 1.0)));
  return widest;
}

SurveyedTag surveyed(const Surveying& state, std::size_t tag, const TagCovariance& covariance) {
  SurveyedTag result;
  result.id = state.walk.ids[tag];
  result.size_m = state.places.sizes_m[tag];
  result.world_from_tag = state.places.world_from_tag[tag];
  for (std::size_t r = 0; r < 6; ++r)
    for (std::size_t c = 0; c < 6; ++c) result.covariance[6 * r + c] = covariance[7 * r + c];
  result.rotation_sigma_rad = longest_sigma(covariance, 0);
  result.position_sigma_m = longest_sigma(covariance, 3);
  result.views_rad = angle_of_views(state, tag);
  double squares = 0;
  for (const TagSighting& seen : state.walk.sightings) {
    if (seen.tag != tag) continue;
    ++result.pictures;
    squares += tag_squares_px2(seen, state.lens, state.places);
  }
  result.rms_px = std::sqrt(squares / std::max(1, 4 * result.pictures));
  return result;
}

// Returns by what the residuals show the covariances to be off.
double factor_of_covariances(const Surveying& state) {
  double squares = 0;
  for (const TagSighting& seen : state.walk.sightings)
    squares += tag_squares_px2(seen, state.lens, state.places) /
               (seen.variance_px2 + state.model_error_px * state.model_error_px);
  return squares / degrees_of_freedom(state.walk);
}

// Returns the covariances times what the residuals show them to be off by.
std::vector<TagCovariance> scaled_covariances(const Surveying& state) {
  std::vector<TagCovariance> all =
      tag_covariances(state.walk, state.lens, state.places, state.how());
  const double factor = factor_of_covariances(state);
  for (TagCovariance& covariance : all)
    for (double& value : covariance) value *= factor;
  return all;
}

void measure(const Surveying& state, TagSurvey& survey) {
  const std::vector<TagCovariance> covariances = scaled_covariances(state);
  double squares = 0;
  for (std::size_t t = 0; t < state.walk.ids.size(); ++t) {
    SurveyedTag tag = surveyed(state, t, covariances[t]);
    if (tag.pictures > 0) survey.tags.push_back(tag);
    squares += tag.rms_px * tag.rms_px * 4 * tag.pictures;
  }
  survey.pictures = count_of_pictures(state.walk);
  survey.pictures_of_pairs = count_of_pairs(state.walk);
  survey.sightings_used = state.walk.sightings.size();
  survey.rms_px = std::sqrt(squares / std::max(1.0, 4.0 * double(survey.sightings_used)));
  survey.model_error_px = state.model_error_px;
}

// Fills in what is known of the lens after the adjustment.
void measure_lens(const Surveying& state, TagSurvey& survey) {
  survey.lens = state.lens;
  if (!state.lens_prior) return;
  TagAdjustment all = state.how();
  all.lens_prior->free = all_free;
  survey.lens_covariance = lens_covariance(state.walk, {state.places, state.lens}, all) *
                           std::max(1.0, factor_of_covariances(state));
  const LensVector off = lens_vector(state.lens) - state.lens_prior->values;
  survey.prior_chi_square = off.dot(state.lens_prior->information * off);
}

// Throws if the map explains the pictures worse than the tracker would accept.
void insist_on_lens(const TagSurvey& survey, const PinholeIntrinsics& lens) {
  if (survey.rms_px <= tracking::consistency_gate_px(lens)) return;
  throw Error(
      fmt::format("no map fits the pictures: at best, corners are off by {:.1f} px; is "
                  "the lens calibration the one for this camera, at this zoom and focus?",
                  survey.rms_px));
}

const SurveyedTag& tag_by_id(const TagSurvey& survey, int id) {
  const auto found = std::ranges::find(survey.tags, id, &SurveyedTag::id);
  if (found == survey.tags.end())
    throw Error("tag " + std::to_string(id) +
                " of --distance has no position: it was not seen, moved, or is not linked "
                "to the others");
  return *found;
}

void scale_to(const StatedDistance& stated, TagSurvey& survey) {
  const glm::dvec3 a(tag_by_id(survey, stated.a).world_from_tag[3]);
  const glm::dvec3 b(tag_by_id(survey, stated.b).world_from_tag[3]);
  survey.size_factor = stated.metres / glm::distance(a, b);
  for (SurveyedTag& tag : survey.tags) {
    tag.size_m *= survey.size_factor;
    tag.position_sigma_m *= survey.size_factor;
    tag.world_from_tag[3] = glm::dvec4(survey.size_factor * glm::dvec3(tag.world_from_tag[3]), 1);
    for (std::size_t r = 0; r < 6; ++r)
      for (std::size_t c = 0; c < 6; ++c)
        tag.covariance[6 * r + c] *=
            (r < 3 ? 1 : survey.size_factor) * (c < 3 ? 1 : survey.size_factor);
  }
}

}  // namespace

TagSurvey survey_tags(const TagWalk& walk, const PinholeIntrinsics& lens,
                      const TagSurveyOptions& options) {
  Surveying state{walk, lens, index_of(walk, options.origin), options.lens_prior, {}};
  TagSurvey survey;
  survey.sightings = walk.sightings.size();
  survey.apart = take_out_unlinked(state.walk, state.origin);
  if (count_of_tags(state.walk) < 2)
    throw Error("no picture shows another tag together with tag " + std::to_string(options.origin) +
                "; visible: " + tracking::tags_in_words(walk.ids));
  state.places = start_of_tags(state.walk, lens, state.origin);
  const std::vector<double> size_sigma = settle_sizes(state);
  state.adjust_robustly();
  state.adjust_robustly();
  survey.moved = take_out_moved(state, survey.apart);
  finish(state);
  if (state.lens_prior) {
    choose_coefficients(state);
    finish(state);
  }
  measure(state, survey);
  measure_lens(state, survey);
  insist_on_lens(survey, state.lens);
  for (SurveyedTag& tag : survey.tags) {
    const std::size_t t = index_of(walk, tag.id);
    tag.stated_size_m = walk.sizes_m[t];
    tag.size_sigma = size_sigma[t];
  }
  if (options.stated) scale_to(*options.stated, survey);
  for (SurveyedTag& tag : survey.tags)
    tag.world_from_tag = options.world_from_origin * tag.world_from_tag;
  return survey;
}

}  // namespace previz::calibrate
