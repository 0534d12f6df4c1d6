#include "tests/support/tracking_synthetic.hpp"

#include <apriltag/apriltag.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/matrix.hpp>
#include <stdexcept>

#include "daemon/core/tracking/photometry.hpp"
#include "daemon/core/tracking/tag_family.hpp"
#include "drivers/calibration/pinhole.hpp"

namespace previz::test {
namespace {

glm::dvec2 project(const TagScene& scene, glm::dvec3 world) {
  const glm::dvec4 x = glm::inverse(scene.world_from_camera) * glm::dvec4(world, 1);
  if (!(x.z > 0)) throw std::logic_error("the test's tag is behind its camera");
  return distort(scene.lens, {x.x / x.z, x.y / x.z});
}

constexpr int kSegments = 6;  // a side, so that the lens may bend it

// The outline of [x0,x1] x [y0,y1] (metres, tag plane) in the picture.
std::vector<glm::dvec2> outline(const TagScene& scene, const set::Tag& tag, double x0, double y0,
                                double x1, double y1) {
  const glm::dvec2 c[4] = {{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}};
  std::vector<glm::dvec2> points;
  for (int side = 0; side < 4; ++side) {
    for (int k = 0; k < kSegments; ++k) {
      const glm::dvec2 p = glm::mix(c[side], c[(side + 1) % 4], double(k) / kSegments);
      points.push_back(project(scene, glm::dvec3(tag.world_from_tag * glm::dvec4(p.x, p.y, 0, 1))));
    }
  }
  return points;
}

std::vector<glm::dvec2> shifted(std::vector<glm::dvec2> points, glm::dvec2 by) {
  for (glm::dvec2& p : points) p += by;
  return points;
}

double forward(const ResponseCurve& curve, double signal) {
  switch (curve.kind) {
    case ResponseCurve::Kind::srgb:
      return tracking::srgb_encode(signal);
    case ResponseCurve::Kind::linear:
      return signal;
    case ResponseCurve::Kind::gamma:
      return std::pow(signal, 1 / curve.gamma);
    case ResponseCurve::Kind::table:
      break;
  }
  const auto& t = curve.inverse_table;
  const auto upper = std::upper_bound(t.begin(), t.end(), signal);
  if (upper == t.end()) return 1;
  const auto i = std::max<std::ptrdiff_t>(1, upper - t.begin());
  const double low = t[std::size_t(i - 1)], high = t[std::size_t(i)];
  return (double(i - 1) + (signal - low) / (high - low)) / double(t.size() - 1);
}

}  // namespace

TagCells cells_of(const std::string& name, int id) {
  const tracking::TagFamily family = tracking::make_tag_family(name);
  image_u8_t* image = apriltag_to_image(family.get(), id);
  TagCells tag{family->total_width, family->width_at_border, {}};
  for (int y = 0; y < tag.total; ++y)
    for (int x = 0; x < tag.total; ++x) tag.cells.push_back(image->buf[y * image->stride + x]);
  std::free(image->buf);  // the packaged library does not export image_u8_destroy
  std::free(image);
  return tag;
}

void add_polygon(LinearPicture& picture, const std::vector<glm::dvec2>& polygon, double amount) {
  // Signed area to the right of every edge, by pixel; summed along rows it is the coverage. Pixel
  // corners at whole numbers here.
  double left = HUGE_VAL, right = -HUGE_VAL, top = HUGE_VAL, bottom = -HUGE_VAL, area = 0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const glm::dvec2 p = polygon[i], q = polygon[(i + 1) % polygon.size()];
    left = std::min(left, p.x), right = std::max(right, p.x);
    top = std::min(top, p.y), bottom = std::max(bottom, p.y);
    area += p.x * q.y - q.x * p.y;
  }
  const int x0 = int(std::floor(left + 0.5)), y0 = int(std::floor(top + 0.5));
  const int w = int(std::floor(right + 0.5)) - x0 + 2, h = int(std::floor(bottom + 0.5)) - y0 + 1;
  std::vector<double> sums(std::size_t(w) * std::size_t(h), 0.0);
  const glm::dvec2 origin(x0 - 0.5, y0 - 0.5);
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const glm::dvec2 p = polygon[i] - origin, q = polygon[(i + 1) % polygon.size()] - origin;
    std::vector<double> cuts{0, 1};
    for (int axis = 0; axis < 2; ++axis) {
      const double a = std::min(p[axis], q[axis]), b = std::max(p[axis], q[axis]);
      for (double line = std::ceil(a); line <= b; ++line)
        if (b > a) cuts.push_back(std::clamp((line - p[axis]) / (q[axis] - p[axis]), 0.0, 1.0));
    }
    std::sort(cuts.begin(), cuts.end());
    for (std::size_t k = 0; k + 1 < cuts.size(); ++k) {
      const glm::dvec2 a = glm::mix(p, q, cuts[k]), b = glm::mix(p, q, cuts[k + 1]);
      const glm::dvec2 middle = (a + b) / 2.0;
      const int x = std::clamp(int(std::floor(middle.x)), 0, w - 2);
      const int y = std::clamp(int(std::floor(middle.y)), 0, h - 1);
      const double rise = b.y - a.y, beyond = middle.x - x;
      double* cell = &sums[std::size_t(y) * std::size_t(w) + std::size_t(x)];
      cell[0] += rise * (1 - beyond);
      cell[1] += rise * beyond;
    }
  }
  const double sign = area > 0 ? -1 : 1;  // y points down
  for (int y = 0; y < h; ++y) {
    double coverage = 0;
    for (int x = 0; x < w; ++x) {
      coverage += sums[std::size_t(y) * std::size_t(w) + std::size_t(x)];
      const int px = x0 + x, py = y0 + y;
      if (px < 0 || py < 0 || px >= picture.width || py >= picture.height) continue;
      picture.value[std::size_t(py) * std::size_t(picture.width) + std::size_t(px)] +=
          sign * coverage * amount;
    }
  }
}

LinearPicture render(const TagScene& scene) {
  LinearPicture picture{scene.lens.width, scene.lens.height, {}};
  picture.value.assign(std::size_t(picture.width) * std::size_t(picture.height), scene.background);
  std::vector<glm::dvec2> shifts{{0, 0}};
  if (scene.defocus_radius_px > 0) {
    // A disc by its own sunflower, centred exactly by pairs.
    shifts.clear();
    for (int i = 0; i < 24; ++i) {
      const double r = scene.defocus_radius_px * std::sqrt((i + 0.5) / 24), a = 2.39996323 * i;
      shifts.emplace_back(r * std::cos(a), r * std::sin(a));
      shifts.push_back(-shifts.back());
    }
  }
  const double share = 1.0 / double(shifts.size());
  for (const set::Tag& tag : scene.tags) {
    const TagCells l = cells_of(scene.family, tag.id);
    const double cell = tag.size_m / l.border, half = cell * l.total / 2;
    const auto add = [&](double x0, double y0, double x1, double y1, double amount) {
      const auto points = outline(scene, tag, x0, y0, x1, y1);
      for (const glm::dvec2& s : shifts) add_polygon(picture, shifted(points, s), amount * share);
    };
    add(-half, -half, half, half, scene.white - scene.background);
    for (int y = 0; y < l.total; ++y) {
      for (int x = 0; x < l.total; ++x) {
        if (l.cells[std::size_t(y * l.total + x)] > 127) continue;
        add(-half + x * cell, half - (y + 1) * cell, -half + (x + 1) * cell, half - y * cell,
            scene.black - scene.white);
      }
    }
  }
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x)
      picture.value[std::size_t(y) * std::size_t(picture.width) + std::size_t(x)] *=
          1 + scene.shading_per_px[0] * (x - picture.width / 2.0) +
          scene.shading_per_px[1] * (y - picture.height / 2.0);
  return picture;
}

Frame expose(const LinearPicture& picture, const Sensor& sensor, std::mt19937& random) {
  Frame frame;
  frame.source = "observer";
  frame.width = picture.width;
  frame.height = picture.height;
  frame.format = sensor.format;
  frame.bytes.assign(frame_bytes(frame.format, frame.width, frame.height), 128);
  std::normal_distribution<double> normal;
  const auto put = [&](std::size_t i, double v, bool deep) {
    const double most = deep ? 65535 : 255;
    const auto code = std::uint32_t(std::floor(std::clamp(v, 0.0, 1.0) * most + 0.5));
    frame.bytes[deep ? 2 * i : i] = std::uint8_t(code & 255);
    if (deep) frame.bytes[2 * i + 1] = std::uint8_t(code >> 8);
  };
  for (std::size_t i = 0; i < picture.value.size(); ++i) {
    const int channels =
        sensor.format == PixelFormat::rgb8 || sensor.format == PixelFormat::rgb16 ? 3 : 1;
    const bool deep = sensor.format == PixelFormat::rgb16 || sensor.format == PixelFormat::gray16;
    for (int c = 0; c < channels; ++c) {
      double signal = picture.value[i];
      if (sensor.full_well_e > 0) {
        const double electrons = signal * sensor.full_well_e;
        signal += normal(random) *
                  std::sqrt(std::max(0.0, electrons) + sensor.read_noise_e * sensor.read_noise_e) /
                  sensor.full_well_e;
      }
      double v = forward(sensor.response, std::clamp(signal, 0.0, 1.0));
      if (sensor.format == PixelFormat::yuv422p8) v = (16 + 219 * v) / 255;
      put(std::size_t(channels) * i + std::size_t(c), v, deep);
    }
  }
  return frame;
}

Frame gray_frame(int width, int height, std::vector<std::uint8_t> bytes) {
  Frame frame;
  frame.format = PixelFormat::gray8;
  frame.width = width;
  frame.height = height;
  frame.bytes = std::move(bytes);
  frame.bytes.resize(frame_bytes(frame.format, width, height));
  return frame;
}

std::array<glm::dvec2, 4> exact_corners(const TagScene& scene, const set::Tag& tag) {
  std::array<glm::dvec2, 4> corners;
  const double h = tag.size_m / 2;
  const glm::dvec2 plane[4] = {{-h, -h}, {h, -h}, {h, h}, {-h, h}};
  for (std::size_t i = 0; i < 4; ++i)
    corners[i] =
        project(scene, glm::dvec3(tag.world_from_tag * glm::dvec4(plane[i].x, plane[i].y, 0, 1)));
  return corners;
}

glm::dmat4 camera_looking(glm::dvec3 eye, glm::dvec3 target, glm::dvec3 up) {
  const glm::dvec3 z = glm::normalize(target - eye);
  const glm::dvec3 x = glm::normalize(glm::cross(z, up));
  const glm::dvec3 y = glm::cross(z, x);
  return {glm::dvec4(x, 0), glm::dvec4(y, 0), glm::dvec4(z, 0), glm::dvec4(eye, 1)};
}

set::Tag flat_tag(int id, double size_m, glm::dvec3 centre, double turn_rad) {
  return {id, size_m,
          glm::rotate(glm::translate(glm::dmat4(1.0), centre), turn_rad, glm::dvec3(0, 0, 1))};
}

PinholeIntrinsics plain_lens(int width, int height, double focal_px) {
  return {width, height, focal_px, focal_px, (width - 1) / 2.0, (height - 1) / 2.0};
}

}  // namespace previz::test
