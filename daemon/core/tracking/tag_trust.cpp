#include "daemon/core/tracking/tag_trust.hpp"

#include <algorithm>

namespace previz::tracking {
namespace {

constexpr double kDeviate = 4.753;  // of the normal distribution: one in a million is above
constexpr std::size_t kMostViews = 8;

}  // namespace

double rare_chi_square(int degrees) {  // Wilson and Hilferty 1931
  const double spread = 2.0 / (9.0 * degrees);
  return degrees * std::pow(1 - spread + kDeviate * std::sqrt(spread), 3);
}

TagTrust::TagTrust(const set::Tracking& tracking, const PinholeIntrinsics& lens,
                   double memory_frames)
    : tracking_(tracking), lens_(lens), kept_(1 - 1 / memory_frames) {}

bool TagTrust::disagrees(const TagObservation& tag, const Pose& pose) const {
  const double squares = squares_of(
      corners_off(lens_, view_of(tag, pose.world_from_camera), tag.world_from_tag, tag.size_m));
  return !std::isfinite(squares) || (squares > 4 * kWorthAWordPx * kWorthAWordPx &&
                                     chi_square_of(lens_, tag, pose) > rare_chi_square(8));
}

void TagTrust::add(const Track& track) {
  if (!track.pose) return;
  std::vector<const TagObservation*> unused;
  const std::vector<int>& used = track.pose->tags;
  for (const TagObservation& tag : track.observations)
    if (std::ranges::count(track.seen_tags, tag.id) == 1 &&
        std::ranges::find(used, tag.id) == used.end())
      unused.push_back(&tag);
  if (used.size() < 2 || used.size() + unused.size() < 3 || used.size() <= unused.size()) return;
  const auto count = [&](int id, bool disagrees) -> Judged& {
    Judged& judged = judged_[id];
    judged.agrees = kept_ * judged.agrees + (disagrees ? 0 : 1);
    judged.disagrees = kept_ * judged.disagrees + (disagrees ? 1 : 0);
    return judged;
  };
  for (const int id : used) count(id, false);
  for (const TagObservation* tag : unused) {
    const bool is_off = disagrees(*tag, *track.pose);
    Judged& judged = count(tag->id, is_off);
    if (!is_off) continue;
    judged.views.push_back(view_of(*tag, track.pose->world_from_camera));
    if (judged.views.size() > kMostViews) judged.views.pop_front();
  }
}

std::set<int> TagTrust::moved(int frames) const {
  std::set<int> ids;
  for (const auto& [id, judged] : judged_)
    if (judged.disagrees > judged.agrees && judged.disagrees > frames - 0.5) ids.insert(id);
  return ids;
}

std::string TagTrust::words(int id) const {
  const auto tag = std::ranges::find(tracking_.tags, id, &set::Tag::id);
  const auto judged = judged_.find(id);
  if (tag == tracking_.tags.end() || judged == judged_.end() || judged->second.views.empty())
    return "is not where the set has it";
  const std::vector<TagView> views(judged->second.views.begin(), judged->second.views.end());
  return why_elsewhere(*tag, tracking_.tags, lens_, views);
}

}  // namespace previz::tracking
