#include "daemon/tools/model/under_tags.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <optional>

#include "daemon/core/tracking/tag_family.hpp"
#include "daemon/tools/model/tag_papers.hpp"
#include "drivers/calibration/pinhole.hpp"

namespace previz::model {
namespace {

// The ring that is looked at is between these distances from the edge of the paper, in halves of
// the tag's width.
constexpr double ring_from = 0.06, ring_to = 0.7;
// The square ends half a cell beyond the paper. A tag is not found any more where its edge is
// blurred over a whole cell.
constexpr double margin_cells = 0.5;
// Pixels count by 1 / (distance^2 + near^2)^2: those within about `near` of a point, in halves of
// the tag's width, are averaged.
constexpr double near = 0.15;
// Slopes are held back by this share, so that pixels on one side of the paper alone, which do not
// show the slope across, leave it at none.
constexpr double held_slope = 0.02;
constexpr std::size_t least_pixels = 24;
// A pixel whose ratio is off the median of all by more than this factor shows something else.
constexpr double most_off = 1.4;
constexpr int steps = 16;  // squares in a row
// The piece of ground under a tag is put so high above its surface for each metre that the farthest
// camera is away from the tag or from the world's origin, and at least for one. Rays tell surfaces
// apart that are a third of that apart (TRACE_TIE of shaders/lib/hit.glsl). At the height of the
// paper the piece would cast a shadow, a thin line along its edge.
constexpr double height_per_m = 1e-5;

struct RingPixel {
  glm::dvec2 at{0};  // metres, in the tag's axes
  glm::dvec3 plate{0}, rendered{0};
};

// The pixels around a tag, and the least and the largest ratio of plate and rendered among them.
struct Ring {
  std::vector<RingPixel> pixels;
  glm::dvec3 least{std::numeric_limits<double>::infinity()}, most{0};
};

double ratio_of(const RingPixel& pixel) {
  return pixel.plate.g / pixel.rendered.g;
}

// Drops pixels that show something that the model does not have.
void drop_others(std::vector<RingPixel>& ring) {
  std::erase_if(ring, [](const RingPixel& pixel) {
    return !(pixel.rendered.r > 0 && pixel.rendered.g > 0 && pixel.rendered.b > 0);
  });
  if (ring.empty()) return;
  const auto middle = ring.begin() + static_cast<std::ptrdiff_t>(ring.size() / 2);
  std::ranges::nth_element(ring, middle, {}, ratio_of);
  const double median = ratio_of(*middle);
  std::erase_if(ring, [&](const RingPixel& pixel) {
    const double off = ratio_of(pixel) / median;
    return off > most_off || off < 1 / most_off;
  });
}

// A tag's paper, and what it lies on.
struct Paper {
  const FlatTag& flat;
  Plane ground;
  const Face& face;   // in that plane
  glm::dvec2 half_m;  // of its width and height
  double unit_m;      // half of the tag's width
  double height_m;    // of what is under it, above the ground
};

class Ground {
 public:
  explicit Ground(const Paper& paper)
      : plane_(paper.ground),
        face_(paper.face),
        tag_from_world_(glm::inverse(paper.flat.tag->world_from_tag)) {}

  // Returns where a ray meets the face, in the tag's axes; nothing where it does not.
  std::optional<glm::dvec2> meets(const glm::dvec3& origin, const glm::dvec3& direction) const {
    const double slope = glm::dot(direction, plane_.normal);
    const double distance = glm::dot(plane_.at - origin, plane_.normal) / slope;
    if (!(slope < 0) || !(distance > 0)) return {};
    const glm::dvec3 at = origin + distance * direction;
    if (!is_in(face_, at)) return {};
    return glm::dvec2(tag_from_world_ * glm::dvec4(at, 1));
  }

 private:
  Plane plane_;
  const Face& face_;
  glm::dmat4 tag_from_world_;
};

// Returns the directions in the world that pixels look in; 0 where the lens shows nothing.
std::vector<glm::dvec3> directions_of(const calibrate::SurfacePixels& seen,
                                      const PinholeIntrinsics& lens) {
  std::vector<glm::dvec3> directions;
  directions.reserve(seen.pixels.size());
  for (const calibrate::SurfacePixel& pixel : seen.pixels) {
    const auto ray = undistort(lens, pixel.px);
    const glm::dmat3 turn(seen.world_from_cameras[pixel.frame]);
    directions.push_back(ray ? turn * glm::dvec3(*ray, 1) : glm::dvec3(0));
  }
  return directions;
}

Ring ring_around(const Paper& paper, const calibrate::SurfacePixels& seen,
                 const std::vector<glm::dvec3>& directions, std::size_t surface) {
  const Ground ground(paper);
  Ring ring;
  for (std::size_t i = 0; i < seen.pixels.size(); ++i) {
    const calibrate::SurfacePixel& pixel = seen.pixels[i];
    if (pixel.surface != surface) continue;
    const glm::dvec3 eye(seen.world_from_cameras[pixel.frame][3]);
    const auto at = ground.meets(eye, directions[i]);
    if (!at) continue;
    const glm::dvec2 off = (glm::abs(*at) - paper.half_m) / paper.unit_m;
    const double outside = std::max(off.x, off.y);
    if (outside >= ring_from && outside <= ring_to)
      ring.pixels.push_back({*at, pixel.plate, pixel.rendered});
  }
  drop_others(ring.pixels);
  for (const RingPixel& pixel : ring.pixels) {
    ring.least = glm::min(ring.least, pixel.plate / pixel.rendered);
    ring.most = glm::max(ring.most, pixel.plate / pixel.rendered);
  }
  return ring;
}

// Returns what the plates have over what is rendered, at a point: the value there of the plane
// whose errors, times these weights, have no mean and no slope, within what the ratios are.
glm::dvec3 ratio_at(const glm::dvec2& at, const Ring& ring, double unit_m) {
  // How the ratio changes with the place, for each channel: value, along x, along y.
  std::array<glm::dmat3, 3> squares{glm::dmat3(0), glm::dmat3(0), glm::dmat3(0)};
  std::array<glm::dvec3, 3> products{};
  for (const RingPixel& pixel : ring.pixels) {
    const glm::dvec2 off = (pixel.at - at) / unit_m;
    const double squared = glm::dot(off, off) + near * near;
    const double weight = 1 / (squared * squared);
    const glm::dvec3 terms(1, off);
    for (glm::length_t c = 0; c < 3; ++c) {
      // Weights do not depend on what is rendered: its noise would make the ratio too small.
      squares[std::size_t(c)] += weight * pixel.rendered[c] * glm::outerProduct(terms, terms);
      products[std::size_t(c)] += weight * pixel.plate[c] * terms;
    }
  }
  glm::dvec3 ratio;
  for (glm::length_t c = 0; c < 3; ++c) {
    glm::dmat3& square = squares[std::size_t(c)];
    const double held = held_slope * (square[1][1] + square[2][2]);
    square[1][1] += held;
    square[2][2] += held;
    ratio[c] = (glm::inverse(square) * products[std::size_t(c)])[0];
  }
  return glm::clamp(ratio, ring.least, ring.most);
}

// Returns a point of the face: this one, or where the line from `middle` to it leaves the face.
glm::dvec3 held_in(const Face& face, const glm::dvec3& middle, const glm::dvec3& point) {
  if (is_in(face, point)) return point;
  double in = 0, out = 1;
  for (int i = 0; i < 40; ++i) {
    const double half = 0.5 * (in + out);
    (is_in(face, glm::mix(middle, point, half)) ? in : out) = half;
  }
  return glm::mix(middle, point, in);
}

// Returns how high a tag's ground is put above what it stands for.
double height_of(const FlatTag& flat, const calibrate::SurfacePixels& seen) {
  double farthest_m = 1;
  for (const glm::dmat4& camera : seen.world_from_cameras) {
    const glm::dvec3 eye(camera[3]), tag(flat.tag->world_from_tag[3]);
    farthest_m = std::max({farthest_m, glm::length(eye), glm::distance(eye, tag)});
  }
  return height_per_m * farthest_m;
}

// Adds the vertices row by row, and squares between them. `margin_m` is beyond the paper.
void add_ground(const Paper& paper, double margin_m, const glm::dvec3& albedo, const Ring& ring,
                NamedMesh& named) {
  const glm::dvec3 middle = above_ground(paper.flat, paper.ground, glm::dvec2(0), 0);
  for (int row = 0; row <= steps; ++row)
    for (int column = 0; column <= steps; ++column) {
      const glm::dvec2 at =
          (paper.half_m + margin_m) * (2.0 * glm::dvec2(column, row) / double(steps) - 1.0);
      const glm::dvec3 below = above_ground(paper.flat, paper.ground, at, 0);
      named.mesh.positions.emplace_back(held_in(paper.face, middle, below) +
                                        paper.height_m * paper.ground.normal);
      named.mesh.normals.emplace_back(paper.ground.normal);
      named.albedos.emplace_back(glm::clamp(albedo * ratio_at(at, ring, paper.unit_m), 0.0, 1.0));
    }
  constexpr unsigned across = steps + 1;
  for (unsigned row = 0; row < steps; ++row)
    for (unsigned column = 0; column < steps; ++column) {
      const unsigned a = row * across + column, b = a + 1, c = b + across, d = a + across;
      for (const unsigned corner : {a, b, c, a, c, d}) named.mesh.indices.push_back(corner);
    }
}

}  // namespace

std::vector<UnderTag> under_tags(const TaggedModel& model, const calibrate::SurfacePixels& seen,
                                 const PinholeIntrinsics& lens) {
  const std::vector<glm::dvec3> directions = directions_of(seen, lens);
  std::vector<UnderTag> all;
  for (const FlatTag& flat : model.layout.tags) {
    UnderTag& under = all.emplace_back();
    under.id = flat.tag->id;
    under.mesh.name = fmt::format("under tag {}", under.id);
    const Plane ground = ground_of(flat, model.shape);
    const FaceBelow below = face_below(flat, ground, model.solids);
    if (!below.face) continue;
    const auto surface =
        std::ranges::find(seen.surfaces, below.solid->name, &calibrate::KnownSurface::material);
    const auto albedo = model.colours.find(below.solid->name);
    if (surface == seen.surfaces.end() || albedo == model.colours.end()) continue;
    const tracking::TagCells cells = tracking::tag_cells(model.family, under.id);
    const double cell_m = flat.tag->size_m / cells.border;
    const Paper paper{flat,
                      ground,
                      *below.face,
                      half_paper(flat, cells, model.parts),
                      0.5 * cells.total * cell_m,
                      height_of(flat, seen)};
    const Ring ring = ring_around(paper, seen, directions,
                                  static_cast<std::size_t>(surface - seen.surfaces.begin()));
    under.pixels = ring.pixels.size();
    if (ring.pixels.size() < least_pixels) continue;
    add_ground(paper, margin_cells * cell_m, albedo->second, ring, under.mesh);
  }
  return all;
}

}  // namespace previz::model
