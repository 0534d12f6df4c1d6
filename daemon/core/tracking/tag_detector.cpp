#include "daemon/core/tracking/tag_detector.hpp"

#include <apriltag/apriltag.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include "daemon/core/tracking/tag_family.hpp"
#include "drivers/error.hpp"
#include "drivers/plate.hpp"

namespace previz::tracking {
namespace {

// Makes the border a cell wider on every side, around the same codes.
void widen(apriltag_family_t& family) {
  family.width_at_border += 2;
  family.total_width += 2;
  for (std::uint32_t bit = 0; bit < family.nbits; ++bit) {
    ++family.bit_x[bit];
    ++family.bit_y[bit];
  }
}

constexpr int kMinPictureSide =
    16;  // libapriltag thresholds in tiles and reads past the end of smaller pictures
constexpr double kMinSidePx = 8;    // of a tag; a smaller one has less than a pixel per cell
constexpr double kMinCellPx = 1.7;  // the refinement needs an edge and a plain pixel on either side
constexpr double kCoarseDecimate = 2;
constexpr double kCutPx = 4;  // libapriltag looks at so much about a tag
constexpr double kSmallPart =
    8;  // threads do not pay in a part of a picture that is smaller by this
constexpr double kUnrefinedSigmaPx = 0.5;  // libapriltag's corners, decimated or of tiny tags

// A tag cut by the picture's border is seen with a false corner on that border.
bool near_border(const CornerPixels& corners, const Frame& frame, double margin) {
  return std::any_of(corners.begin(), corners.end(), [&](glm::dvec2 p) {
    return !(p.x >= margin && p.y >= margin && p.x <= frame.width - 1 - margin &&
             p.y <= frame.height - 1 - margin);
  });
}

double shortest_side(const CornerPixels& c) {
  double least = HUGE_VAL;
  for (std::size_t i = 0; i < 4; ++i) {
    const glm::dvec2 d = c[(i + 1) % 4] - c[i];
    least = std::min(least, std::hypot(d.x, d.y));
  }
  return least;
}

double area(const CornerPixels& c) {
  double twice = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const glm::dvec2 &a = c[i], &b = c[(i + 1) % 4];
    twice += a.x * b.y - b.x * a.y;
  }
  return std::abs(twice) / 2;
}

// A tag that a part's border cuts is found whole in another part, or not at all.
bool cut_by(const Region& part, const Frame& frame, const CornerPixels& corners) {
  return std::any_of(corners.begin(), corners.end(), [&](glm::dvec2 p) {
    return (part.x > 0 && p.x < part.x + kCutPx) || (part.y > 0 && p.y < part.y + kCutPx) ||
           (part.x + part.width < frame.width && p.x > part.x + part.width - 1 - kCutPx) ||
           (part.y + part.height < frame.height && p.y > part.y + part.height - 1 - kCutPx);
  });
}

glm::dvec2 middle_of(const CornerPixels& c) {
  return (c[0] + c[1] + c[2] + c[3]) / 4.0;
}

bool is_same_print(const TagDetection& a, const TagDetection& b) {
  const glm::dvec2 apart = middle_of(a.corners) - middle_of(b.corners);
  return a.id == b.id && std::hypot(apart.x, apart.y) < shortest_side(a.corners) / 2;
}

bool goes_before(const TagDetection& a, const TagDetection& b) {
  return std::tuple(a.id, a.corners[0].x, a.corners[0].y) <
         std::tuple(b.id, b.corners[0].x, b.corners[0].y);
}

}  // namespace

struct TagDetector::Library {
  TagFamily family;
  apriltag_detector_t* detector;
  apriltag_detector_t* fast;  // with several threads

  // The table of codes grows with the power of `max_hamming`: gigabytes for the large families at
  // the library's limit of 2.
  explicit Library(const DetectorSettings& settings)
      : family(make_tag_family(settings.family, "tracking.family: ")),
        detector(apriltag_detector_create()),
        fast(apriltag_detector_create()) {
    if (settings.wide_border) widen(*family);
    for (apriltag_detector_t* d : {detector, fast})
      apriltag_detector_add_family_bits(d, family.get(), std::clamp(settings.max_hamming, 0, 2));
    fast->nthreads = std::max(1, settings.threads);
    if (fast->nthreads > 1) begin_threads();
  }
  // A thread of libapriltag's pool that begins while tasks are handed out reads their list while it
  // is moved in memory (workerpool.c of 3.3), which ends the process. The pool begins with the
  // first picture: here it is one whose tasks need no more than the list's first 8 places, and
  // after it all threads wait for work.
  void begin_threads() const {
    constexpr int side = 8;
    std::array<std::uint8_t, std::size_t{side} * side> black{};
    image_u8_t picture{side, side, side, black.data()};
    fast->quad_decimate = 1;
    apriltag_detections_destroy(apriltag_detector_detect(fast, &picture));
  }
  ~Library() {
    apriltag_detector_destroy(detector);
    apriltag_detector_destroy(fast);
  }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;
};

TagDetector::TagDetector(const DetectorSettings& settings, const PinholeIntrinsics& lens,
                         const ResponseCurve& response)
    : settings_(settings),
      lens_(lens),
      photometry_(response),
      library_(std::make_unique<Library>(settings)) {}

TagDetector::~TagDetector() = default;

double TagDetector::printed_width() const {
  return 1.0 * library_->family->total_width / library_->family->width_at_border;
}

// Pixels are looked up within the lens's picture.
void TagDetector::insist_on_size(const Frame& frame) const {
  if (frame.width == lens_.width && frame.height == lens_.height) return;
  const auto words_of = [](int width, int height) {
    return std::to_string(width) + 'x' + std::to_string(height);
  };
  throw Error("a picture has " + words_of(frame.width, frame.height) +
              " pixels, but its lens is calibrated for " + words_of(lens_.width, lens_.height));
}

std::vector<TagDetection> TagDetector::detect(const Frame& frame, double decimate) {
  insist_on_size(frame);
  if (frame.bayer != BayerPattern::none)
    return detect(*demosaiced(std::make_shared<Frame>(frame)), decimate);
  std::vector<TagDetection> tags;
  find(frame, {0, 0, frame.width, frame.height}, decimate, tags);
  for (TagDetection& tag : tags) measure(frame, decimate, tag);
  std::sort(tags.begin(), tags.end(), goes_before);
  return tags;
}

std::vector<TagDetection> TagDetector::detect(const Frame& frame, const SearchStep& parts) {
  insist_on_size(frame);
  if (frame.bayer != BayerPattern::none)
    return detect(*demosaiced(std::make_shared<Frame>(frame)), parts);
  std::vector<TagDetection> tags;
  const auto add = [&](const Region& part, double decimate) {
    std::vector<TagDetection> here;
    find(frame, part, decimate, here);
    for (TagDetection& tag : here) {
      const bool is_known = std::any_of(tags.begin(), tags.end(), [&](const TagDetection& known) {
        return is_same_print(known, tag);
      });
      if (is_known || cut_by(part, frame, tag.corners)) continue;
      measure(frame, decimate, tag);
      tags.push_back(tag);
    }
  };
  for (const Region& part : parts.regions) add(part, 1);
  if (parts.coarse) add({0, 0, frame.width, frame.height}, kCoarseDecimate);
  std::sort(tags.begin(), tags.end(), goes_before);
  return tags;
}

void TagDetector::find(const Frame& frame, const Region& part, double decimate,
                       std::vector<TagDetection>& tags) {
  if (part.width < kMinPictureSide * decimate || part.height < kMinPictureSide * decimate) return;
  std::vector<std::uint8_t> gray = photometry_.gray8(frame, part);
  image_u8_t picture{part.width, part.height, part.width, gray.data()};
  const bool is_large =
      1.0 * part.width * part.height * kSmallPart > 1.0 * frame.width * frame.height;
  apriltag_detector_t* const detector = is_large ? library_->fast : library_->detector;
  detector->quad_decimate = float(decimate);
  zarray_t* found = apriltag_detector_detect(detector, &picture);
  for (int i = 0; i < zarray_size(found); ++i) {
    apriltag_detection_t* d = nullptr;
    zarray_get(found, i, &d);
    if (d->hamming > settings_.max_hamming || d->decision_margin < settings_.min_margin) continue;
    TagDetection tag;
    tag.id = d->id;
    tag.hamming = d->hamming;
    tag.margin = d->decision_margin;
    // In libapriltag (0,0) is a pixel's corner; here it is a pixel's centre.
    for (std::size_t k = 0; k < 4; ++k)
      tag.corners[k] = {d->p[k][0] - 0.5 + part.x, d->p[k][1] - 0.5 + part.y};
    if (area(tag.corners) >= kMinSidePx * kMinSidePx) tags.push_back(tag);
  }
  apriltag_detections_destroy(found);
}

void TagDetector::measure(const Frame& frame, double decimate, TagDetection& tag) const {
  const Luminance luminance = [&](int x, int y) { return photometry_.luminance(frame, x, y); };
  const int cells = library_->family->width_at_border;
  if (near_border(tag.corners, frame, 1 + decimate)) {
    tag.trouble = "cut by the picture's border";
  } else if (settings_.are_edges_fitted && shortest_side(tag.corners) > 4 &&
             narrowest_cell_px(tag.corners, cells) >= kMinCellPx) {
    const RefinedCorners refined = refine_corners(luminance, lens_, tag.corners, cells,
                                                  library_->family->reversed_border, settings_.fit);
    tag.trouble = refined.trouble;
    if (refined.trouble.empty()) {
      tag.corners = refined.pixel;
      tag.covariance = refined.covariance;
      tag.refined = true;
    }
  } else {
    for (std::size_t k = 0; k < 8; ++k)
      tag.covariance[9 * k] = kUnrefinedSigmaPx * kUnrefinedSigmaPx;
  }
}

}  // namespace previz::tracking
