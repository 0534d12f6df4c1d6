#include "daemon/tools/model/scan_sightings.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <limits>
#include <numbers>
#include <opencv2/core.hpp>

#include "daemon/core/lighting/parallel.hpp"
#include "daemon/core/tracking/tag_family.hpp"
#include "daemon/tools/model/shape.hpp"

namespace previz::model {
namespace {

constexpr int tile_px = 2048, overlap_px = 512;
// The pictures from all sides have at most so many pixels together.
constexpr double most_pixels = 120e6;
// A face counts for a direction if it is turned away from it by less than 32 degrees: every face is
// for one of them, see `directions`.
constexpr double least_cosine = 0.848;
// A tag that can be read covers more of a picture: 2 pixels for each of 8 x 8 cells.
constexpr double least_px2 = 256;
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

// Where a rectangle has faces, in a grid over it.
class FacingArea {
 public:
  FacingArea() : sums_((cells + 1) * (cells + 1)) {}

  // Places are fractions of the rectangle. Counts the area in all cells that the bounds touch.
  void add(const glm::dvec2& low, const glm::dvec2& high, double area) {
    const auto [x0, y0] = cell_at(low);
    const auto [x1, y1] = cell_at(high);
    at(x0, y0) += area;
    at(x1 + 1, y0) -= area;
    at(x0, y1 + 1) -= area;
    at(x1 + 1, y1 + 1) += area;
  }
  // After all that is added; from changes from cell to cell it makes areas of cells.
  void sum_up() {
    for (std::size_t y = 0; y < cells; ++y)
      for (std::size_t x = 1; x < cells; ++x) at(x, y) += at(x - 1, y);
    for (std::size_t y = 1; y < cells; ++y)
      for (std::size_t x = 0; x < cells; ++x) at(x, y) += at(x, y - 1);
  }
  // Returns what is in cells that the bounds touch; it may be more than there is.
  double within(const glm::dvec2& low, const glm::dvec2& high) const {
    const auto [x0, y0] = cell_at(low);
    const auto [x1, y1] = cell_at(high);
    double area = 0;
    for (std::size_t y = y0; y <= y1; ++y)
      for (std::size_t x = x0; x <= x1; ++x) area += sums_[y * (cells + 1) + x];
    return area;
  }

 private:
  static constexpr std::size_t cells = 128;
  static std::array<std::size_t, 2> cell_at(const glm::dvec2& at) {
    const glm::dvec2 cell = glm::clamp(at * double{cells}, 0.0, double{cells - 1});
    return {static_cast<std::size_t>(cell.x), static_cast<std::size_t>(cell.y)};
  }
  double& at(std::size_t x, std::size_t y) { return sums_[y * (cells + 1) + x]; }

  std::vector<double> sums_;
};

// Calls `use` with the corners and the projected area of each triangle that faces the direction.
template <class Use>
void each_facing(const TriangleMesh& mesh, const glm::dvec3& direction, const Use& use) {
  for (std::size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
    std::array<glm::dvec3, 3> corners;
    for (std::size_t k = 0; k < 3; ++k)
      corners[k] = glm::dvec3(mesh.positions[mesh.indices[i + k]]);
    const glm::dvec3 normal = glm::cross(corners[1] - corners[0], corners[2] - corners[0]);
    const double facing = glm::dot(normal, direction);
    if (facing > least_cosine * glm::length(normal)) use(corners, facing / 2);
  }
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

// A direction to look in, and the rectangle across it that has what faces it.
struct TagSightings::Side {
  ScanView view;  // without pixels
  double width = 0, height = 0;
  FacingArea facing;

  Side() = default;
  Side(const TriangleMesh& mesh, const glm::dvec3& direction);
  void add_views(double pixel, std::vector<ScanView>& views) const;
  bool is_empty(const ScanView& tile) const;
};

TagSightings::Side::Side(const TriangleMesh& mesh, const glm::dvec3& direction) {
  view.forward = -direction;
  view.right = across(view.forward)[0];
  view.down = glm::cross(view.forward, view.right);
  const auto seen = [&](const glm::dvec3& p) {
    return glm::dvec3(glm::dot(p, view.right), glm::dot(p, view.down), glm::dot(p, view.forward));
  };
  glm::dvec3 low(std::numeric_limits<double>::infinity()), high(-low);
  each_facing(mesh, direction, [&](const auto& corners, double) {
    for (const glm::dvec3& p : corners)
      low = glm::min(low, seen(p)), high = glm::max(high, seen(p));
  });
  if (!(low.x <= high.x)) return;
  const double before = low.z - 0.01 * glm::distance(low, high);
  view.corner = low.x * view.right + low.y * view.down + before * view.forward;
  width = high.x - low.x;
  height = high.y - low.y;
  if (!(width > 0) || !(height > 0)) return;
  each_facing(mesh, direction, [&](const auto& corners, double area) {
    const glm::dvec3 a = seen(corners[0]), b = seen(corners[1]), c = seen(corners[2]);
    const glm::dvec2 size(width, height), from(low);
    facing.add((glm::dvec2(glm::min(glm::min(a, b), c)) - from) / size,
               (glm::dvec2(glm::max(glm::max(a, b), c)) - from) / size, area);
  });
  facing.sum_up();
}

bool TagSightings::Side::is_empty(const ScanView& tile) const {
  const glm::dvec3 off = tile.corner - view.corner;
  const glm::dvec2 low(glm::dot(off, view.right), glm::dot(off, view.down)), size(width, height);
  const glm::dvec2 high = low + tile.pixel * glm::dvec2(tile.width, tile.height);
  return facing.within(low / size, high / size) < least_px2 * tile.pixel * tile.pixel;
}

// Adds tiles that overlap, and then larger ones for tags that they cut, until one is enough.
void TagSightings::Side::add_views(double pixel, std::vector<ScanView>& views) const {
  constexpr int step_px = tile_px - overlap_px;
  constexpr int margin_px = 4;
  for (bool is_whole = false; !is_whole; pixel *= 4) {
    const int across_px = static_cast<int>(width / pixel) + 2 * margin_px;
    const int down_px = static_cast<int>(height / pixel) + 2 * margin_px;
    is_whole = std::max(across_px, down_px) <= tile_px;
    ScanView tile = view;
    tile.pixel = pixel;
    tile.width = std::min(tile_px, across_px);
    tile.height = std::min(tile_px, down_px);
    const glm::dvec3 first = tile.origin({-margin_px, -margin_px});
    for (int y = 0; y == 0 || y + overlap_px < down_px; y += step_px)
      for (int x = 0; x == 0 || x + overlap_px < across_px; x += step_px) {
        tile.corner = first;
        tile.corner =
            tile.origin({std::min(x, across_px - tile.width), std::min(y, down_px - tile.height)});
        if (!is_empty(tile)) views.push_back(tile);
      }
  }
}

TagSightings::TagSightings(const ScanFile& scan, const set::Tracking& tracking)
    : tracking_(tracking), painter_(scan) {
  const std::vector<glm::dvec3> faced = faced_directions(scan.mesh);
  sides_.resize(faced.size());
  const auto measure = [&](int begin, int end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i)
      sides_[i] = Side(scan.mesh, faced[i]);
  };
  lighting::parallel_blocks(static_cast<int>(faced.size()), measure, lighting::all_threads());
}

TagSightings::~TagSightings() = default;

tracking::TagDetector& TagSightings::detector_for(int width, int height) {
  if (detector_ && detector_px_ == std::array{width, height}) return *detector_;
  const double focal_px = std::max(width, height);
  detector_px_ = {width, height};
  detector_ = std::make_unique<tracking::TagDetector>(
      tracking::DetectorSettings{.family = tracking_.family,
                                 .min_margin = tracking_.min_margin,
                                 .max_hamming = tracking_.max_hamming,
                                 .threads = lighting::all_threads()},
      PinholeIntrinsics{.width = width,
                        .height = height,
                        .fx = focal_px,
                        .fy = focal_px,
                        .cx = (width - 1) / 2.0,
                        .cy = (height - 1) / 2.0},
      ResponseCurve{.kind = ResponseCurve::Kind::srgb, .inverse_table = {}});
  return *detector_;
}

std::vector<ScanView> TagSightings::views_of_surface(double pixel) const {
  std::vector<ScanView> views;
  for (const Side& side : sides_) side.add_views(pixel, views);
  return views;
}

double TagSightings::possible_pixel(double pixel) const {
  for (const Side& side : sides_)
    pixel = std::max({pixel, side.width / 32768, side.height / 32768});
  const auto pixels = [&] {
    double sum = 0;
    for (const ScanView& view : views_of_surface(pixel))
      sum += double{1} * view.width * view.height;
    return sum;
  };
  while (pixels() > most_pixels) pixel *= 1.1;
  return pixel;
}

std::vector<TagSighting> TagSightings::from_all_sides(double pixel, Mirroring mirroring) {
  std::vector<TagSighting> seen;
  for (ScanView view : views_of_surface(pixel)) {
    if (mirroring == Mirroring::on) {
      view.corner = view.origin({view.width - 1, 0});
      view.right = -view.right;
    }
    look(view, seen);
  }
  return seen;
}

void TagSightings::look(const ScanView& view, std::vector<TagSighting>& seen) {
  for (const tracking::TagDetection& found :
       detector_for(view.width, view.height).detect(painter_.draw(view), 1))
    if (const auto tag = on_surface(view, found)) seen.push_back(*tag);
}

std::vector<TagSighting> TagSightings::close_to(const TagSighting& tag) {
  const double side = side_of(tag);
  const tracking::TagCells cells = tracking::tag_cells(tracking_.family, tracking_.tags.front().id);
  const double width = 1.5 * side * cells.total / cells.border;
  ScanView front;
  front.pixel = std::min(std::max(grain() / 1.5, width / 900), side / 60);
  constexpr int step_px = 64;  // a few sizes, as each has a detector
  front.width = front.height = (static_cast<int>(width / front.pixel) / step_px + 1) * step_px;
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
      return other.id != tag.id || other.is_rough ||
             glm::distance(centre_of(other), centre_of(tag)) > side / 2;
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
  tag.is_rough = !found.trouble.empty();
  for (std::size_t k = 0; k < 4; ++k) {
    const glm::dvec3 origin = view.origin(px[k]);
    tag.corners[k] = origin + glm::dot(plane.at - origin, plane.normal) / along * view.forward;
  }
  return tag;
}

}  // namespace previz::model
