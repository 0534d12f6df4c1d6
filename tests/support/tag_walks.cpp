#include "tests/support/tag_walks.hpp"

#include <glm/gtc/matrix_transform.hpp>

#include "daemon/core/tracking/tag_place.hpp"
#include "tests/support/tracking_synthetic.hpp"
#include "tests/support/units.hpp"

namespace previz::test {
namespace {

constexpr double least_side_px = 15, border_px = 3;

set::Tag turned_tag(int id, double size_m, const glm::dvec3& centre, double angle_deg,
                    const glm::dvec3& axis, double roll_deg = 0) {
  set::Tag tag = flat_tag(id, size_m, centre);
  tag.world_from_tag = glm::rotate(tag.world_from_tag, angle_deg * degree, axis);
  tag.world_from_tag = glm::rotate(tag.world_from_tag, roll_deg * degree, glm::dvec3(0, 0, 1));
  return tag;
}

}  // namespace

std::vector<set::Tag> tags_of_a_room() {
  const glm::dvec3 x(1, 0, 0), y(0, 1, 0);
  return {flat_tag(0, 0.08, {0, 0, 0}),
          flat_tag(1, 0.08, {0.35, 0.1, 0}, 0.4),
          flat_tag(2, 0.08, {-0.3, 0.25, 0}, -1.1),
          flat_tag(4, 0.12, {0.05, 0.45, 0}, 2.4),
          turned_tag(7, 0.16, {-0.5, 0.9, 0.5}, 90, x, 5),  // on the wall behind
          turned_tag(8, 0.16, {0.1, 0.9, 0.6}, 90, x, -12),
          turned_tag(9, 0.16, {0.6, 0.9, 0.45}, 90, x, 90),
          turned_tag(12, 0.16, {-0.8, 0.3, 0.4}, 90, y, 30),  // on the wall to the left
          turned_tag(13, 0.12, {-0.2, -0.2, 0.05}, 30, x, 0),
          turned_tag(20, 0.12, {0.45, 0.5, 0.2}, 35, -y, 70)};
}

std::vector<glm::dmat4> walk_through_a_room(int pictures) {
  std::vector<glm::dmat4> cameras;
  for (int i = 0; i < pictures; ++i) {
    const double share = (i + 0.5) / pictures;
    const double along = (-60 + 120 * share) * degree, sway = 7.3 * i;
    const double height = 0.75 + 0.35 * std::sin(sway), away = 1.5 + 0.4 * std::cos(1.7 * sway);
    const glm::dvec3 eye(away * std::sin(along) + 0.1, -away * std::cos(along) + 0.3, height);
    const glm::dvec3 target(0.3 * std::sin(2.1 * sway), 0.35 + 0.3 * std::cos(sway),
                            0.15 + 0.15 * std::sin(3.3 * sway));
    cameras.push_back(camera_looking(eye, target, {0.1 * std::sin(sway), 0, 1}));
  }
  return cameras;
}

calibrate::TagWalk walk_of(const PinholeIntrinsics& lens, const std::vector<glm::dmat4>& cameras,
                           const std::function<std::vector<set::Tag>(int picture)>& tags_at,
                           double noise_px, std::mt19937& random) {
  std::normal_distribution<double> noise(0, noise_px);
  calibrate::TagWalk walk;
  for (const set::Tag& tag : tags_at(0)) {
    walk.ids.push_back(tag.id);
    walk.sizes_m.push_back(tag.size_m);
  }
  for (std::size_t p = 0; p < cameras.size(); ++p) {
    walk.pictures.push_back("picture " + std::to_string(p));
    const std::vector<set::Tag> tags = tags_at(int(p));
    for (std::size_t t = 0; t < tags.size(); ++t) {
      const glm::dvec3 centre(tags[t].world_from_tag[3]), eye(cameras[p][3]);
      const glm::dvec3 towards = glm::normalize(eye - centre);
      if (glm::dot(towards, glm::dvec3(tags[t].world_from_tag[2])) < 0.25) continue;
      if ((glm::inverse(cameras[p]) * glm::dvec4(centre, 1)).z < 0.2) continue;
      calibrate::TagSighting seen;
      seen.picture = p;
      seen.tag = t;
      seen.corners = tracking::projected_tag(lens, tracking::camera_from_world(cameras[p]),
                                             tags[t].world_from_tag, tags[t].size_m);
      seen.variance_px2 = noise_px * noise_px;
      bool is_seen = true;
      for (std::size_t i = 0; i < 4; ++i) {
        const glm::dvec2& corner = seen.corners[i];
        is_seen = is_seen && corner.x > border_px && corner.y > border_px &&
                  corner.x < lens.width - border_px && corner.y < lens.height - border_px &&
                  glm::distance(corner, seen.corners[(i + 1) % 4]) >= least_side_px;
      }
      if (!is_seen) continue;
      for (glm::dvec2& corner : seen.corners) corner += glm::dvec2(noise(random), noise(random));
      walk.sightings.push_back(seen);
    }
  }
  return walk;
}

}  // namespace previz::test
