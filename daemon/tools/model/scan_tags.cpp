#include "daemon/tools/model/scan_tags.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <set>
#include <utility>

#include "daemon/core/tracking/tag_family.hpp"
#include "daemon/core/tracking/tag_map.hpp"
#include "daemon/tools/model/scan_sightings.hpp"
#include "daemon/tools/model/start.hpp"
#include "drivers/error.hpp"

namespace previz::model {
namespace {

// A cell of a tag is drawn with so many pixels, if the scan's colours have as many.
constexpr double pixels_a_cell = 5;
// A tag can be read if its colours have at least so many pixels for a cell.
constexpr int least_pixels_a_cell = 3;
// A tag is measured in five pictures; some of them may have something in the way.
constexpr std::size_t least_views = 2;
// A tag is ignored if it deviates by more than these fractions of its side.
constexpr double most_spread = 0.03, most_uneven = 0.02, most_off_square = 0.05,
                 most_off_size = 0.1;

constexpr const char* by_points =
    "place the scan by three or more marked points, under [scan.points]";

struct MeasuredTag {
  const set::Tag* tag = nullptr;
  TagSighting on_scan;
};

using Sightings = std::vector<TagSighting>;

// Returns the sightings of one tag by the places where they are.
std::vector<Sightings> by_places(const Sightings& seen) {
  std::vector<Sightings> places;
  for (const TagSighting& tag : seen) {
    const auto near = std::ranges::find_if(places, [&](const Sightings& place) {
      return glm::distance(centre_of(place.front()), centre_of(tag)) < side_of(tag) / 2;
    });
    if (near == places.end())
      places.push_back({tag});
    else
      near->push_back(tag);
  }
  return places;
}

// Returns the mean of several views of a tag, and how far a corner is from it at most.
std::pair<TagSighting, double> combined(const Sightings& views) {
  TagSighting mean = views.front();
  const auto count = static_cast<double>(views.size());
  double spread = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    mean.corners[k] = glm::dvec3(0);
    for (const TagSighting& view : views) mean.corners[k] += view.corners[k] / count;
    for (const TagSighting& view : views)
      spread = std::max(spread, glm::distance(view.corners[k], mean.corners[k]));
  }
  for (const TagSighting& view : views) mean.uneven = std::max(mean.uneven, view.uneven);
  return {mean, spread};
}

// Returns by how much sides and diagonals differ from those of a square of the same mean side, as a
// fraction of it.
double off_square(const TagSighting& tag) {
  const double side = side_of(tag);
  double most = 0;
  for (std::size_t k = 0; k < 4; ++k)
    most = std::max(most, std::abs(glm::distance(tag.corners[k], tag.corners[(k + 1) % 4]) - side));
  for (std::size_t k = 0; k < 2; ++k)
    most = std::max(
        most, std::abs(glm::distance(tag.corners[k], tag.corners[k + 2]) - std::sqrt(2.0) * side));
  return most / side;
}

// Measures what is found in pictures from all sides.
class Measurement {
 public:
  Measurement(TagSightings& sightings, const set::Tracking& tracking)
      : sightings_(sightings), tracking_(tracking) {}

  void add(int id, const Sightings& seen) {
    const auto tag = std::ranges::find(tracking_.tags, id, &set::Tag::id);
    std::vector<Sightings> views;
    std::size_t most = 0;
    for (const Sightings& place : by_places(seen)) {
      views.push_back(sightings_.close_to(place.front()));
      most = std::max(most, views.back().size());
    }
    std::erase_if(views, [](const Sightings& place) { return place.size() < least_views; });
    if (views.size() > 1)
      return note(id, fmt::format("is on the scan at {} places; ignored, as it is not clear which "
                                  "of them is the set's",
                                  views.size()));
    if (views.empty())
      return note(id, fmt::format("is readable from {} of 5 directions only; ignored", most));
    const auto [mean, spread] = combined(views.front());
    if (const std::string fault = fault_of(mean, spread); !fault.empty())
      return note(id, fault + "; ignored");
    tags_.push_back({&*tag, mean});
  }

  // Ignores tags that have another size on the scan than the other tags imply.
  void compare_sizes() {
    std::vector<double> scales;
    for (const MeasuredTag& tag : tags_) scales.push_back(scale_of(tag));
    if (scales.empty()) return;
    std::ranges::sort(scales);
    const double usual = (scales[(scales.size() - 1) / 2] + scales[scales.size() / 2]) / 2;
    std::erase_if(tags_, [&](const MeasuredTag& tag) {
      const double ratio = usual / scale_of(tag);
      if (std::abs(std::log(ratio)) < std::log(1 + most_off_size)) return false;
      note(tag.tag->id, fmt::format("is {:.2f} times as large as the set's other tags make it; "
                                    "ignored; check its size in the set",
                                    ratio));
      return true;
    });
  }

  const std::vector<MeasuredTag>& tags() const { return tags_; }
  const std::vector<std::string>& notes() const { return notes_; }

 private:
  // Returns the metres for 1 of the scan.
  static double scale_of(const MeasuredTag& tag) { return tag.tag->size_m / side_of(tag.on_scan); }

  void note(int id, const std::string& what) {
    notes_.push_back(fmt::format("tag {} {}", id, what));
  }

  std::string fault_of(const TagSighting& tag, double spread) const {
    const double side = side_of(tag);
    if (spread > std::max(most_spread * side, 2 * sightings_.grain()))
      return fmt::format(
          "is not usable: its corners differ between the pictures by up to {:.0f} % of its size",
          100 * spread / side);
    if (tag.uneven > most_uneven * side)
      return fmt::format("is not flat on the scan, by {:.1f} % of its size (rms)",
                         100 * tag.uneven / side);
    if (off_square(tag) > most_off_square)
      return fmt::format("is not square on the scan, by {:.0f} % of its size",
                         100 * off_square(tag));
    return {};
  }

  TagSightings& sightings_;
  const set::Tracking& tracking_;
  std::vector<MeasuredTag> tags_;
  std::vector<std::string> notes_;
};

struct Found {
  std::map<int, Sightings> of_set;
  std::set<int> strangers;  // tags that the set lacks
};

Found sorted(const Sightings& seen, const set::Tracking& tracking) {
  Found found;
  for (const TagSighting& tag : seen) {
    if (std::ranges::find(tracking.tags, tag.id, &set::Tag::id) == tracking.tags.end())
      found.strangers.insert(tag.id);
    else
      found.of_set[tag.id].push_back(tag);
  }
  return found;
}

// Returns the sizes of pixels to look with: first by the size of the tags, if the scan's unit is
// known, then as fine as the colours are.
std::vector<double> pixels_to_try(double grain, const set::Tracking& tracking,
                                  std::optional<double> unit_m) {
  const double finest = grain / 1.5;
  if (!unit_m) return {finest};
  const double smallest_m = std::ranges::min(tracking.tags, {}, &set::Tag::size_m).size_m;
  const int cells = tracking::tag_cells(tracking.family, tracking.tags.front().id).border;
  const double by_size = smallest_m / *unit_m / cells / pixels_a_cell;
  if (by_size <= finest) return {finest};
  return {by_size, finest};
}

Found look_for_tags(TagSightings& sightings, const set::Tracking& tracking,
                    const std::vector<double>& pixels, Mirroring mirroring) {
  Found found;
  double last = 0;
  for (const double wanted : pixels) {
    const double pixel = sightings.possible_pixel(wanted);
    if (pixel == last) continue;
    last = pixel;
    found = sorted(sightings.from_all_sides(pixel, mirroring), tracking);
    if (!found.of_set.empty()) break;
  }
  return found;
}

std::string in_words(const std::set<int>& tags) {
  return tracking::tags_in_words({tags.begin(), tags.end()});
}

// Returns why no tag is found, and what to do. `looked` is the size of the pixels of the pictures.
std::string without_tags_in_words(double grain, double looked, const set::Tracking& tracking,
                                  std::optional<double> unit_m) {
  const double largest_m = std::ranges::max(tracking.tags, {}, &set::Tag::size_m).size_m;
  const int needed =
      least_pixels_a_cell * tracking::tag_cells(tracking.family, tracking.tags.front().id).border;
  const std::string none = "its colours show no tag of the family " + tracking.family;
  if (!unit_m)
    return fmt::format(
        "{}; a pixel of its colours is {:.4g} units wide, and a tag needs {} of them along a side; "
        "export it with larger textures if a tag has fewer",
        none, grain, needed);
  const std::string tag = fmt::format("a tag of {:.0f} mm", 1000 * largest_m);
  const double pixels = largest_m / *unit_m / grain, looked_pixels = largest_m / *unit_m / looked;
  if (pixels < needed)
    return fmt::format(
        "{}: {} has {:.0f} pixels along a side, and {} are needed; export it with "
        "larger textures",
        none, tag, pixels, needed);
  if (looked_pixels < needed)
    return fmt::format(
        "{}: {} has {:.0f} pixels along a side, but so large a scan is searched with "
        "{:.0f}, and {} are needed; export less of it",
        none, tag, pixels, looked_pixels, needed);
  return fmt::format(
      "{} that can be read, although {} has {:.0f} pixels along a side; check that "
      "tags were in view while it was scanned, that nothing covers them, and that "
      "its faces are outwards",
      none, tag, pixels);
}

void insist_on_colours(const std::string& subject, const ScanFile& scan,
                       const set::Tracking& tracking) {
  if (tracking.tags.empty())
    throw Error(
        fmt::format("{}: has no points, and the set has no tag to place it by; measure the "
                    "set's tags with previz calibrate tags, or {}",
                    subject, by_points));
  if (std::ranges::any_of(scan.colours.sources, [](int source) { return source != colourless; }))
    return;
  throw Error(
      fmt::format("{}: has no points, and neither a texture nor colours that could show "
                  "the set's tags; export it with its texture, or {}",
                  subject, by_points));
}

}  // namespace

ScanTags find_scan_tags(const std::string& subject, const ScanFile& scan,
                        const set::Tracking& tracking, std::optional<double> unit_m) {
  insist_on_colours(subject, scan, tracking);
  TagSightings sightings(scan, tracking);
  if (!(sightings.grain() > 0))
    throw Error(
        fmt::format("{}: its texture is not spread over its faces, because they have no "
                    "texture coordinates; export it with them, or {}",
                    subject, by_points));
  const std::vector<double> pixels = pixels_to_try(sightings.grain(), tracking, unit_m);
  const Found found = look_for_tags(sightings, tracking, pixels, Mirroring::off);
  if (found.of_set.empty()) {
    const double finest = sightings.possible_pixel(pixels.back());
    const Found mirrored = look_for_tags(sightings, tracking, {finest}, Mirroring::on);
    if (!mirrored.of_set.empty())
      throw Error(
          fmt::format("{}: is mirrored, or its faces are inside out: tags can be read in its "
                      "mirror image only; "
                      "export it with right-handed axes and its faces outwards, or {}",
                      subject, by_points));
    if (!found.strangers.empty())
      throw Error(
          fmt::format("{}: shows {} and no tag that the set has fixed in the world; measure "
                      "the set's tags with previz calibrate tags, or {}",
                      subject, in_words(found.strangers), by_points));
    throw Error(fmt::format("{}: {}, or {}", subject,
                            without_tags_in_words(sightings.grain(), finest, tracking, unit_m),
                            by_points));
  }
  Measurement measurement(sightings, tracking);
  for (const auto& [id, seen] : found.of_set) measurement.add(id, seen);
  measurement.compare_sizes();
  ScanTags tags{{}, {}, measurement.notes(), sightings.grain()};
  if (measurement.tags().empty()) {
    std::string reasons;
    for (const std::string& note : tags.notes) reasons += note + "; ";
    throw Error(fmt::format("{}: no tag on it can be used: {}{}", subject, reasons, by_points));
  }
  if (!found.strangers.empty())
    tags.notes.push_back(
        fmt::format("shows {}, which the set does not have fixed in the world; ignored",
                    in_words(found.strangers)));
  for (const MeasuredTag& measured : measurement.tags()) {
    const std::array<glm::dvec3, 4> in_world = corners_of(*measured.tag);
    tags.ids.push_back(measured.tag->id);
    for (std::size_t k = 0; k < 4; ++k)
      tags.corners.push_back({fmt::format("tag {} corner {}", measured.tag->id, k + 1),
                              measured.on_scan.corners[k], in_world[k], measured.tag->id});
  }
  return tags;
}

}  // namespace previz::model
