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
  std::printf("%5s %-9s %-9s %9s %8s %8s %8s %9s %9s %7s %6s  %s\n", "frame", "status", "tags",
              "corner_px", "reproj", "vertex", "max", "rot_mrad", "trans_mm", "nees", "ms", "why");
  Mean corner, reprojection, vertex, nees, corner_chi, milliseconds;
  glm::dvec2 bias(0);
  double least_margin = HUGE_VAL;
  Mean shown, jitter, shown_jitter;
  int held = 0;
  for (const truth::TrackedFrame& row : measure_tracking(set, settings, search)) {
    held += row.held_s > 0;
    if (row.shown_px) shown.add(*row.shown_px);
    if (row.jitter_px) jitter.add(*row.jitter_px);
    if (row.shown_jitter_px) shown_jitter.add(*row.shown_jitter_px);
    Mean here;
    for (const truth::CornerError& tag : row.corners) {
      least_margin = std::min(least_margin, tag.margin);
      if (!tag.trouble.empty() || tag.error_px.size() < 4) continue;
      for (const glm::dvec2& e : tag.error_px) {
        here.add(glm::length(e));
        corner.add(glm::length(e));
        bias += e;
      }
      corner_chi.add(tag.chi_square / 8);
    }
    std::string tags;
    if (row.track.pose)
      for (int id : row.track.pose->tags) tags += (tags.empty() ? "" : ",") + std::to_string(id);
    std::printf("%5d %-9s %-9s %9.3f %8.3f %8.3f %8.3f %9.3f %9.3f %7.2f %6.1f  %s\n", row.index,
                to_string(row.track.status), tags.c_str(), here.mean(), row.reprojection_px,
                row.vertex_px, row.vertex_max_px, 1e3 * row.rotation_rad, 1e3 * row.translation_m,
                row.error_squared, row.milliseconds, row.track.reason.c_str());
    milliseconds.add(row.milliseconds);
    if (!row.track.pose) continue;
    reprojection.add(row.reprojection_px);
    vertex.add(row.vertex_px);
    nees.add(row.error_squared);
  }
  std::printf(
      "  tracked %d of %zu; mean (max) px: corner %.3f (%.3f), reprojection %.3f (%.3f), vertices "
      "%.3f (%.3f)\n  corner bias %+.3f %+.3f px, corner chi2/8 %.2f, pose nees/6 %.2f, least "
      "margin "
      "%.0f, %.1f ms a frame\n  shown live: vertices %.3f (%.3f), jitter %.3f px of %.3f, held "
      "%d\n\n",
      vertex.count, set.frames.size(), corner.mean(), corner.most, reprojection.mean(),
      reprojection.most, vertex.mean(), vertex.most, bias.x / std::max(1, corner.count),
      bias.y / std::max(1, corner.count), corner_chi.mean(), nees.mean() / 6, least_margin,
      milliseconds.mean(), shown.mean(), shown.most, shown_jitter.mean(), jitter.mean(), held);
}

void report_photographs(const std::filesystem::path& directory, double decimate) {
  const truth::RoomResult room = truth::measure_room(directory / "apriltag", decimate);
  std::printf(
      "room (%d photographs, decimate %g)\n  %d of %d listed tags (%.1f %%), %d false, least "
      "margin "
      "%.1f, corners refined %d, refused %d\n  tracked %d, ambiguous %d, lost %d; rms %.3f px, "
      "worst photograph %.3f; %d with several tags: rms %.3f px\n",
      room.photographs, decimate, room.found, room.listed, 100.0 * room.found / room.listed,
      room.false_ids, room.least_margin, room.refined, room.refused, room.tracked, room.ambiguous,
      room.lost, room.rms_px, room.worst_px, room.poses_of_several, room.several_rms_px);
  for (const std::string& s : room.missed) std::printf("  missed %s\n", s.c_str());
  for (const std::string& s : room.not_tracked) std::printf("  not tracked %s\n", s.c_str());
  for (const std::string& s : room.left_out) std::printf("  tracked without %s\n", s.c_str());

  const std::filesystem::path misc = directory / "apriltag" / "misc";
  for (const auto& [name, family] : {std::pair("36h11_stress_test.png", "tag36h11"),
                                     std::pair("phone_tag1_640_480.jpg", "tag36h11"),
                                     std::pair("negative_16h5_field2023.png", "tag36h11"),
                                     std::pair("negative_16h5_field2023.png", "tag16h5")}) {
    for (double margin : {0.0, 20.0}) {
      const truth::CountResult count = truth::count_tags(misc / name, family, margin);
      std::printf("%s as %s, margin >= %g: %d tags, margins %.1f to %.1f, refined %d\n", name,
                  family, margin, count.tags, count.least_margin, count.most_margin, count.refined);
    }
  }
  const truth::WallVideo wall =
      truth::read_wall_video(directory / "video" / "wall_tags3and4_1080p.mp4");
  for (const auto& [name, search] : {std::pair("whole", tracking::Search::whole),
                                     std::pair("in parts", tracking::Search::parts)}) {
    const truth::VideoResult video = truth::measure_video(wall, decimate, search);
    std::printf(
        "video, %s: both tags in %d of %d frames, tracked %d, ambiguous %d, rms %.3f px, jitter "
        "%.3f mm, shown %.3f mm, off by %.3f px (%.3f), %.0f ms a frame\n",
        name, video.with_both, video.frames, video.tracked, video.ambiguous, video.rms_px,
        1e3 * video.jitter_m, 1e3 * video.shown_jitter_m, video.shown_off_px, video.shown_worst_px,
        video.milliseconds);
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
  std::string photographs;
  app.add_option("--photographs", photographs, "folder with apriltag/ and video/")
      ->check(CLI::ExistingDirectory);
  return previz::bench::run_program(app, argc, argv, [&] {
    for (const std::string& directory : sets) {
      const truth::TruthSet set = truth::load_truth_set(directory);
      set::Tracking settings = truth::tracking_settings(set);
      settings.decimate = decimate;
      report(set, settings, in_parts ? tracking::Search::parts : tracking::Search::whole);
    }
    if (!photographs.empty()) report_photographs(photographs, decimate);
  });
}
