#include "daemon/core/fit/things.hpp"

#include <algorithm>
#include <functional>
#include <glm/geometric.hpp>

#include "daemon/core/fit/way.hpp"

namespace previz::fit {
namespace {

// This share of the pieces must speak for a thing's own way and against another place. The edges
// that lie along its way speak for both: of a sheet they are half, of a box a third.
constexpr double clearly = 0.3;

// A thing that is not off may be in this place.
struct OtherPlace {
  std::vector<glm::dvec2> shifts;  // one for each of its pieces
  double agreed = 0;               // so many of the pieces agree on it
};

OtherPlace place_at(const std::vector<Looked>& pieces, std::vector<glm::dvec2> shifts) {
  OtherPlace place{std::move(shifts), 0};
  for (std::size_t i = 0; i < pieces.size(); ++i)
    place.agreed += agreement(pieces[i], place.shifts[i]);
  return place;
}

// Returns the way of the pieces if they clearly lie elsewhere than in these places; nothing
// otherwise.
std::optional<glm::dvec3> clear_way(const std::vector<Looked>& pieces, std::size_t looked_at,
                                    const std::vector<OtherPlace>& places) {
  const double count = double(pieces.size());
  const auto is_enough = [&](double agreed) {
    return agreed >= most_of * double(looked_at) &&
           std::ranges::all_of(places, [&](const OtherPlace& place) {
             return agreed - place.agreed >= clearly * count;
           });
  };
  // A piece agrees with a way by 1 at most, so that all of them agree by their count. Where that is
  // not enough, no way is, and most things end here: to look for a way takes long.
  if (!is_enough(count)) return {};
  const glm::dvec3 way_m = agreed_way(pieces);
  double agreed = 0;
  for (const Looked& piece : pieces) agreed += agreement(piece, shift_by(piece, way_m));
  const auto is_apart = [&](const OtherPlace& place) {
    double apart_px = 0;
    for (std::size_t i = 0; i < pieces.size(); ++i)
      apart_px += glm::distance(place.shifts[i], shift_by(pieces[i], way_m)) / count;
    return apart_px > most_off_px;
  };
  if (!is_enough(agreed) || !std::ranges::all_of(places, is_apart)) return {};
  return way_m;
}

}  // namespace

void Things::look(const std::map<std::size_t, ThingVotes>& things, const Votes& all,
                  const std::vector<Looked>& found) {
  JudgedThings& judged_now = frames_.emplace_back();
  if (frames_.size() > frames_judged) frames_.pop_front();
  for (const auto& [number, thing] : things) {
    if (number == no_thing) continue;
    Judged& judged = judged_now[number];
    judged.found = thing.votes.pieces();
    const auto rest = shift_of_rest(number, all.without(thing.votes), found);
    if (!rest) continue;
    judged.looked_at = thing.looked_at;
    for (const Looked& looked : found)
      if (looked.thing == number) judged.pieces.push_back({looked, *rest});
  }
}

Things::JudgedThings Things::judged() const {
  JudgedThings all;
  for (const JudgedThings& frame : frames_)
    for (const auto& [number, judged] : frame) {
      Judged& sum = all[number];
      sum.found += judged.found;
      sum.looked_at += judged.looked_at;
      sum.pieces.insert(sum.pieces.end(), judged.pieces.begin(), judged.pieces.end());
    }
  return all;
}

std::vector<ThingOff> Things::off(const std::vector<std::string>& names) const {
  std::vector<ThingOff> all;
  for (const auto& [number, judged] : judged()) {
    if (judged.pieces.size() < least_pieces) continue;
    std::vector<Looked> pieces;
    std::vector<glm::dvec2> common, turned;
    for (const Piece& piece : judged.pieces) {
      pieces.push_back(piece.looked);
      common.push_back(piece.rest.common);
      turned.push_back(piece.rest.turned);
    }
    std::vector<glm::dvec2> where_the_model_says(pieces.size(), glm::dvec2(0));
    const auto way_m =
        clear_way(pieces, judged.looked_at,
                  {place_at(pieces, std::move(where_the_model_says)),
                   place_at(pieces, std::move(common)), place_at(pieces, std::move(turned))});
    if (!way_m) continue;
    double length_px = 0;
    for (const Looked& piece : pieces)
      length_px += glm::length(shift_by(piece, *way_m)) / double(pieces.size());
    all.push_back({names[number], length_px, pieces.size()});
  }
  std::ranges::stable_sort(all, std::ranges::greater(), &ThingOff::shift_px);
  return all;
}

std::vector<std::string> Things::not_judged(const std::vector<std::string>& names) const {
  const JudgedThings all = judged();
  std::vector<std::string> too_little;
  for (std::size_t number = 0; number < names.size(); ++number) {
    const auto at = all.find(number);
    if (at == all.end() || at->second.found < least_pieces) too_little.push_back(names[number]);
  }
  return too_little;
}

}  // namespace previz::fit
