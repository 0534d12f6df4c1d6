#include "daemon/tools/model/scan_surface.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <span>
#include <utility>

#include "daemon/core/tracking/photometry.hpp"
#include "drivers/error.hpp"

namespace previz::model {
namespace {

constexpr double most_coordinate = 1e15;
// So small a part of the scan may be lost by rounding.
constexpr double most_lost = 1e-6;
constexpr std::size_t most_corners = 1024;  // of a face that is not convex
// So many vertices of a point are compared before another one is made, which does no harm.
constexpr int most_looked = 64;

// A face, seen from its front.
class Polygon {
 public:
  Polygon(const FoundSurface& found, std::span<const std::uint32_t> corners) {
    glm::dvec3 normal(0);  // by Newell's formula
    const auto at = [&](std::size_t i) { return found.points[corners[i % corners.size()]]; };
    for (std::size_t i = 0; i < corners.size(); ++i)
      normal += glm::cross(at(i) - at(0), at(i + 1) - at(0));
    const glm::dvec3 size = glm::abs(normal);
    const glm::length_t drop =
        size.x > size.y ? (size.x > size.z ? 0 : 2) : (size.y > size.z ? 1 : 2);
    const glm::length_t u = (drop + 1) % 3, v = (drop + 2) % 3;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const glm::dvec3 p = at(i) - at(0);
      flat_.emplace_back(p[u], normal[drop] < 0 ? -p[v] : p[v]);
    }
  }

  bool is_convex() const {
    const std::size_t n = flat_.size();
    for (std::size_t i = 0; i < n; ++i)
      if (turn(i, (i + 1) % n, (i + 2) % n) < 0) return false;
    return true;
  }

  // Calls `cut(a, b, c)` for triangles of the face's corners, by cutting off ears (Meisters 1975).
  template <typename Cut>
  void cut_ears(const Cut& cut) const {
    std::vector<std::size_t> left(flat_.size());
    for (std::size_t i = 0; i < left.size(); ++i) left[i] = i;
    while (left.size() > 3) {
      std::size_t ear = 0;  // stays 0 in a face that crosses itself
      for (std::size_t i = 0; i < left.size(); ++i)
        if (is_ear(left, i)) {
          ear = i;
          break;
        }
      const std::size_t n = left.size();
      cut(left[(ear + n - 1) % n], left[ear], left[(ear + 1) % n]);
      left.erase(left.begin() + static_cast<std::ptrdiff_t>(ear));
    }
    cut(left[0], left[1], left[2]);
  }

 private:
  double turn(std::size_t a, std::size_t b, std::size_t c) const {
    const glm::dvec2 p = flat_[b] - flat_[a], q = flat_[c] - flat_[a];
    return p.x * q.y - p.y * q.x;
  }

  bool is_ear(const std::vector<std::size_t>& left, std::size_t i) const {
    const std::size_t n = left.size();
    const std::size_t a = left[(i + n - 1) % n], b = left[i], c = left[(i + 1) % n];
    if (!(turn(a, b, c) > 0)) return false;
    const auto is_corner =
        [&](std::size_t p) {  // holes are joined to the border by two equal edges
          return flat_[p] == flat_[a] || flat_[p] == flat_[b] || flat_[p] == flat_[c];
        };
    return std::ranges::none_of(left, [&](std::size_t p) {
      return !is_corner(p) && turn(a, b, p) >= 0 && turn(b, c, p) >= 0 && turn(c, a, p) >= 0;
    });
  }

  std::vector<glm::dvec2> flat_;
};

// Splits points that have several texture coordinates, and collects the triangles.
class Builder {
 public:
  Builder(const std::filesystem::path& path, const FoundSurface& found, bool has_colours,
          ScanFile& file)
      : path_(path),
        found_(found),
        has_colours_(has_colours),
        file_(file),
        first_(found.points.size(), no_index) {
    file_.mesh.indices.reserve(found.corners.size());
    if (has_colours) file_.colours.sources.reserve(found.corners.size() / 3);
  }

  void add_face(std::size_t begin, std::size_t end, int source) {
    const std::size_t count = end - begin;
    if (count < 3) return;  // a point or a line
    const std::span corners = std::span(found_.corners).subspan(begin, count);
    for (const std::uint32_t corner : corners)
      if (corner >= found_.points.size())
        throw Error(path_.string() +
                    ": has a face with a vertex that the file lacks; export the scan again");
    const auto triangle = [&](std::size_t a, std::size_t b, std::size_t c) {
      for (const std::size_t k : {a, b, c}) file_.mesh.indices.push_back(vertex(begin + k));
      if (has_colours_) file_.colours.sources.push_back(source_of(begin, end, source));
    };
    if (count == 3) return triangle(0, 1, 2);
    const Polygon polygon(found_, corners);
    if (polygon.is_convex()) {
      for (std::size_t k = 2; k < count; ++k) triangle(0, k - 1, k);
    } else if (count <= most_corners) {
      polygon.cut_ears(triangle);
    } else {
      throw Error(
          fmt::format("{}: has a face of {} corners that is not convex; export the scan as "
                      "triangles",
                      path_.string(), count));
    }
  }

  // Rounds the places of the vertices.
  void finish() {
    glm::dvec3 low(std::numeric_limits<double>::infinity()), high(-low);
    for (const std::uint32_t point : points_) {
      const glm::dvec3& p = found_.points[point];
      for (glm::length_t k = 0; k < 3; ++k)
        if (!(std::abs(p[k]) <= most_coordinate))
          throw Error(path_.string() +
                      ": has a vertex whose coordinates are not finite numbers up to 1e15; clean "
                      "the mesh in the program that made it, and export it again");
      low = glm::min(low, p);
      high = glm::max(high, p);
    }
    const double diagonal = glm::distance(low, high);
    const glm::dvec3 farthest = glm::max(glm::abs(low), glm::abs(high));
    const double lost = single_step / 2 * std::max({farthest.x, farthest.y, farthest.z});
    if (lost > most_lost * diagonal && diagonal > 0) {
      const double grid = std::exp2(std::floor(std::log2(diagonal)));  // so that it is exact
      file_.origin = grid * glm::round((low + high) / (2 * grid));
    }
    file_.mesh.positions.reserve(points_.size());
    for (const std::uint32_t point : points_)
      file_.mesh.positions.emplace_back(found_.points[point] - file_.origin);
    file_.colours.uvs.shrink_to_fit();
    file_.colours.luma.shrink_to_fit();
    file_.step = found_.step;
    file_.is_step_of_text = found_.is_step_of_text;
  }

 private:
  glm::vec2 uv_at(std::size_t corner) const {
    if (found_.corner_uvs.empty() || found_.corner_uvs[corner] >= found_.uvs.size())
      return glm::vec2(0);
    return found_.uvs[found_.corner_uvs[corner]];
  }

  int source_of(std::size_t begin, std::size_t end, int source) const {
    bool has_uvs = source >= 0 && !found_.corner_uvs.empty();
    for (std::size_t k = begin; k < end && has_uvs; ++k)
      has_uvs = found_.corner_uvs[k] < found_.uvs.size();
    if (has_uvs) return source;
    return found_.luma.empty() ? colourless : from_vertices;
  }

  // Returns the vertex of the corner's point with its texture coordinates.
  unsigned vertex(std::size_t corner) {
    const std::uint32_t point = found_.corners[corner];
    const glm::vec2 uv = has_colours_ ? uv_at(corner) : glm::vec2(0);
    std::uint32_t* at = &first_[point];
    for (int looked = 0; *at != no_index; ++looked) {
      if (!has_colours_ || file_.colours.uvs[*at] == uv) return *at;
      if (looked == most_looked) break;
      at = &next_[*at];
    }
    const auto added = static_cast<std::uint32_t>(points_.size());
    if (*at == no_index) *at = added;  // before the lists grow
    points_.push_back(point);
    next_.push_back(no_index);
    if (has_colours_) {
      file_.colours.uvs.push_back(uv);
      file_.colours.luma.push_back(point < found_.luma.size() ? found_.luma[point]
                                                              : std::uint8_t{0});
    }
    return added;
  }

  const std::filesystem::path& path_;
  const FoundSurface& found_;
  bool has_colours_;
  ScanFile& file_;
  std::vector<std::uint32_t> first_, next_;  // vertices of a point, as lists
  std::vector<std::uint32_t> points_;        // of each vertex
};

}  // namespace

void FoundSurface::end_face(int source) {
  ends.push_back(static_cast<std::uint32_t>(corners.size()));
  sources.push_back(source);
}

void take_surface(const std::filesystem::path& path, const FoundSurface& found, Colouring colouring,
                  ScanFile& file) {
  if (found.corners.size() >= no_index)
    throw Error(path.string() + ": has more than 4 billion corners of faces; export less of it");
  Builder builder(path, found, colouring == Colouring::read, file);
  const std::size_t faces = found.ends.empty() ? found.corners.size() / 3 : found.ends.size();
  std::size_t begin = 0;
  for (std::size_t face = 0; face < faces; ++face) {
    const std::size_t end = found.ends.empty() ? begin + 3 : found.ends[face];
    builder.add_face(begin, end, found.sources.empty() ? colourless : found.sources[face]);
    begin = end;
  }
  if (file.mesh.indices.empty())
    throw Error(path.string() +
                ": has no triangles; export the scan as a mesh, not as points or lines");
  builder.finish();
}

std::uint8_t luma_of(const glm::dvec3& colour, bool is_linear) {
  double luma = glm::dot(colour, glm::dvec3(0.2126, 0.7152, 0.0722));
  if (!std::isfinite(luma)) return 0;
  if (is_linear) luma = tracking::srgb_encode(luma);
  return static_cast<std::uint8_t>(std::lround(255 * std::clamp(luma, 0.0, 1.0)));
}

void FloatColours::add(const glm::dvec3& colour) {
  colours_.emplace_back(colour);
  for (glm::length_t k = 0; k < 3; ++k)
    if (colour[k] > 1.001 && std::isfinite(colour[k])) largest_ = 255;
}

void FloatColours::finish(std::vector<std::uint8_t>& luma) const {
  for (const glm::vec3& colour : colours_)
    luma.push_back(luma_of(glm::dvec3(colour) / largest_, false));
}

}  // namespace previz::model
