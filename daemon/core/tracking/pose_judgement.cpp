#include "daemon/core/tracking/pose_judgement.hpp"

#include <apriltag/apriltag.h>
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <iterator>
#include <optional>
#include <utility>

#include "daemon/core/set/check.hpp"
#include "daemon/core/tracking/other_tags.hpp"
#include "daemon/core/tracking/pose_starts.hpp"
#include "daemon/core/tracking/tag_family.hpp"
#include "daemon/core/tracking/tag_map.hpp"
#include "drivers/error.hpp"
#include "drivers/median.hpp"

namespace previz::tracking {
namespace {

constexpr std::size_t kMostKept = 8;  // frames of a kind
constexpr std::size_t kMostPictures = 5;
constexpr double kDoubtfulShare = 0.05;  // of the tracked frames
constexpr double kLeastGain = 4;         // by which a cause lessens the residuals' mean square
constexpr double kDecisive = 10;         // difference of Bayesian information criteria
constexpr double kWorthAFactor = 0.004;
constexpr double kAgreesPx = 0.5;      // of tags that disagreed before
constexpr std::size_t kLeastTags = 3;  // of two, one that moved away looks like a factor of sizes
constexpr double kSameFactor = 0.015;
// A factor is looked for in so much of the frames first.
constexpr std::size_t kScannedFrames = 3, kScannedTags = 8;

// An explanation of residuals, by a model with further unknowns.
struct Cause {
  double chi_square = 0, rms_px = 0;
  int residuals = 0, degrees_of_freedom = 0, unknowns = 0;  // unknowns beside the poses
  double value = 0;                                         // factor or px

  double mean_square() const { return chi_square / std::max(1, degrees_of_freedom); }
  // Bayesian information criterion of residuals of unknown variance (Schwarz 1978).
  double criterion() const {
    return residuals * std::log(chi_square / residuals) + unknowns * std::log(double(residuals));
  }
};

void add(Cause& all, std::size_t tags, double chi_square, int degrees, double rms_px) {
  all.residuals += int(8 * tags);
  all.degrees_of_freedom += degrees;
  all.chi_square += chi_square;
  all.rms_px += rms_px * rms_px * double(tags);  // see mean_of()
}

Cause mean_of(Cause all) {
  all.rms_px = std::sqrt(8 * all.rms_px / std::max(1, all.residuals));
  return all;
}

using Frames = std::vector<JudgedFrame>;
// Changes what is believed about a frame by a factor.
using Change = void(double factor, std::vector<TagObservation>&, PinholeIntrinsics&);

void scale_sizes(double factor, std::vector<TagObservation>& tags, PinholeIntrinsics& /*lens*/) {
  for (TagObservation& tag : tags) tag.size_m *= factor;
}

void scale_focal_length(double factor, std::vector<TagObservation>& /*tags*/,
                        PinholeIntrinsics& lens) {
  lens.fx *= factor;
  lens.fy *= factor;
}

// Returns the best pose over all of the tags, from these starts.
std::optional<FittedPose> best_fit(const std::vector<TagObservation>& tags,
                                   const PinholeIntrinsics& lens,
                                   const std::vector<CameraFromWorld>& starts) {
  std::optional<FittedPose> best;
  for (const CameraFromWorld& start : starts) {
    auto fit = refitted_pose(tags, lens, start);
    if (fit && std::isfinite(fit->rms_px) && !(best && best->chi_square <= fit->chi_square))
      best = std::move(fit);
  }
  return best;
}

// Fits the frames under a change, and leaves their poses there: each from the pose that it has,
// and, `anew` or if that leads nowhere, from all of its starts.
std::optional<Cause> fit_changed(Frames& frames, const PinholeIntrinsics& lens, Change& change,
                                 double factor, bool anew = false) {
  Cause cause;
  cause.unknowns = 1;
  cause.value = factor;
  for (JudgedFrame& frame : frames) {
    std::vector<TagObservation> tags = frame.tags;
    PinholeIntrinsics changed = lens;
    change(factor, tags, changed);
    auto fit = best_fit(tags, changed, {frame.pose});
    if (anew || !fit) {
      std::vector<CameraFromWorld> starts = pose_starts(tags, changed);
      starts.push_back(frame.pose);
      fit = best_fit(tags, changed, starts);
    }
    if (!fit) return std::nullopt;
    frame.pose = fit->pose;
    add(cause, tags.size(), fit->chi_square, fit->degrees_of_freedom, fit->rms_px);
  }
  --cause.degrees_of_freedom;
  return mean_of(cause);
}

// Returns some of the tags: each next one is as far as can be from those before it.
std::vector<TagObservation> spread(const std::vector<TagObservation>& tags) {
  std::vector<TagObservation> some;
  std::vector<double> distances(tags.size(), HUGE_VAL);
  for (std::size_t next = 0; some.size() < std::min(kScannedTags, tags.size());) {
    some.push_back(tags[next]);
    for (std::size_t i = 0; i < tags.size(); ++i)
      distances[i] =
          std::min(distances[i], glm::distance(tags[i].corners[0], tags[next].corners[0]));
    next = std::size_t(std::ranges::max_element(distances) - distances.begin());
  }
  return some;
}

// Returns some of the frames, with some of their tags.
Frames scanned(const Frames& frames) {
  Frames some;
  const std::size_t count = std::min(kScannedFrames, frames.size());
  for (std::size_t i = 0; i < count; ++i) {
    const JudgedFrame& frame = frames[i * frames.size() / count];
    some.push_back({spread(frame.tags), frame.pose, {}});
  }
  return some;
}

// Finds the factor between 0.4 and 2.5 that fits best: by a scan of few tags whose poses follow
// the factor, then, with all, by halving the scan's step. Returns nothing if none is worth a word,
// or once it has to stop.
std::optional<Cause> cause_by_factor(Frames frames, const PinholeIntrinsics& lens, Change& change,
                                     const std::stop_token& stop) {
  constexpr double step = 0.025, finest = 2e-5, farthest = 0.9;  // of the factor's logarithm
  std::optional<Cause> best;
  double at = 0;
  const auto look_at = [&](Frames& some, double exponent, bool anew = false) {
    if (std::abs(exponent) > farthest || stop.stop_requested()) return false;
    const auto cause = fit_changed(some, lens, change, std::exp(exponent), anew);
    if (!cause || (best && best->chi_square <= cause->chi_square)) return false;
    best = cause;
    at = exponent;
    return true;
  };
  Frames few = scanned(frames);
  look_at(few, 0, true);
  for (const double way : {step, -step}) {
    Frames following = few;
    for (int i = 1; i * step <= farthest; ++i) look_at(following, i * way);
  }
  best.reset();
  look_at(frames, at, true);
  for (double by = step / 2; by > finest; by /= 2)
    while (look_at(frames, at - by) || look_at(frames, at + by)) {
    }
  if (!best || stop.stop_requested() || std::abs(best->value - 1) < kWorthAFactor)
    return std::nullopt;
  return best;
}

std::optional<Cause> cause_by_rows(const Frames& frames, const PinholeIntrinsics& lens,
                                   bool also_moves) {
  Cause cause;
  for (const JudgedFrame& frame : frames) {
    const auto fit = fit_of_rows(frame.tags, lens, frame.fit.pose, also_moves);
    if (!fit) return std::nullopt;
    add(cause, frame.tags.size(), fit->chi_square, fit->degrees_of_freedom, fit->rms_px);
    cause.unknowns += also_moves ? 6 : 3;
    cause.value = std::max(cause.value, fit->moved_px);
  }
  return mean_of(cause);
}

std::string percent(double factor) {
  return fmt::format("{:.1f} %", 100 * factor);
}

// Says that the sizes may be of all that is printed, where they should be of its border.
std::string border_words(const std::string& family, double factor) {
  const TagFamily made = make_tag_family(family);
  const double inside = double(made->width_at_border) / made->total_width;
  if (std::abs(factor / inside - 1) > kSameFactor) return "";
  return fmt::format(
      "; that is {} of the {} cells across a print of {}: size_m is the side of the inner square, "
      "where black and white meet, not of the outer edge",
      made->width_at_border, made->total_width, family);
}

std::string size_words(const Frames& frames, const std::string& family, double factor) {
  const TagObservation& tag = frames.front().tags.front();
  return fmt::format(
             "all tags measure {} of their size_m, as prints that were scaled to a page do: "
             "measure one, "
             "and correct the sizes (tag {}: {:.4g} m in place of {:.4g} m)",
             percent(factor), tag.id, factor * tag.size_m, tag.size_m) +
         border_words(family, factor);
}

std::string focal_words(double factor) {
  return fmt::format(
      "the lens's fx and fy are {} too {}, as after a zoom or with another lens's file: calibrate "
      "the lens as it was",
      percent(std::abs(1 - 1 / factor)), factor > 1 ? "small" : "large");
}

std::string rows_words(double moved_px) {
  return fmt::format(
      "the rows of a picture do not fit one pose, as with a rolling shutter: the tags move by "
      "{:.1f} px while its height is read; move the camera more slowly, or use one with a global "
      "shutter or a faster readout",
      moved_px);
}

// Returns the likely cause of the frames' residuals.
std::string cause_words(const Frames& frames, const PinholeIntrinsics& lens,
                        const std::string& family, const std::stop_token& stop) {
  Cause none;
  for (const JudgedFrame& frame : frames)
    add(none, frame.tags.size(), frame.fit.chi_square, frame.fit.degrees_of_freedom, 0);
  std::vector<std::pair<Cause, std::string>> causes;
  const auto offer = [&](const std::optional<Cause>& cause, const auto& words) {
    if (cause && kLeastGain * cause->mean_square() < none.mean_square())
      causes.emplace_back(*cause, words(cause->value));
  };
  offer(cause_by_factor(frames, lens, scale_sizes, stop),
        [&](double factor) { return size_words(frames, family, factor); });
  offer(cause_by_factor(frames, lens, scale_focal_length, stop), focal_words);
  const auto turning = cause_by_rows(frames, lens, false),
             moving = cause_by_rows(frames, lens, true);
  const bool also_moves =
      moving && (!turning || moving->criterion() < turning->criterion() - kDecisive);
  offer(also_moves ? moving : turning, rows_words);
  std::ranges::sort(causes, {}, [](const auto& one) { return one.first.criterion(); });
  std::string text;
  for (const auto& [cause, words] : causes)
    if (cause.criterion() < causes.front().first.criterion() + kDecisive)
      add_to_list(text, fmt::format("{} ({:.2f} px remain)", words, cause.rms_px), "; or ");
  if (std::ranges::all_of(frames, [](const JudgedFrame& one) { return one.tags.size() == 2; })) {
    const std::vector<TagObservation>& two = frames.front().tags;
    add_to_list(text,
                tags_in_words({two[0].id, two[1].id}) +
                    " do not stand as the set has them: `previz calibrate tags TAKE`",
                "; or ");
  }
  return text.empty() ? "the lens, the [[tag]] tables and how flat the tags are do not fit "
                        "together: `previz calibrate tags` measures where the tags are"
                      : text;
}

}  // namespace

PoseJudgement::PoseJudgement(const set::Tracking& tracking, const ObserverCalibration& camera)
    : tracking_(tracking), camera_(camera), trust_(tracking, camera.intrinsics) {}

void PoseJudgement::add(const FramePtr& frame, const Track& track) {
  ++frames_;
  std::map<int, int> times;
  for (const int id : track.seen_tags) ++times[id];
  for (const auto& [id, count] : times)
    if (count > 1) ++doubles_[id];
  if (!times.empty()) {
    has_seen_a_tag_ = true;
    without_tags_.clear();
  }
  if (tracking_.enabled && !has_seen_a_tag_ && std::has_single_bit(frames_) &&
      without_tags_.size() < kMostPictures)
    without_tags_.push_back(frame);

  std::vector<TagObservation> tags;  // without those that are there twice
  std::ranges::copy_if(track.observations, std::back_inserter(tags),
                       [&](const TagObservation& tag) { return times[tag.id] == 1; });
  if (!track.pose) {
    if (tags.size() >= kLeastTags && track.candidates.empty()) {
      ++at_odds_;
      if (lost_.size() < kMostKept) lost_.push_back({std::move(tags), {}, {}});
    }
    return;
  }
  ++tracked_;
  trust_.add(track);
  for (const TagObservation& tag : tags) measured_.insert(tag.id);
  for (const UnusableTag& tag : track.unusable) ++unusable_[tag.id][tag.why];
  const std::vector<int>& used = track.pose->tags;
  std::erase_if(tags, [&](const TagObservation& tag) {
    return std::ranges::find(used, tag.id) == used.end();
  });
  if (tags.empty()) return;
  const CameraFromWorld pose = camera_from_world(track.pose->world_from_camera);
  const auto fit = refitted_pose(tags, camera_.intrinsics, pose);
  if (!fit) return;
  ++judged_;
  const double expected = expected_rms_px(tags, fit->degrees_of_freedom);
  if (fit->chi_square <= rare_chi_square(fit->degrees_of_freedom) ||
      fit->rms_px <= std::hypot(expected, kWorthAWordPx))
    return;
  ++doubtful_;
  rms_px_.push_back(fit->rms_px);
  expected_px_.push_back(expected);
  worst_.push_back({std::move(tags), pose, *fit});
  std::ranges::sort(worst_, std::greater(),
                    [](const JudgedFrame& one) { return one.fit.chi_square; });
  if (worst_.size() > kMostKept) worst_.pop_back();
}

std::string PoseJudgement::why_unusable(int id) const {
  const auto unusable = unusable_.find(id);
  if (unusable == unusable_.end() || measured_.contains(id)) return "";
  std::string why;
  for (const auto& [trouble, frames] : unusable->second)
    add_to_list(why, trouble + " in " + set::plural(frames, "frame"), "; ");
  return why;
}

std::string PoseJudgement::doubt_about_residuals(const std::stop_token& stop) const {
  if (doubtful_ == 0 || double(doubtful_) < kDoubtfulShare * double(judged_)) return "";
  return fmt::format(
      "corners of {} of {} tracked frames are off by {:.2f} px where {:.2f} px is to be expected "
      "(medians): {}",
      doubtful_, tracked_, median(rms_px_), median(expected_px_),
      cause_words(worst_, camera_.intrinsics, tracking_.family, stop));
}

std::string PoseJudgement::doubt_about_lost(const std::stop_token& stop) const {
  if (lost_.empty()) return "";
  const auto size = cause_by_factor(lost_, camera_.intrinsics, scale_sizes, stop);
  const auto focal = cause_by_factor(lost_, camera_.intrinsics, scale_focal_length, stop);
  const bool is_focal = focal && (!size || focal->rms_px < size->rms_px);
  const auto& cause = is_focal ? focal : size;
  if (!cause || !(cause->rms_px < kAgreesPx)) return "";
  return fmt::format(
      "tags disagree in {} of {}, and agree within {:.2f} px if {}", at_odds_,
      set::plural(frames_, "frame"), cause->rms_px,
      is_focal ? focal_words(cause->value) : size_words(lost_, tracking_.family, cause->value));
}

std::string PoseJudgement::doubt_about_none(const std::stop_token& stop) const {
  if (has_seen_a_tag_ || without_tags_.empty()) return "";
  const std::string instead = other_tags(without_tags_, tracking_.family, camera_.response, stop);
  return instead.empty() ? "" : "no tag of " + tracking_.family + " in any picture: " + instead;
}

std::vector<std::string> PoseJudgement::doubts(const std::stop_token& stop) const {
  std::vector<std::string> all{
      doubt_about_none(stop), doubt_about_residuals(stop), doubt_about_lost(stop),
      doubles_in_words(doubles_, "frame", "only one that is where the other tags have it is used")};
  for (const int id : trust_.moved())
    if (!stop.stop_requested()) all.push_back(fmt::format("tag {} {}", id, trust_.words(id)));
  std::erase(all, "");
  return stop.stop_requested() ? std::vector<std::string>{} : all;
}

}  // namespace previz::tracking
