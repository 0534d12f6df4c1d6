// What tracking costs at 1920x1080: CPU time a frame of libapriltag alone on the whole picture, of
// the tracker on the whole picture, and of the tracker in parts, as live, by turns on the same
// frames. The frames are those of ground truth sets, enlarged.
#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "daemon/core/tracking/apriltag_tracker.hpp"
#include "daemon/core/tracking/photometry.hpp"
#include "daemon/core/tracking/pose_starts.hpp"
#include "drivers/error.hpp"
#include "tests/bench/measure.hpp"
#include "tests/bench/program.hpp"
#include "tests/truth/tracking_measure.hpp"

namespace previz::bench {
namespace {

constexpr int width = 1920, height = 1080;

struct Film {
  std::string name;
  PinholeIntrinsics lens;
  ResponseCurve response;
  std::vector<Frame> frames;
  set::Tracking settings;
};

// Enlarged to the full width; of the height the middle is kept. The set's frames are played forth
// and back, as a camera moves.
Film enlarged(const std::filesystem::path& directory) {
  const truth::TruthSet set = truth::load_truth_set(directory);
  Film film{
      set.name, set.observer.intrinsics, set.observer.response, {}, truth::tracking_settings(set)};
  PinholeIntrinsics& lens = film.lens;
  const double scale = 1.0 * width / lens.width;
  const int rows = static_cast<int>(scale * lens.height), above = (rows - height) / 2;
  lens.fx *= scale, lens.fy *= scale;
  lens.cx = scale * (lens.cx + 0.5) - 0.5;
  lens.cy = scale * (lens.cy + 0.5) - 0.5 - above;
  lens.width = width, lens.height = height;
  for (const truth::ObserverFrame& observed : set.frames) {
    Frame frame = truth::read_frame(observed.file);
    const cv::Mat small(frame.height, frame.width, CV_8UC3, frame.bytes.data());
    cv::Mat large;
    cv::resize(small, large, {width, rows}, 0, 0, cv::INTER_CUBIC);
    large = large.rowRange(above, above + height).clone();
    frame.width = width, frame.height = height;
    frame.bytes.assign(large.data, large.data + large.total() * large.elemSize());
    film.frames.push_back(std::move(frame));
  }
  const std::vector<Frame> once = film.frames;
  film.frames.insert(film.frames.end(), once.rbegin(), once.rend());
  for (std::size_t i = 0; i < film.frames.size(); ++i)
    film.frames[i].timestamp_ns = static_cast<std::int64_t>(i) * 33'333'333;
  return film;
}

struct Row {
  std::string name;
  std::function<int(const Frame&)> search;  // returns how many tags it found
  std::vector<double> cpu_ms = {};
  int tags = 0;

  void measure(const Frame& frame) {
    const double cpu_s = cpu_seconds();
    tags += search(frame);
    cpu_ms.push_back(1e3 * (cpu_seconds() - cpu_s));
  }
};

// Returns how far the corners of the tags are apart by two poses, px.
double apart(const Film& film, const tracking::Pose& a, const tracking::Pose& b) {
  double most = 0;
  for (const set::Tag& tag : film.settings.tags)
    for (std::size_t i = 0; i < 4; ++i) {
      const glm::dvec4 corner =
          tag.world_from_tag * glm::dvec4(tracking::tag_corner(tag.size_m, i), 1);
      glm::dvec2 seen[2];
      for (const int k : {0, 1}) {
        const glm::dvec4 x = glm::inverse((k ? b : a).world_from_camera) * corner;
        seen[k] = glm::dvec2(film.lens.fx * x.x / x.z, film.lens.fy * x.y / x.z);
      }
      most = std::max(most, glm::distance(seen[0], seen[1]));
    }
  return most;
}

class Library {
 public:
  explicit Library(double decimate) {
    apriltag_detector_add_family_bits(detector_, family_, 1);
    detector_->quad_decimate = static_cast<float>(decimate);
  }
  ~Library() {
    apriltag_detector_destroy(detector_);
    tag36h11_destroy(family_);
  }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;

  int search(std::vector<std::uint8_t>& gray) {
    image_u8_t picture{width, height, width, gray.data()};
    zarray_t* found = apriltag_detector_detect(detector_, &picture);
    const int tags = zarray_size(found);
    apriltag_detections_destroy(found);
    return tags;
  }

 private:
  apriltag_family_t* family_ = tag36h11_create();
  apriltag_detector_t* detector_ = apriltag_detector_create();
};

void run(const Film& film) {
  const tracking::Photometry photometry(film.response);
  Library library(1), halved(2);
  const auto whole = tracking::make_apriltag_tracker(film.settings, film.lens, film.response);
  const auto parts = tracking::make_apriltag_tracker(film.settings, film.lens, film.response,
                                                     tracking::Search::parts);
  const auto used = [](const tracking::Track& track) {
    return track.pose ? static_cast<int>(track.seen_tags.size()) : 0;
  };
  std::vector<std::uint8_t> gray;
  tracking::Track in_whole, in_parts;
  double apart_px = 0;
  int other_tags = 0;
  std::vector<Row> rows{
      {"libapriltag, whole picture", [&](const Frame&) { return library.search(gray); }},
      {"libapriltag, decimate 2", [&](const Frame&) { return halved.search(gray); }},
      {"tracker, whole picture",
       [&](const Frame& frame) { return used(in_whole = whole->track(frame)); }},
      {"tracker, in parts",
       [&](const Frame& frame) { return used(in_parts = parts->track(frame)); }}};
  for (const Frame& frame : film.frames) {
    gray = photometry.gray8(frame);
    for (Row& row : rows) row.measure(frame);
    other_tags += in_whole.seen_tags != in_parts.seen_tags;
    if (in_whole.pose && in_parts.pose)
      apart_px = std::max(apart_px, apart(film, *in_whole.pose, *in_parts.pose));
  }
  std::printf(
      "\n%s, %zu frames of %dx%d\n\n| search | tags a frame | CPU ms a frame | CPU of "
      "libapriltag's |\n| --- | --- | --- | --- |\n",
      film.name.c_str(), film.frames.size(), width, height);
  for (const Row& row : rows)
    std::printf("| %s | %.1f | %.1f | %.2f |\n", row.name.c_str(),
                1.0 * row.tags / static_cast<double>(film.frames.size()), mean(row.cpu_ms),
                mean(row.cpu_ms) / mean(rows.front().cpu_ms));
  std::printf(
      "\nIn parts: other tags in %d frames; by its poses corners are at most %.2g px off.\n",
      other_tags, apart_px);
}

}  // namespace
}  // namespace previz::bench

int main(int argc, char** argv) {
  std::vector<std::string> sets;
  CLI::App app("CPU time of tracking at 1920x1080");
  app.add_option("SETDIR", sets)->check(CLI::ExistingDirectory);
  return previz::bench::run_program(app, argc, argv, [&] {
    for (const std::string& set : sets) previz::bench::run(previz::bench::enlarged(set));
  });
}
