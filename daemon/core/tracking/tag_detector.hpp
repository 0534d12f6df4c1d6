// Detects AprilTags in one picture: libapriltag finds the ids, our own refinement the corners.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "daemon/core/tracking/corners.hpp"
#include "daemon/core/tracking/photometry.hpp"
#include "daemon/core/tracking/search_plan.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"

namespace previz::tracking {

struct TagDetection {
  int id = 0;
  int hamming = 0;    // bits corrected
  double margin = 0;  // libapriltag's decision margin
  CornerPixels corners{};
  std::array<double, 64> covariance{};  // row-major 8x8 of the corners, px^2
  bool refined = false;  // false: libapriltag's corners, because cells are too small to measure
  std::string trouble;   // not empty: the id is valid, but the corners must not be used
};

struct DetectorSettings {
  std::string family = "tag36h11";
  double min_margin = 20;
  int max_hamming = 1;
  int threads = 1;       // that search a large part of a picture
  Fit fit = Fit::exact;  // of the corners
  // The black border is two cells wide, as Kalibr prints tag36h11; else it is one cell.
  bool wide_border = false;
  bool are_edges_fitted = true;  // else the corners are libapriltag's, not refined
};

// Families are libapriltag's, by name: tag36h11, tag25h9, tag16h5, tagStandard41h12, ... Throws
// previz::Error naming them all if `settings.family` is none of them.
class TagDetector {
 public:
  TagDetector(const DetectorSettings& settings, const PinholeIntrinsics& lens,
              const ResponseCurve& response);
  ~TagDetector();

  // Returns every tag that passes the gates, by id, then from left to right. `decimate` >= 1
  // shrinks the picture that is searched; corners are always measured at full resolution. Frames
  // below 16 px a side show no tag. Throws previz::Error if the frame is not of the lens's size.
  std::vector<TagDetection> detect(const Frame& frame, double decimate);
  // Returns the tags in parts of the picture: what the whole picture shows there at full
  // resolution, without the tags that a part's border cuts. Parts may meet.
  std::vector<TagDetection> detect(const Frame& frame, const SearchStep& parts);

  // Returns the width of a tag as printed, over that of its border.
  double printed_width() const;

 private:
  struct Library;
  void insist_on_size(const Frame& frame) const;
  void find(const Frame& frame, const Region& part, double decimate,
            std::vector<TagDetection>& tags);
  void measure(const Frame& frame, double decimate, TagDetection& tag) const;

  DetectorSettings settings_;
  PinholeIntrinsics lens_;
  Photometry photometry_;
  std::unique_ptr<Library> library_;
};

}  // namespace previz::tracking
