#include "tests/unit/model/marked_scene.hpp"

#include "drivers/calibration/pinhole.hpp"
#include "tests/support/tracking_synthetic.hpp"

namespace previz::test {

std::vector<model::MarkedPicture> MarkedScene::pictures(std::mt19937& random) const {
  std::normal_distribution<double> noise(0, 1);
  std::vector<model::MarkedPicture> all;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    model::MarkedPicture picture{std::to_string(i), {}};
    const tracking::CameraFromWorld pose = tracking::camera_from_world(cameras[i]);
    for (const auto& [name, point] : points) {
      const glm::dvec2 px = model::projected(lens, pose.rotation * point + pose.translation);
      const double x = noise(random), y = noise(random);
      picture.marks.push_back({name, px + mark_px * glm::dvec2(x, y)});
    }
    all.push_back(picture);
  }
  return all;
}

model::Views MarkedScene::views(const model::Parts& parts, std::mt19937& random) const {
  std::normal_distribution<double> noise(0, 1);
  model::Views views{.lens = lens, .views = {}};
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    tracking::FittedPose pose;
    pose.pose = tracking::camera_from_world(cameras[i]);
    // A covariance of 0 has no inverse.
    const double sigma = std::max(pose_m, 1e-7);
    for (std::size_t k = 0; k < 6; ++k) pose.covariance[7 * k] = sigma * sigma;
    glm::dvec3 turn, shift;
    for (glm::length_t k = 0; k < 3; ++k)
      turn[k] = pose_m * noise(random), shift[k] = pose_m * noise(random);
    pose.pose.rotation = tracking::rotation_by(turn) * pose.pose.rotation;
    pose.pose.translation = tracking::rotation_by(turn) * pose.pose.translation + shift;
    views.views.push_back({parts.pictures[i].name, parts.pictures[i].marks, pose});
  }
  return views;
}

MarkedScene scene_of_a_table() {
  MarkedScene scene;
  scene.tags = {flat_tag(0, 0.08, {0, 0, 0}), flat_tag(1, 0.08, {0.4, 0.1, 0}, 0.4),
                flat_tag(2, 0.08, {-0.3, 0.35, 0}, -1)};
  for (const glm::dvec3 eye :
       {glm::dvec3(-0.9, -0.6, 0.7), glm::dvec3(-0.2, -1, 0.5), glm::dvec3(0.3, -0.9, 0.9),
        glm::dvec3(0.9, -0.6, 0.6), glm::dvec3(0.8, 1, 0.8)})
    scene.cameras.push_back(camera_looking(eye, {0, 0.15, 0.05}));
  scene.lens = plain_lens(1280, 960, 1200);
  return scene;
}

void add_box(MarkedScene& scene, const std::string& prefix, glm::dvec3 foot, glm::dvec3 size,
             double turn_rad) {
  const model::Box box{foot, tracking::rotation_by({0, 0, turn_rad}), size};
  for (std::size_t k = 0; k < 4; ++k) {
    scene.points[corners(prefix, 'b')[k]] = model::corner(box, k);
    scene.points[corners(prefix, 't')[k]] = model::corner(box, k + 4);
  }
}

std::vector<std::string> corners(const std::string& prefix, char side) {
  std::vector<std::string> names;
  for (const char* number : {"1", "2", "3", "4"}) names.push_back(prefix + side + number);
  return names;
}

model::Fit fit_of(const MarkedScene& scene, model::Parts parts, unsigned seed) {
  std::mt19937 random(seed);
  parts.pictures = scene.pictures(random);
  const model::Views views = scene.views(parts, random);
  return model::adjust(parts, views, model::first_guess(parts, views, scene.tags));
}

}  // namespace previz::test
