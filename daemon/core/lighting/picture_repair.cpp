#include "daemon/core/lighting/picture_repair.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <compare>
#include <limits>

#include "drivers/error.hpp"

namespace previz::lighting {
namespace {

struct Place {
  int y = 0, x = 0;

  friend auto operator<=>(const Place&, const Place&) = default;
};

// Counts pixels, which are met row by row.
struct Found {
  std::size_t pixels = 0;
  Place first;

  void add(int x, int y) {
    if (pixels++ == 0) first = {y, x};
  }
};

bool is_beyond(float value) {
  return value > most_radiance;  // +Inf too
}
bool is_good(float value) {
  return value >= 0 && !is_beyond(value);  // NaN is neither
}
bool is_negative(float value) {
  return value < 0 && std::isfinite(value);
}

template <typename Body>  // body(x, y) of the used pixels in the 3x3 around one
void for_neighbours(const LinearPicture& picture, const PictureShape& shape, const Place& place,
                    const Body& body) {
  for (int y = std::max(place.y - 1, 0); y <= std::min(place.y + 1, picture.height - 1); ++y)
    for (int column = place.x - 1; column <= place.x + 1; ++column) {
      if (!shape.wraps && (column < 0 || column >= picture.width)) continue;
      const int x = (column + picture.width) % picture.width;
      if (shape.uses(x, y)) body(x, y);
    }
}

// Returns the lower median.
float median(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>((values.size() - 1) / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Fills the NaNs of a channel from their borders inwards; `missing` are all of them, and
// `negative`, in order, those of them that were negative.
void fill(LinearPicture& picture, const PictureShape& shape, int channel,
          std::vector<Place> missing, const std::vector<Place>& negative) {
  std::vector<float> around;
  while (!missing.empty()) {
    std::vector<std::pair<Place, float>> filled;
    for (const Place& place : missing) {
      around.clear();
      for_neighbours(picture, shape, place, [&](int x, int y) {
        const float value = picture.at(x, y)[channel];
        if (!std::isnan(value)) around.push_back(value);
      });
      if (around.empty()) continue;
      const bool was_negative = std::binary_search(negative.begin(), negative.end(), place);
      filled.emplace_back(place, was_negative ? *std::ranges::min_element(around) : median(around));
    }
    for (const auto& [place, value] : filled) picture.at(place.x, place.y)[channel] = value;
    missing.clear();
    for (const auto& [place, value] : filled)
      for_neighbours(picture, shape, place, [&](int x, int y) {
        if (std::isnan(picture.at(x, y)[channel])) missing.push_back({y, x});
      });
    std::sort(missing.begin(), missing.end());
    missing.erase(std::unique(missing.begin(), missing.end()), missing.end());
  }
}

}  // namespace

void repair(LinearPicture& picture, const PictureShape& shape, const std::filesystem::path& path,
            std::vector<std::string>& notes) {
  Found beyond, negative, missing_light;
  float largest = largest_half;
  std::size_t used = 0;
  glm::bvec3 has_light(false);
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) {
      if (!shape.uses(x, y)) continue;
      ++used;
      const glm::vec3& radiance = picture.at(x, y);
      bool has_beyond = false, has_negative = false, has_none = false;
      for (int c = 0; c < 3; ++c) {
        const float value = radiance[c];
        const bool is_light = is_good(value) || is_beyond(value);
        has_beyond |= is_beyond(value);
        has_negative |= is_negative(value);
        has_none |= !is_light && !is_negative(value);
        has_light[c] |= is_light;
        if (is_good(value)) largest = std::max(largest, value);
      }
      if (has_beyond) beyond.add(x, y);
      if (has_negative) negative.add(x, y);
      if (has_none) missing_light.add(x, y);
    }
  for (int c = 0; c < 3; ++c)
    if (!has_light[c])
      throw Error(fmt::format(
          "{}: no pixel's {} holds a brightness (all are negative or not a number); export the "
          "picture again",
          path.string(),
          c == 0   ? "red"
          : c == 1 ? "green"
                   : "blue"));
  if (beyond.pixels + negative.pixels + missing_light.pixels == 0) return;

  for (int c = 0; c < 3; ++c) {
    std::vector<Place> missing, were_negative;
    for (int y = 0; y < picture.height; ++y)
      for (int x = 0; x < picture.width; ++x) {
        float& value = picture.at(x, y)[c];
        if (is_good(value) || !shape.uses(x, y)) continue;
        if (is_beyond(value)) {
          value = largest;
        } else {
          if (is_negative(value)) were_negative.push_back({y, x});
          value = std::numeric_limits<float>::quiet_NaN();
          missing.push_back({y, x});
        }
      }
    fill(picture, shape, c, std::move(missing), were_negative);
  }
  if (beyond.pixels > 0)
    notes.push_back(fmt::format(
        "{}: {} of {} pixels {} brighter than the file could store (infinite, or above 1e12) and "
        "set to {}; the first is at x = {}, y = {}. A sun or lamp there may be darker than it "
        "was",
        path.string(), beyond.pixels, used, beyond.pixels == 1 ? "is" : "are", largest,
        beyond.first.x, beyond.first.y));
  if (negative.pixels > 0)
    notes.push_back(fmt::format(
        "{}: {} of {} pixels {} negative and {} filled from the darkest beside them, as "
        "there are around the lamps of a picture that was sharpened or scaled; the first "
        "is at x = {}, y = {}",
        path.string(), negative.pixels, used, negative.pixels == 1 ? "is" : "are",
        negative.pixels == 1 ? "is" : "are", negative.first.x, negative.first.y));
  if (missing_light.pixels > 0)
    notes.push_back(fmt::format(
        "{}: {} of {} pixels {} no brightness (not a number) and {} filled from the pixels around; "
        "the first is at x = {}, y = {}",
        path.string(), missing_light.pixels, used, missing_light.pixels == 1 ? "holds" : "hold",
        missing_light.pixels == 1 ? "is" : "are", missing_light.first.x, missing_light.first.y));
}

}  // namespace previz::lighting
