#include "daemon/core/session/marks.hpp"

#include <algorithm>
#include <optional>
#include <sstream>

#include "daemon/core/session/json_lines.hpp"
#include "daemon/core/session/missing.hpp"

namespace previz::session {
namespace {

// A picture is found by its time, which is all that the rig knows of it before it is on the disk.
std::optional<std::size_t> picture_of(const std::vector<FrameRecord>& observer,
                                      std::int64_t timestamp_ns) {
  const auto found = std::ranges::find(observer, timestamp_ns, &FrameRecord::timestamp_ns);
  if (found == observer.end()) return std::nullopt;
  return static_cast<std::size_t>(found - observer.begin());
}

}  // namespace

std::string name_of(const BoxCorner& corner) {
  return "box " + std::to_string(corner.box + 1) + " corner " + std::to_string(corner.corner + 1);
}

std::optional<BoxCorner> box_corner_of(const std::string& name) {
  std::istringstream words(name);
  std::string box_word, corner_word;
  BoxCorner corner;
  if (!(words >> box_word >> corner.box >> corner_word >> corner.corner)) return std::nullopt;
  if (corner.box == 0 || corner.corner == 0) return std::nullopt;
  --corner.box;
  --corner.corner;
  // A number that is written in another way has another name.
  return corner.corner < corners_of_a_box && name_of(corner) == name ? std::optional(corner)
                                                                     : std::nullopt;
}

Marks read_marks(const std::filesystem::path& session, const std::vector<FrameRecord>& observer) {
  const Lines<MarkEvent> lines = read_mark_lines(session / "events.jsonl");
  Marks result;
  if (!lines.bad_lines.empty())
    result.missing.push_back("events.jsonl: " + list_of("line", lines.bad_lines) +
                             " cannot be understood, and may have marks");
  std::vector<MarkEvent> in_force;
  for (const MarkEvent& event : lines.records) {
    std::erase_if(in_force, [&](const MarkEvent& mark) {
      return mark.point == event.point && mark.timestamp_ns == event.timestamp_ns;
    });
    if (!event.is_withdrawn) in_force.push_back(event);
  }
  for (const MarkEvent& mark : in_force) {
    if (const auto picture = picture_of(observer, mark.timestamp_ns))
      result.marks.push_back({*picture, mark.point, mark.px});
    else
      result.missing.push_back("the picture in which \"" + mark.point +
                               "\" was marked is not in the session; that mark is not used");
  }
  std::ranges::stable_sort(result.marks, {}, &Marks::Mark::picture);
  return result;
}

}  // namespace previz::session
