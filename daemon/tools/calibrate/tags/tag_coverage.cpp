#include <fmt/format.h>

#include <algorithm>
#include <glm/geometric.hpp>

#include "daemon/core/tracking/tag_map.hpp"
#include "daemon/tools/calibrate/lens/report.hpp"
#include "daemon/tools/calibrate/tags/moved_tags.hpp"
#include "daemon/tools/calibrate/tags/tag_survey.hpp"

namespace previz::calibrate {
namespace {

constexpr int least_pictures_of_tag = 4;
constexpr std::size_t least_tags_of_chain = 3;
constexpr double least_views_of_tag = 20 * degree;
constexpr double certain_m = 2e-3, certain_share = 1e-3, certain_rad = 0.5 * degree;

void miss_unseen(const TagSurvey& survey, const std::vector<int>& wanted,
                 std::vector<std::string>& missing) {
  std::vector<int> unseen;
  for (const int id : wanted) {
    const bool placed = std::ranges::find(survey.tags, id, &SurveyedTag::id) != survey.tags.end();
    const bool moved = std::ranges::find(survey.moved, id, &MovedTag::id) != survey.moved.end();
    const bool apart = std::ranges::any_of(survey.apart, [id](const std::vector<int>& group) {
      return std::ranges::find(group, id) != group.end();
    });
    if (!placed && !moved && !apart) unseen.push_back(id);
  }
  if (!unseen.empty())
    missing.push_back(tracking::tags_in_words(unseen) +
                      ", together with another tag: they are in the set file, but in no "
                      "picture");
}

void miss_links(const TagSurvey& survey, int origin, std::vector<std::string>& missing) {
  for (const std::vector<int>& group : survey.apart)
    missing.push_back(tracking::tags_in_words(group) +
                      " together with others: step back, or add a tag halfway, until a picture "
                      "shows one of them and one already linked to tag " +
                      std::to_string(origin));
}

void miss_moved(const TagSurvey& survey, std::vector<std::string>& missing) {
  for (const MovedTag& moved : survey.moved)
    missing.push_back("tag " + std::to_string(moved.id) +
                      " again, once it is fixed in place: " + words_of(moved));
}

bool is_certain(const SurveyedTag& tag, double from_origin_m, double share = 1) {
  return tag.position_sigma_m <= share * (certain_m + certain_share * from_origin_m) &&
         tag.rotation_sigma_rad <= share * certain_rad;
}

// Adds what a single tag lacks; returns whether that is nothing. What few views cannot show, a lens
// that is a little off or paper that is bent, moves a tag by the same lever as noise does, and may
// be larger: where noise leaves a third of what is allowed, few views do.
bool miss_of_tag(const SurveyedTag& tag, double from_origin_m, std::vector<std::string>& missing) {
  const std::string name = "tag " + std::to_string(tag.id);
  const std::size_t before = missing.size();
  if (tag.pictures < least_pictures_of_tag)
    missing.push_back(
        fmt::format("{} in more pictures: {} are usable, {} are needed and 10 are "
                    "recommended",
                    name, tag.pictures, least_pictures_of_tag));
  else if (tag.views_rad < least_views_of_tag && !is_certain(tag, from_origin_m, 1.0 / 3))
    missing.push_back(
        fmt::format("{} from further to the side: walk around it; its pictures span only {:.0f} "
                    "degrees, at least {:.0f} are needed",
                    name, tag.views_rad / degree, least_views_of_tag / degree));
  return missing.size() == before;
}

void miss_certainty(const TagSurvey& survey, const std::vector<const SurveyedTag*>& uncertain,
                    std::vector<std::string>& missing) {
  if (uncertain.size() >= least_tags_of_chain && 2 * survey.pictures_of_pairs > survey.pictures) {
    std::vector<int> ids;
    for (const SurveyedTag* tag : uncertain) ids.push_back(tag->id);
    const SurveyedTag& worst =
        **std::ranges::max_element(uncertain, {}, &SurveyedTag::position_sigma_m);
    missing.push_back(fmt::format(
        "three tags or more in a picture: {} of {} pictures show two only, and a chain of pairs "
        "bends ({} are not certain; tag {}, the worst, to {:.0f} mm and {:.1f} degrees): film from "
        "farther away or put up more tags; if only the scale must be certain, measure the distance "
        "between two tags that are far apart and give it with --distance",
        survey.pictures_of_pairs, survey.pictures, tracking::tags_in_words(ids), worst.id,
        1000 * worst.position_sigma_m, worst.rotation_sigma_rad / degree));
    return;
  }
  for (const SurveyedTag* tag : uncertain)
    missing.push_back(fmt::format(
        "tag {} from closer, with others beside it: accurate only to {:.1f} mm and {:.2f} "
        "degrees",
        tag->id, 1000 * tag->position_sigma_m, tag->rotation_sigma_rad / degree));
}

}  // namespace

std::vector<std::string> missing_of_tags(const TagSurvey& survey, const std::vector<int>& wanted,
                                         int origin) {
  std::vector<std::string> missing;
  miss_unseen(survey, wanted, missing);
  miss_links(survey, origin, missing);
  miss_moved(survey, missing);
  const auto at_origin = std::ranges::find(survey.tags, origin, &SurveyedTag::id);
  std::vector<const SurveyedTag*> uncertain;
  for (const SurveyedTag& tag : survey.tags) {
    if (tag.id == origin) continue;
    const double away = at_origin == survey.tags.end()
                            ? 0
                            : glm::distance(glm::dvec3(tag.world_from_tag[3]),
                                            glm::dvec3(at_origin->world_from_tag[3]));
    if (miss_of_tag(tag, away, missing) && !is_certain(tag, away)) uncertain.push_back(&tag);
  }
  miss_certainty(survey, uncertain, missing);
  return missing;
}

}  // namespace previz::calibrate
