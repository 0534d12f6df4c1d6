#include "daemon/model/pictures.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <set>

#include "daemon/calibrate/lens/source.hpp"
#include "daemon/model/views.hpp"
#include "daemon/output/png.hpp"
#include "daemon/tracking/tag_detector.hpp"
#include "drivers/error.hpp"
#include "drivers/plate.hpp"
#include "drivers/session/draft.hpp"
#include "drivers/session/files.hpp"

namespace previz::model {
namespace {

// So many pictures are looked at.
constexpr std::size_t most_examined = 150;
// Tags lie in one plane within so much.
constexpr double flat_m = 4e-3, flat_cos = 0.998;

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

std::string file_of(const std::string& name) {
  std::string file = name.ends_with(".png") ? name : name + ".png";
  std::ranges::replace(file, ' ', '_');
  return file;
}

// Groups of tags that lie in one plane.
std::vector<std::vector<int>> flat_groups(const std::vector<set::Tag>& tags) {
  std::vector<std::vector<int>> groups;
  std::set<int> used;
  for (const set::Tag& first : tags) {
    if (used.contains(first.id)) continue;
    std::vector<int>& group = groups.emplace_back();
    const glm::dvec3 normal(first.world_from_tag[2]), at(first.world_from_tag[3]);
    for (const set::Tag& tag : tags) {
      const glm::dvec3 its(tag.world_from_tag[2]), off = glm::dvec3(tag.world_from_tag[3]) - at;
      const bool is_flat =
          glm::dot(its, normal) > flat_cos && std::abs(glm::dot(off, normal)) < flat_m;
      if (!used.contains(tag.id) && is_flat) {
        group.push_back(tag.id);
        used.insert(tag.id);
      }
    }
  }
  return groups;
}

std::string parts_text(const std::vector<std::string>& names, const std::vector<set::Tag>& tags) {
  std::string text =
      "# The parts of the real scene, for previzd model; previzd(8), \"The model\", says what can "
      "be listed.\n"
      "# Mark the same corners in two pictures or more: pixels from the centre of the top left "
      "one.\n";
  for (const std::string& name : names)
    text += fmt::format(
        "\n[[picture]]\nfile = \"{}\"  # {}\n[picture.points]\n# crate_1 = [312.4, 200.1]\n", name,
        file_of(name));
  int number = 0;
  for (const std::vector<int>& group : flat_groups(tags))
    text += fmt::format("\n[[plane]]\nname = \"plane {}\"\ntags = [{}]\n", ++number,
                        fmt::join(group, ", "));
  text +=
      "\n# [[box]]\n# name = \"crate\"\n# on = \"plane 1\"\n# top = [\"crate_1\", \"crate_2\", "
      "\"crate_3\", \"\"]  # in order "
      "around\n";
  return text;
}

}  // namespace

void write_pictures(const std::filesystem::path& footage, const ObserverCalibration& camera,
                    const set::Tracking& tracking, const std::filesystem::path& folder,
                    std::ostream& out) {
  const std::filesystem::path parts = folder / "model.toml";
  if (std::filesystem::exists(parts))
    throw Error(parts.string() +
                ": already exists and may hold marks; name another folder, or delete the file");
  if (std::filesystem::weakly_canonical(folder) == std::filesystem::weakly_canonical(footage))
    throw Error(folder.string() + ": is the footage; name another folder for the pictures to mark");
  std::vector<std::string> names;
  const std::vector<Candidate> chosen = apart(candidates_of(footage, camera, tracking));
  session::make_folders(folder);
  const auto source = calibrate::open_source(footage, "observer");
  for (auto picture = source->next(); picture; picture = source->next()) {
    if (std::ranges::find(chosen, picture->name, &Candidate::name) == chosen.end()) continue;
    names.push_back(short_name(picture->name));
    output::write_png(folder / file_of(names.back()), to_plate(*picture->frame));
  }
  session::replace_file(parts, parts_text(names, tracking.tags));
  fmt::print(out, "{} pictures to mark points in, and {} to list them\n", names.size(),
             parts.string());
}

}  // namespace previz::model
