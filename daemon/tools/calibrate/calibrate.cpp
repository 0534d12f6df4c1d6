#include "daemon/tools/calibrate/calibrate.hpp"

#include <fmt/ostream.h>

#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/set/file_edit.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/core/set/print.hpp"
#include "daemon/tools/calibrate/known_camera.hpp"
#include "daemon/tools/calibrate/lens/board_guess.hpp"
#include "daemon/tools/calibrate/lens/coverage.hpp"
#include "daemon/tools/calibrate/lens/fisheye.hpp"
#include "daemon/tools/calibrate/lens/lens_prior.hpp"
#include "daemon/tools/calibrate/lens/light_pose.hpp"
#include "daemon/tools/calibrate/lens/observer.hpp"
#include "daemon/tools/calibrate/lens/report.hpp"
#include "daemon/tools/calibrate/lens/residual_plot.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

Views gather(const LensOptions& options, const std::string& stream, const KnownLens& lens,
             std::ostream& out) {
  const Board board = parse_board(options.board);
  const auto source = open_source(options.footage, stream);
  const auto finder = make_board_finder(board, response_of(options.footage, stream), lens);
  GatherOptions gathering;
  gathering.every = options.every;
  gathering.response = response_of(options.footage, stream);
  Views views = gather_views(*source, *finder, board, gathering,
                             [&](const std::string& line) { out << line << '\n'; });
  // A second pass, through the lens that the first one found, sees the same board.
  const bool is_first = std::holds_alternative<std::monostate>(lens);
  if (const std::string form = finder->form(); is_first && !form.empty()) out << form << '\n';
  for (const std::string& note : source->notes()) out << note << '\n';
  return views;
}

// A board that is a part of the one in the pictures is found at random places, or hardly ever: its
// fit fails, is off by pixels, or has few views. Calls `fit` and names the board that they hold.
template <class Fit>
auto fitted(const Views& views, const LensOptions& options, const std::string& stream,
            std::ostream& out, Fit fit) {
  constexpr double bad_px = 3;
  constexpr std::size_t few_views = 5;
  const auto other = [&] {
    return other_board(views.sampled, parse_board(options.board),
                       response_of(options.footage, stream));
  };
  try {
    auto found = fit(views);
    if (found.fit.rms_all_px > bad_px || views.views.size() < few_views)
      if (const std::string words = other(); !words.empty()) out << "WARNING: " << words << '\n';
    return found;
  } catch (const Error& error) {
    if (const std::string words = other(); !words.empty())
      throw Error(std::string(error.what()) + "; " + words);
    throw;
  }
}

// Gathers the views and fits a lens to them by `fit`, once more through the lens that was found
// where the board needs it. Leaves the views that the fit is of in `views`.
template <class Fit>
auto fit_of_passes(const LensOptions& options, const std::string& stream, Views& views,
                   std::ostream& out, Fit fit) {
  views = gather(options, stream, {}, out);
  auto found = fitted(views, options, stream, out, fit);
  if (needs_lens(parse_board(options.board))) {
    out << "second pass, with the lens found:\n";
    views = gather(options, stream, found.intrinsics, out);
    found = fit(views);
  }
  return found;
}

void plot(const LensOptions& options, const Views& views, const BundleFit& fit,
          const std::vector<UncertainPixel>& picture, std::ostream& out) {
  if (!options.residual_plot) return;
  session::replace_file(*options.residual_plot,
                        residual_plot_svg(views, fit, picture, options.footage.string()));
  out << "residual plot: " << options.residual_plot->string() << '\n';
}

// Returns the lens's table, under a comment about what it lacks.
std::string calibrate_fisheye(const LightOptions& options, LightCameraCalibration& camera,
                              std::ostream& out) {
  Views views;
  const FisheyeFit fisheye = fit_of_passes(options, "light", views, out, fit_fisheye);
  print_fit(views, fisheye.fit, fisheye_parameters, fisheye.picture, out);
  fmt::print(out, "widest corner {:.1f} degrees off axis; valid to {:.1f} degrees\n",
             fisheye.widest_corner_rad / degree, fisheye.intrinsics.max_angle_rad / degree);
  plot(options, views, fisheye.fit, fisheye.picture, out);
  camera.intrinsics = fisheye.intrinsics;
  return insist(missing_views(views, fisheye), options.force, out) + set::intrinsics_toml(camera) +
         "\n";
}

// Replaces a fit by one with as few parameters as little footage determines.
void fit_by_few(const Views& views, ObserverFit& observer, std::ostream& out) {
  observer = fit_observer_by_few(views);
  out << "too few views for more than one focal length and one distortion coefficient; with "
         "only these two:\n";
  print_fit(views, observer.fit, few_observer_parameters, observer.picture, out);
  if (const std::string why = why_useless(observer); !why.empty()) throw Error(why);
}

std::string pose_by_tags(const LightOptions& options, const set::Set& set,
                         const LightCameraCalibration& camera, std::ostream& out) {
  const auto source = open_source(options.footage, "light");
  const LightPose pose = find_light_pose(*source, camera.intrinsics, camera.response, set.tracking);
  fmt::print(out,
             "pose from tags {} in {} pictures: rms {:.3f} px; accurate to {:.1f} mm and {:.2f} "
             "degrees{}\n",
             fmt::join(pose.tags, ", "), pose.pictures, pose.rms_px, 1000 * pose.position_sigma_m,
             pose.rotation_sigma_rad / degree,
             pose.left_out.empty() ? ""
                                   : fmt::format("; not where the set file says: {}",
                                                 fmt::join(pose.left_out, ", ")));
  return set::light_pose_toml(pose.world_from_camera);
}

// Returns the table by which calibrate tags refines the lens; empty if the views do not hold all of
// its coefficients together.
std::string statistics_of(const ObserverFit& observer) {
  if (observer.whole_lens.empty()) return "";
  return "\n" + set::lens_fit_toml(lens_fit_table(LensVector(observer.whole_lens.data()),
                                                  LensMatrix(observer.whole_covariance.data())));
}

constexpr auto pose_by_hand =
    "# Its pose: fill in by hand, or use calibrate light --tags SET:\n"
    "#[light_camera.pose]\n"
    "#position_m = [0.0, 0.0, 0.0]\n"
    "#rotation_deg = [0.0, 0.0, 0.0]  # zeros: looks straight up, picture bottom is +Y\n";

}  // namespace

void calibrate_observer(const LensOptions& options, std::ostream& out) {
  if (options.write && !options.set_file)
    throw Error("--write needs --set: it changes that set file");
  Views views;
  ObserverFit observer = fit_of_passes(options, "observer", views, out, fit_observer);
  print_fit(views, observer.fit, observer.parameters, observer.picture, out);
  if (!observer.left_out.empty())
    fmt::print(out, "left at 0, because the corners do not hold {}: {}\n",
               observer.left_out.size() == 1 ? "it" : "them", fmt::join(observer.left_out, ", "));
  plot(options, views, observer.fit, observer.picture, out);
  std::string doubts = insist(missing_views(views, observer), options.force, out);
  if (has_few_views(views, observer)) fit_by_few(views, observer, out);
  if (doubts.empty()) doubts = warn(doubts_of(observer), out);
  ObserverCalibration calibration;
  calibration.intrinsics = observer.intrinsics;
  const std::string lens = set::intrinsics_toml(calibration), fit = statistics_of(observer);
  if (!options.write) return write_tables(doubts + lens + fit, options.table_file, out);
  std::string text = set::with_table(set::read_set_file(*options.set_file), "observer.intrinsics",
                                     doubts + lens, /*whole=*/true);
  if (!fit.empty()) text = set::with_table(text, "observer.lens_fit", fit, /*whole=*/true);
  set::parse_set(text, *options.set_file);
  write_back(*options.set_file, text, out);
}

void calibrate_light(const LightOptions& options, std::ostream& out) {
  if (options.board.empty() && !options.tags_set)
    throw Error("nothing to calibrate: give --board for the lens, --tags for the pose, or both");
  std::string tables;
  std::optional<set::Set> set;
  if (options.tags_set) set = set::load_set(*options.tags_set);
  LightCameraCalibration camera;
  camera.response = response_of(options.footage, "light");
  if (options.board.empty()) {
    camera = known_light_camera(*set, options.footage);
  } else {
    tables = calibrate_fisheye(options, camera, out);
  }
  tables += set ? pose_by_tags(options, *set, camera, out) : pose_by_hand;
  write_tables(tables, options.table_file, out);
}

}  // namespace previz::calibrate
