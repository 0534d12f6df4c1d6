#include "daemon/fit/things.hpp"

#include <algorithm>
#include <functional>
#include <glm/geometric.hpp>

#include "daemon/fit/way.hpp"

namespace previz::fit {
namespace {

// So many of the pieces must speak for a thing's own way and against another place. The edges that
// lie along its way speak for both: of a sheet they are half, of a box a third.
constexpr double clearly = 0.3;

}  // namespace

void Things::look(const std::map<std::size_t, ThingVotes>& things, const Votes& all,
                  const std::vector<Looked>& found) {
  JudgedThings& judged_now = frames_.emplace_back();
  if (frames_.size() > frames_judged) frames_.pop_front();
  for (const auto& [number, thing] : things) {
    if (number == no_thing || thing.votes.pieces() == 0) continue;
    const auto rest = shift_of_rest(number, all.without(thing.votes), found);
    if (!rest) continue;
    Judged& judged = judged_now[number];
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
      sum.looked_at += judged.looked_at;
      sum.pieces.insert(sum.pieces.end(), judged.pieces.begin(), judged.pieces.end());
    }
  return all;
}

std::vector<ThingOff> Things::off(const std::vector<std::string>& names) const {
  std::vector<ThingOff> all;
  for (const auto& [number, judged] : judged()) {
    const double count = double(judged.pieces.size());
    if (judged.pieces.size() < least_pieces) continue;
    std::vector<Looked> pieces;
    for (const Piece& piece : judged.pieces) pieces.push_back(piece.looked);
    const glm::dvec3 way_m = agreed_way(pieces);
    double agreed = 0, length_px = 0;
    for (const Looked& piece : pieces) {
      agreed += agreement(piece, shift_by(piece, way_m));
      length_px += glm::length(shift_by(piece, way_m)) / count;
    }
    // Returns whether the pieces clearly lie elsewhere than where a shift has them.
    const auto is_clear = [&, agreed_there = agreed](const auto& shift_of) {
      double apart_px = 0, agreed_here = 0;
      for (const Piece& piece : judged.pieces) {
        const glm::dvec2 shift = shift_of(piece.rest);
        apart_px += glm::distance(shift, shift_by(piece.looked, way_m)) / count;
        agreed_here += agreement(piece.looked, shift);
      }
      return apart_px > most_off_px && agreed_there - agreed_here >= clearly * count;
    };
    if (agreed >= most_of * double(judged.looked_at) &&
        is_clear([](const RestShift&) { return glm::dvec2(0); }) &&
        is_clear([](const RestShift& rest) { return rest.common; }) &&
        is_clear([](const RestShift& rest) { return rest.turned; }))
      all.push_back({names[number], length_px, pieces.size()});
  }
  std::ranges::stable_sort(all, std::ranges::greater(), &ThingOff::shift_px);
  return all;
}

}  // namespace previz::fit
