// The tables of tags, and of the carriers that some are on.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "daemon/core/set/pose.hpp"
#include "daemon/core/set/resolving.hpp"

namespace previz::set {
namespace {

// Returns a tag's pose, which must be given in one of the two forms that every pose has.
glm::dmat4 rigid(Resolving& work, const TagDraft& draft) {
  GivenKeys keys;
  for (const auto& [name, key] : draft.given.keys) keys[name] = key.good;
  const auto all = faults(draft.pose, keys, "world_from_tag");
  for (const auto& [key, what] : all) work.problem(draft.given, key, what);
  return all.empty() ? rigid_transform(draft.pose) : glm::dmat4{1};
}

// Returns whether a carried tag has no pose, so that its frame is the carrier's.
bool is_carrier_itself(const TagDraft& draft) {
  const auto& table = draft.given;
  return !draft.carrier.empty() && !table.has("position_m") && !table.has("rotation_deg") &&
         !table.has("world_from_tag");
}

Carrier& carrier(Resolving& work, const std::string& name) {
  auto& carriers = work.set.tracking.carriers;
  const auto found = std::ranges::find(carriers, name, &Carrier::name);
  return found != carriers.end() ? *found : carriers.emplace_back(Carrier{name, {}});
}

// Completes a tag that is given by its four corners.
void measured(Resolving& work, const TagDraft& draft, Tag& tag) {
  const auto& table = draft.given;
  work.exclude(table, {"position_m", "rotation_deg", "world_from_tag"},
               "conflicts with corners_m; allowed: one form of the pose");
  if (!table.good("corners_m")) return;
  const auto fit = fit_square(*draft.corners);
  const auto percent = [](double part) {
    return codec::print_number(std::round(part * 1000) / 10) + " %";
  };
  if (!fit || fit->error > square_tolerance) {
    work.problem(table, "corners_m",
                 fit ? "is not a square: a corner is off by " + percent(fit->error) +
                           " of the side; allowed: at most " + percent(square_tolerance) +
                           ", in the order lower left, lower right, upper right, upper left"
                     : "has no area; allowed: lower left, lower right, upper right, upper left");
    return;
  }
  tag.world_from_tag = fit->world_from_tag;
  if (!table.good("size_m")) {
    tag.size_m = fit->size;
  } else if (std::abs(tag.size_m / fit->size - 1) > square_tolerance) {
    work.problem(table, "size_m",
                 "conflicts with corners_m, whose side is " + codec::print_number(fit->size) +
                     " m; allowed: the same to within " + percent(square_tolerance) +
                     ", or remove it");
  }
}

void tags(Resolving& work) {
  std::map<int, Position> first;
  std::set<std::string> frames;  // carriers whose frame is that of a tag
  for (const auto& draft : work.draft.tags) {
    const auto& table = draft.given;
    if (table.good("id")) {
      work.once(first, draft.id, table, "id", "tag " + std::to_string(draft.id), "each id once");
    }
    Tag tag{.id = draft.id, .size_m = draft.size.value_or(0)};
    if (table.has("corners_m")) {
      measured(work, draft, tag);
    } else {
      if (!table.has("size_m"))
        work.problem(table, "size_m",
                     "is missing; allowed: the outer edge of the black border in m, or corners_m");
      const bool is_frame = is_carrier_itself(draft);
      if (is_frame && !frames.insert(draft.carrier).second)
        work.problem(table, "carrier",
                     "another tag of " + codec::quote(draft.carrier) +
                         " already defines its frame; allowed: position_m relative to that tag");
      tag.world_from_tag = is_frame ? glm::dmat4{1} : rigid(work, draft);
    }
    (draft.carrier.empty() ? work.set.tracking.tags : carrier(work, draft.carrier).tags)
        .push_back(tag);
  }
}

}  // namespace

void resolve_tags(Resolving& work) {
  tags(work);
}

}  // namespace previz::set
