#include "daemon/model/scan_sightings.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <limits>
#include <numbers>
#include <opencv2/core.hpp>

#include "daemon/lighting/parallel.hpp"
#include "daemon/model/shape.hpp"

namespace previz::model {
namespace {

constexpr int tile_px = 2048, overlap_px = 512;
// Of the pictures from all sides together.
constexpr double most_pixels = 80e6;
// A direction is skipped if less of the surface faces it.
constexpr double least_area = 2e-5;
constexpr int samples_across = 9;  // of a tag's surface
constexpr double around_tilt = 25 * std::numbers::pi / 180;

// The centres of a cube's sides, edges and corners: no direction is farther than 28 degrees from
// one of them.
std::vector<glm::dvec3> directions() {
  std::vector<glm::dvec3> all;
  for (int x = -1; x <= 1; ++x)
    for (int y = -1; y <= 1; ++y)
      for (int z = -1; z <= 1; ++z)
        if (x != 0 || y != 0 || z != 0) all.push_back(glm::normalize(glm::dvec3(x, y, z)));
  return all;
}

// Returns those directions that parts of the surface face.
std::vector<glm::dvec3> faced_directions(const TriangleMesh& mesh) {
  const std::vector<glm::dvec3> all = directions();
  std::vector<double> areas(all.size());
  double total = 0;
  for (std::size_t t = 0; t < mesh.triangles(); ++t) {
    const auto corner_at = [&](std::size_t k) {
      return glm::dvec3(mesh.positions[mesh.indices[3 * t + k]]);
    };
    const glm::dvec3 normal = glm::cross(corner_at(1) - corner_at(0), corner_at(2) - corner_at(0));
    const auto nearest = std::ranges::max_element(
        all, {}, [&](const glm::dvec3& direction) { return glm::dot(direction, normal); });
    areas[static_cast<std::size_t>(nearest - all.begin())] += glm::length(normal);
    total += glm::length(normal);
  }
  std::vector<glm::dvec3> faced;
  for (std::size_t i = 0; i < all.size(); ++i)
    if (areas[i] > least_area * total) faced.push_back(all[i]);
  return faced;
}

struct FlatPiece {
  glm::dvec3 at{0}, normal{0};
  double uneven = 0;
};

// Returns the plane nearest to the points.
FlatPiece plane_through(const std::vector<glm::dvec3>& points) {
  FlatPiece plane;
  const auto count = static_cast<double>(points.size());
  for (const glm::dvec3& p : points) plane.at += p / count;
  cv::Matx33d moments = cv::Matx33d::zeros();
  for (const glm::dvec3& p : points) {
    const cv::Vec3d d(p.x - plane.at.x, p.y - plane.at.y, p.z - plane.at.z);
    moments += d * d.t();
  }
  cv::Mat1d values, vectors;
  cv::eigen(cv::Mat(moments), values, vectors);
  plane.normal = {vectors(2, 0), vectors(2, 1), vectors(2, 2)};
  plane.uneven = std::sqrt(std::max(0.0, values(2)) / count);
  return plane;
}

}  // namespace

glm::dvec3 centre_of(const TagSighting& tag) {
  return (tag.corners[0] + tag.corners[1] + tag.corners[2] + tag.corners[3]) / 4.0;
}

double side_of(const TagSighting& tag) {
  double sum = 0;
  for (std::size_t k = 0; k < 4; ++k)
    sum += glm::distance(tag.corners[k], tag.corners[(k + 1) % 4]) / 4;
  return sum;
}

// A direction to look in, and what of the scan there is across it.
struct TagSightings::Side {
  ScanView view;  // without pixels
  double width = 0, height = 0;
};

TagSightings::TagSightings(const ScanFile& scan, const set::Tracking& tracking)
    : scan_(scan), tracking_(tracking), painter_(scan) {}

tracking::TagDetector& TagSightings::detector_for(int width, int height) {
  if (detector_ && detector_px_ == std::array{width, height}) return *detector_;
  const double focal_px = std::max(width, height);
  detector_px_ = {width, height};
  detector_ = std::make_unique<tracking::TagDetector>(
      tracking::DetectorSettings{.family = tracking_.family,
                                 .min_margin = tracking_.min_margin,
                                 .max_hamming = tracking_.max_hamming,
                                 .threads = lighting::max_threads},
      PinholeIntrinsics{.width = width,
                        .height = height,
                        .fx = focal_px,
                        .fy = focal_px,
                        .cx = (width - 1) / 2.0,
                        .cy = (height - 1) / 2.0},
      ResponseCurve{.kind = ResponseCurve::Kind::srgb, .inverse_table = {}});
  return *detector_;
}

std::vector<TagSightings::Side> TagSightings::sides(Mirroring mirroring) const {
  std::vector<Side> all;
  for (const glm::dvec3& direction : faced_directions(scan_.mesh)) {
    ScanView view;
    view.forward = -direction;
    view.right = across(view.forward)[0];
    view.down = glm::cross(view.forward, view.right);
    if (mirroring == Mirroring::on) view.right = -view.right;
    glm::dvec3 low(std::numeric_limits<double>::infinity()), high(-low);
    for (const unsigned index : scan_.mesh.indices) {
      const glm::dvec3 p(scan_.mesh.positions[index]);
      const glm::dvec3 seen(glm::dot(p, view.right), glm::dot(p, view.down),
                            glm::dot(p, view.forward));
      low = glm::min(low, seen);
      high = glm::max(high, seen);
    }
    const double before = low.z - 0.01 * glm::distance(low, high);
    view.corner = low.x * view.right + low.y * view.down + before * view.forward;
    all.push_back({view, high.x - low.x, high.y - low.y});
  }
  return all;
}

std::vector<TagSighting> TagSightings::from_all_sides(double pixel, Mirroring mirroring) {
  const std::vector<Side> all = sides(mirroring);
  double area = 0, longest = 0;
  for (const Side& side : all) {
    area += side.width * side.height;
    longest = std::max({longest, side.width, side.height});
  }
  pixel = std::max({pixel, std::sqrt(area / most_pixels), longest / 32768});
  std::vector<TagSighting> seen;
  for (const Side& side : all) {
    look_in_tiles(side, pixel, seen);
    const double whole = std::max(side.width, side.height) / (tile_px - 16);
    if (whole > pixel) look_in_tiles(side, whole, seen);  // for tags that tiles cut
  }
  return seen;
}

void TagSightings::look_in_tiles(const Side& side, double pixel, std::vector<TagSighting>& seen) {
  constexpr int step_px = tile_px - overlap_px;
  constexpr int margin_px = 4;
  const int width = static_cast<int>(side.width / pixel) + 2 * margin_px;
  const int height = static_cast<int>(side.height / pixel) + 2 * margin_px;
  for (int y = 0; y == 0 || y + overlap_px < height; y += step_px)
    for (int x = 0; x == 0 || x + overlap_px < width; x += step_px) {
      ScanView tile = side.view;
      tile.pixel = pixel;
      tile.corner = tile.origin({x - margin_px, y - margin_px});
      tile.width = std::min(tile_px, width - x);
      tile.height = std::min(tile_px, height - y);
      look(tile, seen);
    }
}

void TagSightings::look(const ScanView& view, std::vector<TagSighting>& seen) {
  for (const tracking::TagDetection& found :
       detector_for(view.width, view.height).detect(painter_.draw(view), 1))
    if (const auto tag = on_surface(view, found)) seen.push_back(*tag);
}

std::vector<TagSighting> TagSightings::close_to(const TagSighting& tag) {
  const double side = side_of(tag);
  const double width = 1.5 * side * detector_for(tile_px, tile_px).printed_width();
  ScanView front;
  front.pixel = std::min(std::max(grain() / 1.5, width / 900), side / 60);
  front.width = front.height = static_cast<int>(width / front.pixel);
  const glm::dvec3 ahead = -tag.normal;
  const glm::dvec3 right = across(ahead)[0], down = glm::cross(ahead, right);
  const auto look_along = [&](const glm::dvec3& forward) {
    std::vector<TagSighting> here;
    ScanView view = front;
    view.forward = forward;
    view.right = glm::normalize(right - glm::dot(right, forward) * forward);
    view.down = glm::cross(forward, view.right);
    view.corner = centre_of(tag) - side * forward;
    view.corner = view.origin({-view.width / 2.0, -view.height / 2.0});
    look(view, here);
    std::erase_if(here, [&](const TagSighting& other) {
      return other.id != tag.id || glm::distance(centre_of(other), centre_of(tag)) > side / 2;
    });
    return here;
  };
  std::vector<TagSighting> seen = look_along(ahead);
  for (const glm::dvec3& aside : {right, -right, down, -down}) {
    const auto here =
        look_along(glm::normalize(std::cos(around_tilt) * ahead + std::sin(around_tilt) * aside));
    seen.insert(seen.end(), here.begin(), here.end());
  }
  return seen;
}

// Corners are put onto the plane of the tag's surface, whose noise this averages.
std::optional<TagSighting> TagSightings::on_surface(const ScanView& view,
                                                    const tracking::TagDetection& found) const {
  const tracking::CornerPixels& px = found.corners;
  std::vector<glm::dvec3> points;
  for (int i = 0; i < samples_across; ++i)
    for (int j = 0; j < samples_across; ++j) {
      const double u = (i + 0.5) / samples_across, v = (j + 0.5) / samples_across;
      const glm::dvec2 at =
          (1 - v) * ((1 - u) * px[0] + u * px[1]) + v * ((1 - u) * px[3] + u * px[2]);
      if (const auto p = painter_.surface_at(view, at)) points.push_back(*p);
    }
  if (2 * points.size() < static_cast<std::size_t>(samples_across * samples_across)) return {};
  const FlatPiece plane = plane_through(points);
  const double along = glm::dot(plane.normal, view.forward);
  if (std::abs(along) < 0.3) return {};
  TagSighting tag;
  tag.id = found.id;
  tag.normal = along < 0 ? plane.normal : -plane.normal;
  tag.uneven = plane.uneven;
  for (std::size_t k = 0; k < 4; ++k) {
    const glm::dvec3 origin = view.origin(px[k]);
    tag.corners[k] = origin + glm::dot(plane.at - origin, plane.normal) / along * view.forward;
  }
  return tag;
}

}  // namespace previz::model
