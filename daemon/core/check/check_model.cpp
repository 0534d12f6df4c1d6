#include "daemon/core/check/check_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <ostream>

#include "daemon/core/pipeline/track_stage.hpp"
#include "daemon/core/set/problems.hpp"
#include "drivers/error.hpp"

namespace previz::check {
namespace {

constexpr std::size_t frames_looked_at = fit::frames_judged;
constexpr std::size_t most_names = 12;  // in a line

bool has_real(const set::Set& set) {
  return std::ranges::any_of(set.objects, [](const set::Object& object) {
    return object.presence != set::Presence::virtual_object;
  });
}

std::string pieces(std::size_t count) {
  return set::plural(count, "piece") + (count == 1 ? " of an edge" : " of edges");
}

// "a", "b" and 3 others
std::string quoted(const std::vector<std::string>& names) {
  const std::size_t shown = names.size() <= most_names ? names.size() : most_names - 1;
  std::string text;
  for (std::size_t i = 0; i < shown; ++i)
    text += fmt::format("{}\"{}\"", i == 0 ? "" : ", ", set::printable(names[i]));
  if (shown < names.size()) text += fmt::format(" and {} others", names.size() - shown);
  return text;
}

constexpr const char* what_to_do =
    "Look at the rig's display where it is off (action `guides`), and measure the phantom's place "
    "again or, if all of it is off, the map of tags (`previz calibrate tags`)";

// Looks at one frame of a part of the take: the one in its middle, or another if that has no pose.
void look_at_part(const pipeline::Take& take, std::size_t first, std::size_t end,
                  pipeline::TrackStage& track, fit::Measurement& measurement) {
  for (const double share : {0.5, 0.25, 0.75}) {
    pipeline::Shot shot;
    shot.index = first + static_cast<std::size_t>(share * static_cast<double>(end - first));
    try {
      shot.frame = take.observer_stream->read(shot.index);
    } catch (const Error&) {
      continue;  // it is named with the take's other losses
    }
    track(shot);
    if (!shot.track.pose) continue;
    measurement.look(*shot.frame, shot.track.pose->world_from_camera);
    return;
  }
}

}  // namespace

fit::Figure fit_of_model(const pipeline::Take& take, const scene::Scene& scene) {
  const fit::RealModel model(scene, take.set);
  fit::Measurement measurement(model, take.observer);
  if (model.edges().empty()) return measurement.figure();
  try {
    pipeline::TrackStage track(take);
    const std::size_t frames = take.observer_stream->records().size();
    const std::size_t parts = std::min(frames_looked_at, frames);
    for (std::size_t i = 0; i < parts; ++i)
      look_at_part(take, i * frames / parts, (i + 1) * frames / parts, track, measurement);
  } catch (const Error& no_poses) {
    fit::Figure none;
    none.why = no_poses.what();
    return none;
  }
  return measurement.figure();
}

void describe_fit(const fit::Figure& figure, const set::Set& set, std::ostream& out) {
  if (!has_real(set)) return;
  out << "\nmodel: ";
  if (figure.off)
    out << fmt::format(
        "{} of {} in {} are {:.2f} px off in the median, and 90 % of them by at most {:.2f} px",
        figure.found, pieces(figure.looked_at), set::plural(figure.frames, "frame"),
        figure.off->median_px, figure.off->most_px);
  else
    out << fmt::format("no figure for how far it is off: {} ({} found, {} looked for, in {})",
                       figure.why, pieces(figure.found), figure.looked_at,
                       set::plural(figure.frames, "frame"));
  out << '\n';
  if (figure.off && !figure.not_judged.empty())
    out << "  not judged, because too few of their edges can be seen: " << quoted(figure.not_judged)
        << '\n';
}

void remark_on_fit(const fit::Figure& figure, const set::Set& set, set::Findings& findings) {
  if (!has_real(set)) return;
  for (const fit::PartOff& thing : figure.things_off)
    findings.remarks.push_back(fmt::format(
        "\"{}\" is {:.1f} px beside the pictures' edges, by {} of it, while the rest of the model "
        "fits: it was moved, or its place in the model is wrong. Put it back, or measure its place "
        "again",
        set::printable(thing.name), thing.shift_px, pieces(thing.pieces)));
  if (!figure.things_off.empty()) return;
  const double off_px = fit::off_px(figure);
  if (off_px > fit::most_off_px)
    findings.remarks.push_back(fmt::format(
        "the model of what is real is {:.1f} px beside the pictures' edges, so that shadows and "
        "what hides virtual objects are as far off. {}",
        off_px, what_to_do));
  else if (!figure.off && figure.looked_at >= fit::least_pieces)
    findings.remarks.push_back(
        fmt::format("the pictures have edges at {} of {} of the model, within {:.0f} px: it may be "
                    "farther off, or be as bright as what is behind it. {}",
                    figure.found, pieces(figure.looked_at), fit::reach_px, what_to_do));
}

}  // namespace previz::check
