#include "daemon/core/fit/parts.hpp"

#include <algorithm>
#include <functional>
#include <glm/geometric.hpp>

#include "daemon/core/fit/translation.hpp"

namespace previz::fit {
namespace {

// This share of the pieces must speak for a part's own translation and against another place. The
// edges that lie along its translation speak for both: of a sheet they are half, of a box a third.
constexpr double clearly = 0.3;

// A part that is not off may be in this place.
struct OtherPlace {
  std::vector<glm::dvec2> shifts;  // one for each of its pieces
  double agreed = 0;               // so many of the pieces agree on it
};

OtherPlace place_at(const std::vector<EdgeSample>& pieces, std::vector<glm::dvec2> shifts) {
  OtherPlace place{std::move(shifts), 0};
  for (std::size_t i = 0; i < pieces.size(); ++i)
    place.agreed += agreement(pieces[i], place.shifts[i]);
  return place;
}

// Returns the translation of the pieces if they clearly lie elsewhere than in these places; nothing
// otherwise.
std::optional<glm::dvec3> clear_translation(const std::vector<EdgeSample>& pieces,
                                            std::size_t looked_at,
                                            const std::vector<OtherPlace>& places) {
  const double count = double(pieces.size());
  const auto is_enough = [&](double agreed) {
    return agreed >= most_of * double(looked_at) &&
           std::ranges::all_of(places, [&](const OtherPlace& place) {
             return agreed - place.agreed >= clearly * count;
           });
  };
  // A piece agrees with a translation by 1 at most, so that all of them agree by their count. Where
  // that is not enough, no translation is, and most parts end here: to look for one takes long.
  if (!is_enough(count)) return {};
  const glm::dvec3 translation_m = agreed_translation(pieces);
  double agreed = 0;
  for (const EdgeSample& piece : pieces) agreed += agreement(piece, shift_by(piece, translation_m));
  const auto is_apart = [&](const OtherPlace& place) {
    double apart_px = 0;
    for (std::size_t i = 0; i < pieces.size(); ++i)
      apart_px += glm::distance(place.shifts[i], shift_by(pieces[i], translation_m)) / count;
    return apart_px > most_off_px;
  };
  if (!is_enough(agreed) || !std::ranges::all_of(places, is_apart)) return {};
  return translation_m;
}

}  // namespace

void Parts::look(const std::map<std::size_t, PartVotes>& parts, const Votes& all,
                 const std::vector<EdgeSample>& found) {
  JudgedParts& judged_now = frames_.emplace_back();
  if (frames_.size() > frames_judged) frames_.pop_front();
  for (const auto& [number, part] : parts) {
    if (number == no_part) continue;
    Judged& judged = judged_now[number];
    judged.found = part.votes.pieces();
    const auto rest = residual_shift(number, all.without(part.votes), found);
    if (!rest) continue;
    judged.looked_at = part.looked_at;
    for (const EdgeSample& sample : found)
      if (sample.part == number) judged.pieces.push_back({sample, *rest});
  }
}

Parts::JudgedParts Parts::judged() const {
  JudgedParts all;
  for (const JudgedParts& frame : frames_)
    for (const auto& [number, judged] : frame) {
      Judged& sum = all[number];
      sum.found += judged.found;
      sum.looked_at += judged.looked_at;
      sum.pieces.insert(sum.pieces.end(), judged.pieces.begin(), judged.pieces.end());
    }
  return all;
}

std::vector<PartOff> Parts::off(const std::vector<std::string>& names) const {
  std::vector<PartOff> all;
  for (const auto& [number, judged] : judged()) {
    if (judged.pieces.size() < least_pieces) continue;
    std::vector<EdgeSample> pieces;
    std::vector<glm::dvec2> common, turned;
    for (const Piece& piece : judged.pieces) {
      pieces.push_back(piece.sample);
      common.push_back(piece.rest.common);
      turned.push_back(piece.rest.turned);
    }
    std::vector<glm::dvec2> where_the_model_says(pieces.size(), glm::dvec2(0));
    const auto translation_m = clear_translation(
        pieces, judged.looked_at,
        {place_at(pieces, std::move(where_the_model_says)), place_at(pieces, std::move(common)),
         place_at(pieces, std::move(turned))});
    if (!translation_m) continue;
    double length_px = 0;
    for (const EdgeSample& piece : pieces)
      length_px += glm::length(shift_by(piece, *translation_m)) / double(pieces.size());
    all.push_back({names[number], length_px, pieces.size()});
  }
  std::ranges::stable_sort(all, std::ranges::greater(), &PartOff::shift_px);
  return all;
}

std::vector<std::string> Parts::not_judged(const std::vector<std::string>& names) const {
  const JudgedParts all = judged();
  std::vector<std::string> too_little;
  for (std::size_t number = 0; number < names.size(); ++number) {
    const auto at = all.find(number);
    if (at == all.end() || at->second.found < least_pieces) too_little.push_back(names[number]);
  }
  return too_little;
}

}  // namespace previz::fit
