#include "daemon/core/fit/visible_edges.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <optional>

#include "daemon/core/fit/light_edge.hpp"
#include "daemon/core/tracking/joint_pose.hpp"

namespace previz::fit {
namespace {

constexpr double step_px = 4;       // between the samples of an edge
constexpr double nearest_m = 1e-2;  // to the camera's plane
// Two edges of the model may be mistaken for each other if they are as near as this.
constexpr double apart_px = 8;
constexpr std::size_t steps_of_segment = 10;

struct Sample {
  glm::dvec2 pinhole{0};
  std::optional<glm::dvec2> pixel;  // absent: outside the picture, or hidden
  double depth_m = 0;
};

struct SampledEdge {
  bool is_touched = false;
  std::vector<Sample> samples;  // at even distances on the pinhole plane
  std::size_t part = no_part;
};

// Cuts a line to where it is `from` or more in front of a plane through the camera; returns false
// where nothing is left.
bool clip(glm::dvec3& a, glm::dvec3& b, const glm::dvec3& normal, double from) {
  const double da = glm::dot(a, normal) - from, db = glm::dot(b, normal) - from;
  if (da < 0 && db < 0) return false;
  if (da < 0) a += da / (da - db) * (b - a);
  if (db < 0) b += db / (db - da) * (a - b);
  return true;
}

// Cuts an edge, in the camera's axes, to what the lens may show: half a picture more on all sides,
// because of its distortion.
bool clip_to_picture(const PinholeIntrinsics& lens, glm::dvec3& a, glm::dvec3& b) {
  const double left = (-0.5 * lens.width - lens.cx) / lens.fx,
               right = (1.5 * lens.width - lens.cx) / lens.fx,
               top = (-0.5 * lens.height - lens.cy) / lens.fy,
               bottom = (1.5 * lens.height - lens.cy) / lens.fy;
  return clip(a, b, {0, 0, 1}, nearest_m) && clip(a, b, {1, 0, -left}, 0) &&
         clip(a, b, {-1, 0, right}, 0) && clip(a, b, {0, 1, -top}, 0) &&
         clip(a, b, {0, -1, bottom}, 0);
}

class Camera {
 public:
  // Without a model (null) nothing is hidden.
  Camera(const RealModel* model, const PinholeIntrinsics& lens, const glm::dmat4& world_from_camera)
      : model_(model),
        lens_(lens),
        world_from_camera_(world_from_camera),
        camera_from_world_(tracking::camera_from_world(world_from_camera)) {}

  std::vector<SampledEdge> see() const {
    std::vector<SampledEdge> edges;
    for (const ModelEdge& edge : model_->edges()) edges.push_back(see(edge));
    return edges;
  }

  SampledEdge see(const ModelEdge& edge) const {
    SampledEdge seen{edge.is_touched, {}, edge.part};
    glm::dvec3 a = in_camera(edge.a), b = in_camera(edge.b);
    if (!clip_to_picture(lens_, a, b)) return seen;
    const auto pa = on_pinhole(lens_, a), pb = on_pinhole(lens_, b);
    if (!pa || !pb) return seen;
    const double length = glm::distance(*pa, *pb);
    if (length < step_px) return seen;
    const int steps = int(std::ceil(length / step_px));
    for (int i = 0; i <= steps; ++i) {
      const double share = double(i) / steps;
      // A share of the line in the picture is this share of it in space.
      const double in_space = share * a.z / ((1 - share) * b.z + share * a.z);
      Sample sample{*pa + share * (*pb - *pa), {}, a.z + in_space * (b.z - a.z)};
      sample.pixel = pixel_of(lens_, sample.pinhole);
      if (sample.pixel && !is_seen(a + in_space * (b - a))) sample.pixel.reset();
      seen.samples.push_back(sample);
    }
    return seen;
  }

 private:
  glm::dvec3 in_camera(const glm::dvec3& p) const {
    return camera_from_world_.rotation * p + camera_from_world_.translation;
  }

  bool is_seen(const glm::dvec3& in_camera) const {
    return !model_ || model_->is_seen(world_from_camera_[3],
                                      glm::dvec3(world_from_camera_ * glm::dvec4(in_camera, 1)));
  }

  const RealModel* model_;
  const PinholeIntrinsics& lens_;
  glm::dmat4 world_from_camera_;
  tracking::CameraFromWorld camera_from_world_;
};

// Finds which edges pass near a pixel, by a grid of cells.
class Neighbours {
 public:
  Neighbours(const PinholeIntrinsics& lens, const std::vector<SampledEdge>& edges)
      : columns_(std::size_t(lens.width / apart_px) + 3),
        cells_(columns_ * (std::size_t(lens.height / apart_px) + 3)) {
    for (std::size_t e = 0; e < edges.size(); ++e)
      for (const Sample& sample : edges[e].samples)
        if (sample.pixel) cells_[cell_of(*sample.pixel)].push_back({*sample.pixel, e});
  }

  bool has_other(const glm::dvec2& px, std::size_t edge) const {
    const std::size_t middle = cell_of(px);
    for (const std::size_t row : {middle - columns_, middle, middle + columns_})
      for (std::size_t cell = row - 1; cell <= row + 1; ++cell)
        for (const Entry& entry : cells_[cell])
          if (entry.edge != edge && glm::distance(entry.px, px) < apart_px) return true;
    return false;
  }

 private:
  struct Entry {
    glm::dvec2 px{0};
    std::size_t edge = 0;
  };

  // There is a border of one cell.
  std::size_t cell_of(const glm::dvec2& px) const {
    return (std::size_t(px.y / apart_px) + 1) * columns_ + std::size_t(px.x / apart_px) + 1;
  }

  std::size_t columns_;
  std::vector<std::vector<Entry>> cells_;
};

// Calls `visit(first, last)` for each run of samples, two or more, that are wanted.
template <typename Wanted, typename Visit>
void for_each_run(const std::vector<Sample>& samples, Wanted wanted, Visit visit) {
  for (std::size_t first = 0; first < samples.size(); ++first) {
    if (!wanted(samples[first])) continue;
    std::size_t last = first;
    while (last + 1 < samples.size() && wanted(samples[last + 1])) ++last;
    if (last > first) visit(first, last);
    first = last;
  }
}

void add_segments(const SampledEdge& edge, std::vector<Segment>& segments) {
  for_each_run(
      edge.samples, [](const Sample& sample) { return sample.pixel.has_value(); },
      [&](std::size_t first, std::size_t last) {
        for (std::size_t at = first; at < last;) {
          const std::size_t next = std::min(last, at + steps_of_segment);
          segments.push_back({*edge.samples[at].pixel, *edge.samples[next].pixel});
          at = next;
        }
      });
}

}  // namespace

std::vector<Segment> visible_segments(const RealModel& model, const PinholeIntrinsics& lens,
                                      const glm::dmat4& world_from_camera) {
  std::vector<Segment> segments;
  for (const SampledEdge& edge : Camera(&model, lens, world_from_camera).see())
    add_segments(edge, segments);
  return segments;
}

std::vector<Segment> line_segments(const glm::dvec3& a, const glm::dvec3& b,
                                   const PinholeIntrinsics& lens,
                                   const glm::dmat4& world_from_camera) {
  std::vector<Segment> segments;
  add_segments(Camera(nullptr, lens, world_from_camera).see({a, b}), segments);
  return segments;
}

std::vector<Segment> measurable_pieces(const RealModel& model, const PinholeIntrinsics& lens,
                                       const glm::dmat4& world_from_camera) {
  const std::vector<SampledEdge> edges = Camera(&model, lens, world_from_camera).see();
  const Neighbours neighbours(lens, edges);
  std::vector<Segment> pieces;
  for (std::size_t e = 0; e < edges.size(); ++e) {
    if (edges[e].is_touched) continue;
    for_each_run(
        edges[e].samples,
        [&](const Sample& sample) {
          return sample.pixel && !neighbours.has_other(*sample.pixel, e);
        },
        [&](std::size_t first, std::size_t last) {
          const Sample &from = edges[e].samples[first], &to = edges[e].samples[last];
          const glm::dvec2 a = from.pinhole, b = to.pinhole;
          for (const Share& share : cut(glm::distance(a, b), corner_px)) {
            // In a picture, the inverse of the depth changes evenly along a line.
            const double middle = 0.5 * (share.from + share.to);
            pieces.push_back({a + share.from * (b - a), a + share.to * (b - a), edges[e].part,
                              1 / ((1 - middle) / from.depth_m + middle / to.depth_m)});
          }
        });
  }
  return pieces;
}

}  // namespace previz::fit
