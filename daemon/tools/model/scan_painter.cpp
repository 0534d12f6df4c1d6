#include "daemon/tools/model/scan_painter.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "daemon/core/lighting/parallel.hpp"

namespace previz::model {
namespace {

constexpr double empty_luma = 128;

// Returns a picture of half the size, each pixel the mean of four.
ScanPicture half_of(const ScanPicture& picture) {
  ScanPicture half{{}, std::max(1, picture.width / 2), std::max(1, picture.height / 2), {}};
  half.luma.reserve(static_cast<std::size_t>(half.width) * static_cast<std::size_t>(half.height));
  const auto at = [&](int x, int y) {
    x = std::min(x, picture.width - 1);
    y = std::min(y, picture.height - 1);
    return int{picture.luma[static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width) +
                            static_cast<std::size_t>(x)]};
  };
  for (int y = 0; y < half.height; ++y)
    for (int x = 0; x < half.width; ++x) {
      const int sum =
          at(2 * x, 2 * y) + at(2 * x + 1, 2 * y) + at(2 * x, 2 * y + 1) + at(2 * x + 1, 2 * y + 1);
      half.luma.push_back(static_cast<std::uint8_t>((sum + 2) / 4));
    }
  return half;
}

// Returns the luma between four pixels; a picture repeats itself beyond its borders.
double luma_at(const ScanPicture& picture, const glm::dvec2& uv) {
  if (!std::isfinite(uv.x) || !std::isfinite(uv.y)) return empty_luma;
  const double x = (uv.x - std::floor(uv.x)) * picture.width - 0.5;
  const double y = (1 - (uv.y - std::floor(uv.y))) * picture.height - 0.5;
  const int left = static_cast<int>(std::floor(x)), top = static_cast<int>(std::floor(y));
  const auto row = [&](int at) {
    at = (at + picture.height) % picture.height;
    const std::uint8_t* begin =
        &picture.luma[static_cast<std::size_t>(at) * static_cast<std::size_t>(picture.width)];
    const double a = begin[(left + picture.width) % picture.width];
    const double b = begin[(left + 1 + picture.width) % picture.width];
    return a + (x - left) * (b - a);
  };
  const double above = row(top);
  return above + (y - top) * (row(top + 1) - above);
}

template <class Value>
std::array<Value, 3> corners_of_triangle(const std::vector<Value>& values,
                                         const std::vector<unsigned>& indices, std::size_t t) {
  return {values[indices[3 * t]], values[indices[3 * t + 1]], values[indices[3 * t + 2]]};
}

// The size of a pixel on a face, and the face's area.
struct FaceGrain {
  float grain = 0, area = 0;
};

// Returns the median over the area; 0 if there is none.
double median_of(std::vector<FaceGrain>& faces) {
  std::ranges::sort(faces, {}, &FaceGrain::grain);
  double total = 0, below = 0;
  for (const FaceGrain& face : faces) total += double{face.area};
  for (const FaceGrain& face : faces)
    if ((below += double{face.area}) >= total / 2) return double{face.grain};
  return 0;
}

}  // namespace

ScanPainter::ScanPainter(const ScanFile& scan)
    : scan_(scan), surface_(scan.mesh.positions, scan.mesh.indices, Faces::front) {
  for (const ScanPicture& picture : scan.colours.pictures) {
    Halved& halved = pictures_.emplace_back();
    halved.whole = &picture;
    const ScanPicture* last = &picture;
    for (int side = std::min(picture.width, picture.height); side > 16; side /= 2) {
      halved.smaller.push_back(half_of(*last));
      last = &halved.smaller.back();
    }
  }
  measure_grain();
}

// Faces of filled holes may have one point of the texture, damaged ones more than all of it.
double ScanPainter::texels_on(std::size_t triangle, const ScanPicture& picture) const {
  const auto [p, q, r] = corners_of_triangle(scan_.colours.uvs, scan_.mesh.indices, triangle);
  const glm::dvec2 e = glm::dvec2(q) - glm::dvec2(p), f = glm::dvec2(r) - glm::dvec2(p);
  const double fraction = std::abs(e.x * f.y - e.y * f.x) / 2;
  return fraction <= 1 ? fraction * picture.width * picture.height : 0;
}

void ScanPainter::measure_grain() {
  std::vector<std::vector<FaceGrain>> of_pictures(pictures_.size());
  std::vector<FaceGrain> all;
  for (std::size_t t = 0; t < scan_.mesh.triangles(); ++t) {
    const int source = scan_.colours.sources[t];
    if (source == colourless) continue;
    const auto [a, b, c] = corners_of_triangle(scan_.mesh.positions, scan_.mesh.indices, t);
    const double area =
        glm::length(glm::cross(glm::dvec3(b) - glm::dvec3(a), glm::dvec3(c) - glm::dvec3(a))) / 2;
    double samples = 0.5;  // a mesh has half as many vertices as triangles
    if (source != from_vertices)
      samples = texels_on(t, *pictures_[static_cast<std::size_t>(source)].whole);
    if (!(samples > 0) || !(area > 0)) continue;
    const FaceGrain face{static_cast<float>(std::sqrt(area / samples)), static_cast<float>(area)};
    all.push_back(face);
    if (source != from_vertices) of_pictures[static_cast<std::size_t>(source)].push_back(face);
  }
  for (std::size_t i = 0; i < pictures_.size(); ++i)
    if (const double grain = median_of(of_pictures[i]); grain > 0) pictures_[i].grain = grain;
  grain_ = median_of(all);
}

std::optional<ScanPainter::Hit> ScanPainter::hit(const ScanView& view, glm::dvec2 px) const {
  const glm::dvec3 origin = view.origin(px);
  RTCRayHit query{};
  query.ray.org_x = static_cast<float>(origin.x);
  query.ray.org_y = static_cast<float>(origin.y);
  query.ray.org_z = static_cast<float>(origin.z);
  query.ray.dir_x = static_cast<float>(view.forward.x);
  query.ray.dir_y = static_cast<float>(view.forward.y);
  query.ray.dir_z = static_cast<float>(view.forward.z);
  query.ray.tfar = std::numeric_limits<float>::infinity();
  query.ray.mask = ~0U;
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  embree::find_closest(surface_.scene(), query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
  return Hit{static_cast<double>(query.ray.tfar), static_cast<double>(query.hit.u),
             static_cast<double>(query.hit.v), query.hit.primID};
}

std::vector<const ScanPicture*> ScanPainter::pictures_for(double pixel) const {
  std::vector<const ScanPicture*> pictures;
  for (const Halved& picture : pictures_) {
    const double halvings = std::round(std::log2(std::clamp(pixel / picture.grain, 1.0, 1e6)));
    const auto level = std::min(static_cast<std::size_t>(halvings), picture.smaller.size());
    pictures.push_back(level == 0 ? picture.whole : &picture.smaller[level - 1]);
  }
  return pictures;
}

double ScanPainter::luma(const Hit& hit, const std::vector<const ScanPicture*>& pictures) const {
  const int source = scan_.colours.sources[hit.triangle];
  if (source == colourless) return empty_luma;
  const double w = 1 - hit.u - hit.v;
  if (source == from_vertices) {
    const auto [a, b, c] =
        corners_of_triangle(scan_.colours.luma, scan_.mesh.indices, hit.triangle);
    return w * a + hit.u * b + hit.v * c;
  }
  const auto [a, b, c] = corners_of_triangle(scan_.colours.uvs, scan_.mesh.indices, hit.triangle);
  const glm::dvec2 uv = w * glm::dvec2(a) + hit.u * glm::dvec2(b) + hit.v * glm::dvec2(c);
  return luma_at(*pictures[static_cast<std::size_t>(source)], uv);
}

Frame ScanPainter::draw(const ScanView& view) const {
  Frame frame;
  frame.format = PixelFormat::gray8;
  frame.width = view.width;
  frame.height = view.height;
  frame.bytes.resize(frame_bytes(frame.format, frame.width, frame.height));
  const std::vector<const ScanPicture*> pictures = pictures_for(view.pixel);
  const auto draw_rows = [&](int begin, int end) {
    for (int y = begin; y < end; ++y)
      for (int x = 0; x < view.width; ++x) {
        const auto found = hit(view, {x, y});
        const double grey = found ? luma(*found, pictures) : empty_luma;
        frame.bytes[static_cast<std::size_t>(y) * static_cast<std::size_t>(view.width) +
                    static_cast<std::size_t>(x)] =
            static_cast<std::uint8_t>(std::lround(std::clamp(grey, 0.0, 255.0)));
      }
  };
  lighting::parallel_blocks(view.height, draw_rows, lighting::all_threads());
  return frame;
}

std::optional<glm::dvec3> ScanPainter::surface_at(const ScanView& view, glm::dvec2 px) const {
  const auto found = hit(view, px);
  if (!found) return {};
  const auto [a, b, c] =
      corners_of_triangle(scan_.mesh.positions, scan_.mesh.indices, found->triangle);
  return (1 - found->u - found->v) * glm::dvec3(a) + found->u * glm::dvec3(b) +
         found->v * glm::dvec3(c);
}

}  // namespace previz::model
