#include "daemon/core/render/picture/enlarge.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <glm/common.hpp>
#include <glm/vec2.hpp>
#include <glm/vec4.hpp>

#include "daemon/core/render/picture/each_pixel.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {
namespace {

// The four small pixels around the middle of a whole one.
struct Around {
  std::array<std::size_t, 4> pixels;
  std::array<double, 4> weights;  // bilinear
};

Around around(int width, int height, glm::dvec2 place) {
  const glm::dvec2 last(width - 1, height - 1);
  place = glm::clamp(place, glm::dvec2(0), last);
  const glm::dvec2 low = glm::floor(place), high = glm::min(low + 1.0, last), f = place - low;
  const auto pixel = [&](double x, double y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(x);
  };
  return {{pixel(low.x, low.y), pixel(high.x, low.y), pixel(low.x, high.y), pixel(high.x, high.y)},
          {(1 - f.x) * (1 - f.y), f.x * (1 - f.y), (1 - f.x) * f.y, f.x * f.y}};
}

double brightness(const Plate& plate, std::size_t pixel) {
  const std::uint16_t* samples = &plate.samples[3 * pixel];
  return (samples[0] + samples[1] + samples[2]) / (3.0 * ((1 << plate.bits) - 1));
}

// Returns a share as the device keeps it, in 8 bits: what is divided by the difference of two must
// not be finer.
double kept(double share) {
  return std::round(255 * share) / 255;
}

// What a small pixel adds on either side of an outline: on the one that is covered most of those
// around, and on the one that is covered least.
struct Sides {
  glm::dvec3 most, least;
  double high = 0, low = 0;  // how much of each is covered
};

// Returns the light of one side. `of_side(i)` says from 0 to 1 how far a pixel is of the side.
glm::dvec3 side_of(const Additions& additions, std::size_t own,
                   const std::vector<std::size_t>& around, const auto& of_side) {
  if (of_side(own) >= 1) return additions.light[own];
  glm::dvec3 sum(0);
  double total = 0;
  for (const std::size_t i : around) {
    const double weight = std::max(std::pow(of_side(i), 4), double{gpu::ENLARGE_LEAST});
    sum += weight * glm::dvec3(additions.light[i]);
    total += weight;
  }
  return sum / total;
}

Sides sides_of(const Additions& additions, std::size_t pixel) {
  const int width = additions.width, height = additions.height;
  const int x = static_cast<int>(pixel) % width, y = static_cast<int>(pixel) / width;
  std::vector<std::size_t> around;
  Sides sides{additions.light[pixel], additions.light[pixel], 0, 1};
  for (int i = 0; i < 9; ++i) {
    const int column = std::clamp(x + i % 3 - 1, 0, width - 1);
    const int row = std::clamp(y + i / 3 - 1, 0, height - 1);
    around.push_back(static_cast<std::size_t>(row * width + column));
    const double there = additions.mask[around.back()];
    sides.low = std::min(sides.low, there);
    sides.high = std::max(sides.high, there);
  }
  const double range = sides.high - sides.low;
  if (range > 0) {
    const auto of_most = [&](std::size_t i) { return (additions.mask[i] - sides.low) / range; };
    sides.most = side_of(additions, pixel, around, of_most);
    sides.least = side_of(additions, pixel, around, [&](std::size_t i) { return 1 - of_most(i); });
  }
  sides.high = kept(sides.high);
  sides.low = kept(sides.low);
  return sides;
}

double likeness(double off) {
  return std::max(1 - std::abs(off), double{gpu::ENLARGE_LEAST});
}

}  // namespace

Additions additions_of(const Layers& layers, const Plate& plate,
                       const std::function<float(std::uint16_t)>& light_of, double scale) {
  Additions additions{layers.width, layers.height, Sheet<glm::vec3>(layers.mask.size()),
                      layers.mask};
  each_pixel(layers.mask.size(), [&](std::size_t i) {
    for (int c = 0; c < 3; ++c) {
      const double camera = light_of(plate.samples[3 * i + static_cast<std::size_t>(c)]);
      additions.light[i][c] =
          static_cast<float>(scale * layers.composite[i][c] - (1.0 - layers.mask[i]) * camera);
    }
  });
  return additions;
}

Sheet<glm::vec3> enlarged(const Additions& additions, const Plate& small, const Plate& whole,
                          const std::function<float(std::uint16_t)>& light_of) {
  assert(additions.width == small.width && additions.height == small.height);
  const double sharpness = static_cast<double>(whole.width) / small.width;
  const glm::dvec2 step(static_cast<double>(small.width) / whole.width,
                        static_cast<double>(small.height) / whole.height);
  std::vector<Sides> sides(additions.mask.size());
  each_pixel(sides.size(), [&](std::size_t i) { sides[i] = sides_of(additions, i); });
  Sheet<glm::vec3> result(whole.samples.size() / 3);
  each_pixel(result.size(), [&](std::size_t i) {
    const glm::dvec3 plate(light_of(whole.samples[3 * i]), light_of(whole.samples[3 * i + 1]),
                           light_of(whole.samples[3 * i + 2]));
    const auto width = static_cast<std::size_t>(whole.width);
    const Around near =
        around(small.width, small.height, (glm::dvec2(i % width, i / width) + 0.5) * step - 0.5);
    double low = 1, high = 0, mask = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      low = std::min(low, sides[near.pixels[k]].low);
      high = std::max(high, sides[near.pixels[k]].high);
      mask += near.weights[k] * kept(additions.mask[near.pixels[k]]);
    }
    const double range = high - low;
    // An outline is as sharp as one pixel of the whole picture.
    const double share =
        range > 0 ? std::clamp(((mask - low) / range - 0.5) * sharpness + 0.5, 0.0, 1.0) : 1;
    glm::dvec4 most(0), least(0);
    for (std::size_t k = 0; k < 4; ++k) {
      const Sides& there = sides[near.pixels[k]];
      const double off_most = range > 0 ? (high - there.high) / range : 0;
      most += near.weights[k] * likeness(off_most) * glm::dvec4(there.most, 1);
      const double off_least = range > 0 ? (there.low - low) / range : 0;
      const double off = (kept(brightness(small, near.pixels[k])) - brightness(whole, i)) /
                         gpu::ENLARGE_BRIGHTNESS;
      least += near.weights[k] * likeness(off_least) / (1 + off * off) * glm::dvec4(there.least, 1);
    }
    result[i] = share * ((1 - high) * plate + glm::dvec3(most) / most.w) +
                (1 - share) * ((1 - low) * plate + glm::dvec3(least) / least.w);
  });
  return result;
}

}  // namespace previz::render
