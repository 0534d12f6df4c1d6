#include "daemon/tools/model/pictures.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "daemon/core/output/png.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/tracking/tag_detector.hpp"
#include "daemon/tools/calibrate/lens/source.hpp"
#include "daemon/tools/model/parts_text.hpp"
#include "daemon/tools/model/rig_marks.hpp"
#include "daemon/tools/model/views.hpp"
#include "drivers/error.hpp"
#include "drivers/plate.hpp"

namespace previz::model {
namespace {

// So many pictures are looked at.
constexpr std::size_t most_examined = 150;

// A picture that shows tags, and where its camera stood.
struct Candidate {
  std::string name;
  glm::dvec3 eye{0}, forward{0};
};

// Returns how different two views are: a metre aside counts as much as a turn by half a radian.
double distance_between(const Candidate& a, const Candidate& b) {
  return glm::distance(a.eye, b.eye) + 2 * glm::distance(a.forward, b.forward);
}

std::vector<Candidate> candidates_of(const std::filesystem::path& footage,
                                     const ObserverCalibration& camera,
                                     const set::Tracking& tracking) {
  const auto source = calibrate::open_source(footage, "observer");
  const std::size_t every =
      std::max<std::size_t>(1, source->count().value_or(most_examined) / most_examined);
  tracking::TagDetector detector({tracking.family, tracking.min_margin, tracking.max_hamming},
                                 camera.intrinsics, camera.response);
  std::vector<Candidate> candidates;
  std::size_t index = 0;
  for (auto picture = source->next(); picture; picture = source->next()) {
    if (index++ % every) continue;
    insist_on_size(*picture->frame, camera.intrinsics, picture->name);
    const auto pose =
        pose_by_tags(detector.detect(*picture->frame, 1), camera.intrinsics, tracking);
    if (!pose) continue;
    const glm::dmat4 place = tracking::world_from_camera(pose->pose);
    candidates.push_back({picture->name, glm::dvec3(place[3]), glm::dvec3(place[2])});
  }
  if (candidates.empty())
    throw Error(fmt::format("{}: none of the {} pictures shows tags of the set that fit together",
                            footage.string(), index));
  return candidates;
}

// Returns those that are farthest apart, the first one first (Gonzalez 1985), in the order of the
// footage.
std::vector<Candidate> apart(const std::vector<Candidate>& all) {
  std::vector<std::size_t> chosen = {0};
  while (chosen.size() < std::min<std::size_t>(most_pictures, all.size())) {
    std::size_t farthest = 0;
    double most = -1;
    for (std::size_t i = 0; i < all.size(); ++i) {
      double nearest = 1e9;
      for (const std::size_t c : chosen)
        nearest = std::min(nearest, distance_between(all[i], all[c]));
      if (nearest > most) {
        most = nearest;
        farthest = i;
      }
    }
    if (!(most > 1e-3)) break;
    chosen.push_back(farthest);
  }
  std::ranges::sort(chosen);
  std::vector<Candidate> result;
  for (const std::size_t c : chosen) result.push_back(all[c]);
  return result;
}

}  // namespace

std::vector<std::string> pictures_apart(const std::filesystem::path& footage,
                                        const ObserverCalibration& camera,
                                        const set::Tracking& tracking) {
  std::vector<std::string> names;
  for (const Candidate& candidate : apart(candidates_of(footage, camera, tracking)))
    names.push_back(short_name(candidate.name));
  return names;
}

void write_pictures(const std::filesystem::path& footage, const ObserverCalibration& camera,
                    const set::Tracking& tracking, const std::filesystem::path& folder,
                    std::ostream& out) {
  const std::filesystem::path parts = folder / "model.toml";
  if (std::filesystem::exists(parts))
    throw Error(parts.string() +
                ": already exists and may hold marks; name another folder, or delete the file");
  if (std::filesystem::weakly_canonical(folder) == std::filesystem::weakly_canonical(footage))
    throw Error(folder.string() + ": is the footage; name another folder for the pictures to mark");
  const RigMarks marks = rig_marks(footage, camera, tracking);
  const std::vector<MarkedPicture> pictures =
      with_marks(pictures_apart(footage, camera, tracking), marks);
  const MarkedBoxes marked = boxes_of(marks, tracking.tags, footage);
  for (const auto* remarks : {&marks.missing, &marked.remarks})
    for (const std::string& remark : *remarks) fmt::print(out, "{}\n", remark);
  session::make_folders(folder);
  const auto source = calibrate::open_source(footage, "observer");
  for (auto picture = source->next(); picture; picture = source->next()) {
    const std::string name = short_name(picture->name);
    if (std::ranges::find(pictures, name, &MarkedPicture::name) != pictures.end())
      output::write_png(folder / picture_file(name), to_plate(*picture->frame));
  }
  session::replace_file(parts, parts_text(pictures, tag_planes(tracking.tags), marked.boxes));
  fmt::print(out, "{} pictures to mark points in, and {} to list them\n", pictures.size(),
             parts.string());
}

}  // namespace previz::model
