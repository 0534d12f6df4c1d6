// Looks for tags in pictures of a scan, and measures where their corners are on its surface.
#pragma once

#include <array>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/set/set.hpp"
#include "daemon/core/tracking/tag_detector.hpp"
#include "daemon/tools/model/scan_painter.hpp"

namespace previz::model {

// A tag on the scan; lengths are in the scan's unit.
struct TagSighting {
  int id = 0;
  std::array<glm::dvec3, 4> corners{};  // in the order of tracking::TagDetection
  glm::dvec3 normal{0};                 // unit vector, towards who sees it
  double uneven = 0;                    // root mean square of the surface's distance from a plane
  bool is_rough = false;                // the id is valid, but the corners are estimates
};

glm::dvec3 centre_of(const TagSighting& tag);
double side_of(const TagSighting& tag);  // the mean of four

enum class Mirroring { off, on };  // of pictures

class TagSightings {
 public:
  // Both must outlive this; the set must have tags.
  TagSightings(const ScanFile& scan, const set::Tracking& tracking);
  ~TagSightings();
  TagSightings(const TagSightings&) = delete;
  TagSightings& operator=(const TagSightings&) = delete;

  double grain() const { return painter_.grain(); }

  // Returns the size of the pixels that `from_all_sides` may use: this one, or a larger one if
  // there would be too many of them.
  double possible_pixel(double pixel) const;

  // Returns what pictures from all sides show whose pixels are of this possible size. The same tag
  // is in it many times.
  std::vector<TagSighting> from_all_sides(double pixel, Mirroring mirroring);

  // Returns the tag as seen from the front and from places around it, from wherever it is found and
  // can be measured.
  std::vector<TagSighting> close_to(const TagSighting& tag);

 private:
  struct Side;
  std::vector<ScanView> views_of_surface(double pixel) const;
  void look(const ScanView& view, std::vector<TagSighting>& seen);
  std::optional<TagSighting> on_surface(const ScanView& view,
                                        const tracking::TagDetection& found) const;

  // Returns a detector for pictures of this size, which it relies on.
  tracking::TagDetector& detector_for(int width, int height);

  const set::Tracking& tracking_;
  ScanPainter painter_;
  std::vector<Side> sides_;
  std::array<int, 2> detector_px_{};
  std::unique_ptr<tracking::TagDetector> detector_;
};

}  // namespace previz::model
