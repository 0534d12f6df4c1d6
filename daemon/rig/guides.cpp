#include "daemon/rig/guides.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <iterator>
#include <limits>
#include <numbers>
#include <utility>

#include "daemon/core/fit/visible_edges.hpp"
#include "daemon/rig/guide_drawing.hpp"

namespace previz::rig {
namespace {

using output::GuideKind;

constexpr double axis_m = 0.1;
constexpr double horizon_m = 1e6;   // so far away that a stage's size does not matter
constexpr int horizon_chords = 12;  // around the camera
constexpr double cross_share = 0.02;

class Drawing : public GuideDrawing {
 public:
  using GuideDrawing::GuideDrawing;

  void tag(const set::Tag& tag, const glm::dmat4& world_from_tag);
  void horizon();
  void axes();
  void box(const glm::dmat4& world_from_box, const glm::dvec3& low, const glm::dvec3& high);
  void focus(double distance_m);
};

void Drawing::tag(const set::Tag& tag, const glm::dmat4& world_from_tag) {
  const glm::dvec3 middle = world_from_tag[3], out_of_paper = world_from_tag[2];
  if (glm::dot(eye() - middle, out_of_paper) <= 0) return;
  const double half = 0.5 * tag.size_m;
  const auto corner = [&](double x, double y) {
    return glm::dvec3(world_from_tag * glm::dvec4(half * x, half * y, 0, 1));
  };
  line(corner(-1, -1), corner(1, -1), GuideKind::tag);
  line(corner(1, -1), corner(1, 1), GuideKind::tag);
  line(corner(1, 1), corner(-1, 1), GuideKind::tag);
  line(corner(-1, 1), corner(-1, -1), GuideKind::tag);
  word(middle, std::to_string(tag.id), GuideKind::tag);
}

// A chord between two points at the camera's height covers the horizon between them.
void Drawing::horizon() {
  const auto far = [&](int i) {
    const double angle = 2 * std::numbers::pi * i / horizon_chords;
    return eye() + horizon_m * glm::dvec3(std::cos(angle), std::sin(angle), 0);
  };
  for (int i = 0; i < horizon_chords; ++i) line(far(i), far(i + 1), GuideKind::horizon);
}

void Drawing::axes() {
  constexpr std::array kinds = {GuideKind::x_axis, GuideKind::y_axis, GuideKind::z_axis};
  constexpr std::array names = {"X", "Y", "Z"};
  for (std::size_t i = 0; i < 3; ++i) {
    glm::dvec3 end(0);
    end[static_cast<glm::length_t>(i)] = axis_m;
    line({0, 0, 0}, end, kinds[i]);
    word(1.15 * end, names[i], kinds[i]);
  }
}

void Drawing::box(const glm::dmat4& world_from_box, const glm::dvec3& low, const glm::dvec3& high) {
  const auto corner = [&](unsigned i) {
    const glm::dvec3 at((i & 1) != 0 ? high.x : low.x, (i & 2) != 0 ? high.y : low.y,
                        (i & 4) != 0 ? high.z : low.z);
    return glm::dvec3(world_from_box * glm::dvec4(at, 1));
  };
  for (unsigned i = 0; i < 8; ++i)
    for (const unsigned axis : {1u, 2u, 4u})
      if ((i & axis) == 0) line(corner(i), corner(i | axis), GuideKind::bounds);
}

void Drawing::focus(double distance_m) {
  const glm::dvec2 middle(0.5 * (lens().width - 1), 0.5 * (lens().height - 1));
  const double arm = cross_share * lens().width;
  for (const glm::dvec2& way : {glm::dvec2(arm, 0), glm::dvec2(0, arm)})
    drawn().lines.push_back({middle - way, middle + way, GuideKind::focus});
  drawn().words.push_back({middle + glm::dvec2(0, 2 * arm),
                           fmt::format("focus {:.2f} m", distance_m), GuideKind::focus});
}

}  // namespace

GuideModel::GuideModel(const scene::Scene& scene, const set::Set& set,
                       const ObserverCalibration& camera)
    : real_(scene, set),
      camera_(camera),
      tags_(set.tracking.tags),
      carriers_(set.tracking.carriers) {
  constexpr double none = std::numeric_limits<double>::infinity();
  std::vector<Box> all;
  for (const set::Object& object : set.objects)
    all.push_back({object.name,
                   object.carrier.empty() ? std::optional(object.world_from_file) : std::nullopt,
                   glm::dvec3(none), glm::dvec3(-none)});
  for (const scene::Instance& instance : scene.instances) {
    const set::Object& object = set.objects[instance.object];
    if (object.presence != set::Presence::virtual_object) continue;
    const glm::dmat4 file_from_mesh =
        glm::inverse(object.world_from_file) * instance.world_from_object;
    Box& box = all[instance.object];
    for (const glm::vec3& p : scene.meshes[instance.mesh].positions) {
      const glm::dvec3 at(file_from_mesh * glm::dvec4(p, 1));
      box.low = glm::min(box.low, at), box.high = glm::max(box.high, at);
    }
  }
  std::ranges::copy_if(all, std::back_inserter(boxes_),
                       [](const Box& box) { return box.low.x <= box.high.x; });
}

std::optional<glm::dmat4> GuideModel::place_of(const Box& box,
                                               const session::SceneState& state) const {
  const auto moved = state.objects.find(box.object);
  return moved == state.objects.end() ? box.world_from_file : moved->second;
}

output::GuidePage GuideModel::guides_of(const View& view) const {
  Drawing drawing(camera_.intrinsics, view.world_from_camera);
  drawing.horizon();
  for (const Box& box : boxes_)
    if (const auto world_from_file = place_of(box, view.scene))
      drawing.box(*world_from_file, box.low, box.high);
  drawing.add(fit::visible_segments(real_, camera_.intrinsics, view.world_from_camera),
              GuideKind::model);
  for (const set::Tag& tag : tags_) drawing.tag(tag, tag.world_from_tag);
  for (const set::Carrier& carrier : carriers_) {
    const auto found = view.carriers.find(carrier.name);
    if (found == view.carriers.end() || found->second.tags.empty()) continue;
    for (const set::Tag& tag : carrier.tags)
      drawing.tag(tag, found->second.world_from_carrier * tag.world_from_tag);
  }
  drawing.axes();
  if (camera_.lens && camera_.lens->focus_distance_m > 0)
    drawing.focus(camera_.lens->focus_distance_m);
  return std::move(drawing).page();
}

}  // namespace previz::rig
