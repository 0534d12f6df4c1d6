// tracking_report SETDIR...: the tracker's figures on ground truth sets, a line a frame and a
// total.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <glm/geometric.hpp>
#include <utility>

#include "drivers/error.hpp"
#include "tests/bench/program.hpp"
#include "tests/truth/tracking_measure.hpp"
#include "tests/truth/tracking_photographs.hpp"

namespace {

using namespace previz;

struct Mean {
  double sum = 0, most = 0;
  int count = 0;
  void add(double v) { sum += v, most = std::max(most, v), ++count; }
  double mean() const { return count ? sum / count : 0; }
};

void report(const truth::TruthSet& set, const set::Tracking& settings, tracking::Search search) {
  std::printf("%s (%dx%d, %zu frames, decimate %g)\n", set.name.c_str(),
              set.observer.intrinsics.width, set.observer.intrinsics.height, set.frames.size(),
              settings.decimate);
  std::printf("%5s %-9s %-9s %9s %8s %8s %8s %9s %9s %7s  %s\n", "frame", "status", "tags",
              "corner_px", "reproj", "vertex", "max", "rot_mrad", "trans_mm", "nees", "why");
  Mean corner, reprojection, vertex, nees, corner_chi;
  Mean shown, jitter, shown_jitter;
  int held = 0;
  for (const truth::TrackedFrame& row : measure_tracking(set, settings, search)) {
    held += row.held_s > 0;
    if (row.shown_px) shown.add(*row.shown_px);
    if (row.jitter_px) jitter.add(*row.jitter_px);
    if (row.shown_jitter_px) shown_jitter.add(*row.shown_jitter_px);
    Mean here;
    for (const truth::CornerError& tag : row.corners) {
      if (!tag.trouble.empty() || tag.error_px.size() < 4) continue;
      for (const glm::dvec2& e : tag.error_px) {
        here.add(glm::length(e));
        corner.add(glm::length(e));
      }
      corner_chi.add(tag.chi_square / 8);
    }
    std::string tags;
    if (row.track.pose)
      for (int id : row.track.pose->tags) tags += (tags.empty() ? "" : ",") + std::to_string(id);
    std::printf("%5d %-9s %-9s %9.3f %8.3f %8.3f %8.3f %9.3f %9.3f %7.2f  %s\n", row.index,
                to_string(row.track.status), tags.c_str(), here.mean(), row.reprojection_px,
                row.vertex_px, row.vertex_max_px, 1e3 * row.rotation_rad, 1e3 * row.translation_m,
                row.error_squared, row.track.reason.c_str());
    if (!row.track.pose) continue;
    reprojection.add(row.reprojection_px);
    vertex.add(row.vertex_px);
    nees.add(row.error_squared);
  }
  std::printf(
      "  tracked %d of %zu; mean (max) px: corner %.3f (%.3f), reprojection %.3f (%.3f), vertices "
      "%.3f (%.3f)\n  corner chi2/8 %.2f, pose nees/6 %.2f\n  shown live: vertices %.3f (%.3f), "
      "jitter %.3f px of %.3f, held %d\n\n",
      vertex.count, set.frames.size(), corner.mean(), corner.most, reprojection.mean(),
      reprojection.most, vertex.mean(), vertex.most, corner_chi.mean(), nees.mean() / 6,
      shown.mean(), shown.most, shown_jitter.mean(), jitter.mean(), held);
}

void report_video(const std::filesystem::path& file, double decimate) {
  const truth::WallVideo wall = truth::read_wall_video(file);
  for (const auto& [name, search] : {std::pair("whole", tracking::Search::whole),
                                     std::pair("in parts", tracking::Search::parts)}) {
    const truth::VideoResult result = truth::measure_video(wall, decimate, search);
    std::printf(
        "video, %s: both tags in %d of %d frames, tracked %d, rms %.3f px, jitter %.3f mm, shown "
        "%.3f mm, off by %.3f px (%.3f)\n",
        name, result.with_both, result.frames, result.tracked, result.rms_px, 1e3 * result.jitter_m,
        1e3 * result.shown_jitter_m, result.shown_off_px, result.shown_worst_px);
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("The tracker's figures on ground truth sets (directories with a set.json)");
  std::vector<std::string> sets;
  double decimate = 1;
  app.add_option("SETDIR", sets)->check(CLI::ExistingDirectory);
  app.add_option("--decimate", decimate, "shrink the picture in which tags are looked for")
      ->check(CLI::Range(1.0, 8.0));
  bool in_parts = false;
  app.add_flag("--in-parts", in_parts, "search parts of the pictures, as live");
  std::string video;
  app.add_option("--video", video, "of the wall with tags 3 and 4")->check(CLI::ExistingFile);
  return previz::bench::run_program(app, argc, argv, [&] {
    for (const std::string& directory : sets) {
      const truth::TruthSet set = truth::load_truth_set(directory);
      set::Tracking settings = truth::tracking_settings(set);
      settings.decimate = decimate;
      report(set, settings, in_parts ? tracking::Search::parts : tracking::Search::whole);
    }
    if (!video.empty()) report_video(video, decimate);
  });
}
