#include "daemon/rig/marking_lines.hpp"

#include <fmt/format.h>

#include <glm/geometric.hpp>
#include <iterator>
#include <utility>

#include "daemon/rig/guide_drawing.hpp"

namespace previz::rig {
namespace {

using output::GuideKind;

// These are shares of the picture's width: what is free in the middle, how far the cross reaches,
// and how large a corner's own cross is.
constexpr double free_share = 0.008, arm_share = 0.04, corner_share = 0.008;
// A ray is drawn between these distances from where the camera was.
constexpr double nearest_m = 0.1, farthest_m = 20;

void add_cross(output::GuidePage& page, const std::string& name) {
  const glm::dvec2 middle(0.5 * (page.width - 1), 0.5 * (page.height - 1));
  const double from = free_share * page.width, to = arm_share * page.width;
  for (const glm::dvec2& way :
       {glm::dvec2(1, 0), glm::dvec2(-1, 0), glm::dvec2(0, 1), glm::dvec2(0, -1)})
    page.lines.push_back({middle + from * way, middle + to * way, GuideKind::mark});
  page.words.push_back({middle + glm::dvec2(0, -1.5 * to), name, GuideKind::mark});
}

void add_corner(output::GuidePage& page, const output::GuideWord& corner) {
  const double arm = corner_share * page.width;
  for (const glm::dvec2& way : {glm::dvec2(arm, arm), glm::dvec2(arm, -arm)})
    page.lines.push_back({corner.at - way, corner.at + way, GuideKind::mark});
  page.words.push_back({corner.at + glm::dvec2(0, -3 * arm), corner.text, GuideKind::mark});
}

}  // namespace

output::GuidePage marking_lines(const live::Marking& marking, const PinholeIntrinsics& lens,
                                const std::optional<glm::dmat4>& world_from_camera) {
  output::GuidePage page{lens.width, lens.height, {}, {}};
  if (world_from_camera) {
    GuideDrawing drawing(lens, *world_from_camera);
    const auto& selected = marking.selected_corner().marks;
    if (selected.size() == 1) {
      const tracking::Ray& ray = selected.front().ray;
      drawing.line(ray.origin + nearest_m * ray.direction, ray.origin + farthest_m * ray.direction,
                   GuideKind::mark);
    }
    for (std::size_t box = 0; box < marking.boxes().size(); ++box)
      for (std::size_t corner = 0; corner < session::corners_of_a_box; ++corner)
        if (const auto place = marking.boxes()[box][corner].place())
          drawing.word(*place, fmt::format("{}.{}", box + 1, corner + 1), GuideKind::mark);
    const output::GuidePage found = std::move(drawing).page();
    page.lines = found.lines;
    for (const output::GuideWord& corner : found.words) add_corner(page, corner);
  }
  add_cross(page, marking.selected());
  return page;
}

}  // namespace previz::rig
