#include "daemon/tools/model/overlay.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <opencv2/imgproc.hpp>

#include "daemon/core/output/png.hpp"
#include "daemon/core/session/files.hpp"
#include "drivers/plate.hpp"

namespace previz::model {
namespace {

// An edge is drawn in so many parts, each of which the model hides or does not.
constexpr int parts_of_edge = 64;
constexpr int cross_px = 5;

const cv::Scalar green(60, 230, 90), red(255, 60, 60);

cv::Mat3b picture_of(const Frame& frame) {
  const Plate plate = to_plate(frame);
  cv::Mat3b picture(plate.height, plate.width);
  for (std::size_t i = 0; i < plate.samples.size(); ++i)
    picture.data[i] =
        static_cast<std::uint8_t>(plate.bits > 8 ? plate.samples[i] >> 8 : plate.samples[i]);
  return picture;
}

Plate plate_of(const cv::Mat3b& picture) {
  Plate plate{picture.cols, picture.rows, 8, {}};
  plate.samples.assign(picture.data, picture.data + picture.total() * 3);
  return plate;
}

// Lines are drawn with fractions of a pixel.
cv::Point fixed(const glm::dvec2& px) {
  return {int(std::lround(16 * px.x)), int(std::lround(16 * px.y))};
}

void draw_line(cv::Mat3b& picture, const glm::dvec2& a, const glm::dvec2& b,
               const cv::Scalar& colour) {
  // A point beside or behind the camera has no place in the picture.
  const double far_px = 2.0 * std::max(picture.cols, picture.rows);
  for (const glm::dvec2& p : {a, b})
    if (!(std::abs(p.x) < far_px && std::abs(p.y) < far_px)) return;
  cv::line(picture, fixed(a), fixed(b), colour, 1, cv::LINE_AA, 4);
}

void draw_edge(cv::Mat3b& picture, const PinholeIntrinsics& lens,
               const tracking::CameraFromWorld& pose, const std::vector<Solid>& solids,
               const glm::dvec3& a, const glm::dvec3& b) {
  const glm::dvec3 eye(tracking::world_from_camera(pose)[3]);
  const auto at = [&](double share) { return a + share * (b - a); };
  const auto px = [&](const glm::dvec3& p) {
    return projected(lens, pose.rotation * p + pose.translation);
  };
  for (int i = 0; i < parts_of_edge; ++i)
    if (!is_hidden(solids, eye, at((i + 0.5) / parts_of_edge)))
      draw_line(picture, px(at(double(i) / parts_of_edge)), px(at(double(i + 1) / parts_of_edge)),
                green);
}

}  // namespace

void write_overlays(const Views& views, const Shape& shape, const std::vector<Solid>& solids,
                    const std::filesystem::path& folder) {
  session::make_folders(folder);
  for (std::size_t v = 0; v < views.views.size(); ++v) {
    const MarkedView& view = views.views[v];
    cv::Mat3b picture = picture_of(*view.frame);
    const tracking::CameraFromWorld pose = adjusted_pose(view, shape.cameras_off[v]);
    for (const Solid& solid : solids)
      for (const Face& face : solid.faces)
        for (std::size_t e = 0; e < face.outline.size(); ++e)
          draw_edge(picture, views.lens, pose, solids, face.outline[e],
                    face.outline[(e + 1) % face.outline.size()]);
    for (const Mark& mark : view.marks) {
      draw_line(picture, mark.px - glm::dvec2(cross_px, 0), mark.px + glm::dvec2(cross_px, 0), red);
      draw_line(picture, mark.px - glm::dvec2(0, cross_px), mark.px + glm::dvec2(0, cross_px), red);
    }
    // "0012.png" becomes "0012.model.png", so that no picture is replaced.
    std::string name =
        view.name.ends_with(".png") ? view.name.substr(0, view.name.size() - 4) : view.name;
    for (char& c : name)
      if (c == ' ' || c == '/') c = '_';
    name += ".model.png";
    output::write_png(folder / name, plate_of(picture));
  }
}

}  // namespace previz::model
