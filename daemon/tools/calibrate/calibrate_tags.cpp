#include <fmt/ostream.h>

#include <algorithm>
#include <charconv>
#include <glm/geometric.hpp>

#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/set/file_edit.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/tools/calibrate/calibrate.hpp"
#include "daemon/tools/calibrate/known_camera.hpp"
#include "daemon/tools/calibrate/lens/length.hpp"
#include "daemon/tools/calibrate/lens/report.hpp"
#include "daemon/tools/calibrate/tags/moved_tags.hpp"
#include "daemon/tools/calibrate/tags/tag_lens.hpp"
#include "daemon/tools/calibrate/tags/tag_survey.hpp"
#include "daemon/tools/calibrate/tags/tag_tables.hpp"
#include "daemon/tools/calibrate/tags/tag_walk.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

constexpr double worth_a_word_m = 1e-3, worth_a_word_of_size = 2e-3;

// "0-3:1.234m"
StatedDistance parse_distance(const std::string& text) {
  StatedDistance stated;
  const char* const end = text.data() + text.size();
  const auto a = std::from_chars(text.data(), end, stated.a);
  if (a.ec == std::errc{} && a.ptr != end && *a.ptr == '-') {
    const auto b = std::from_chars(a.ptr + 1, end, stated.b);
    if (b.ec == std::errc{} && b.ptr != end && *b.ptr == ':' && stated.a != stated.b)
      if (const auto metres = parse_length({b.ptr + 1, std::size_t(end - b.ptr - 1)})) {
        stated.metres = *metres;
        return stated;
      }
  }
  throw Error("distance \"" + text +
              "\" is not valid; allowed: 0-3:1.234m, from centre of tag 0 to centre of tag 3, in "
              "mm, cm, m or in");
}

WalkOptions walk_options(const TagsOptions& options, const set::Set& set) {
  WalkOptions walk;
  walk.detector = {options.family.empty() ? set.tracking.family : options.family,
                   set.tracking.min_margin, set.tracking.max_hamming};
  walk.every = options.every;
  for (const set::Tag& tag : set.tracking.tags) walk.sizes.by_id_m[tag.id] = tag.size_m;
  const TagSizes given = parse_tag_sizes(options.sizes);
  walk.sizes.common_m = given.common_m;
  for (const auto& [id, size] : given.by_id_m) walk.sizes.by_id_m[id] = size;
  for (const set::Carrier& carrier : set.tracking.carriers)
    for (const set::Tag& tag : carrier.tags) walk.left_out.push_back(tag.id);
  return walk;
}

TagSurveyOptions survey_options(const TagsOptions& options, const set::Set& set,
                                const TagWalk& walk) {
  TagSurveyOptions survey;
  if (!options.distance.empty()) survey.stated = parse_distance(options.distance);
  const auto in_set = std::ranges::find_if(set.tracking.tags, [&](const set::Tag& tag) {
    return options.origin ? tag.id == *options.origin
                          : std::ranges::find(walk.ids, tag.id) != walk.ids.end();
  });
  const bool known = in_set != set.tracking.tags.end();
  survey.origin = options.origin.value_or(known ? in_set->id : walk.ids.front());
  if (known) survey.world_from_origin = in_set->world_from_tag;
  return survey;
}

void print_sizes(const TagSurvey& survey, std::ostream& out) {
  for (const SurveyedTag& tag : survey.tags) {
    const double size_m = tag.size_m / survey.size_factor;
    if (std::abs(size_m / tag.stated_size_m - 1) > 1e-9)
      fmt::print(
          out,
          "tag {} measures {:.2f} mm (accurate to {:.2f} mm) relative to the others, not {:.2f} mm "
          "as given: using the measured size\n",
          tag.id, 1000 * size_m, 1000 * tag.size_sigma * size_m, 1000 * tag.stated_size_m);
  }
  if (std::abs(survey.size_factor - 1) > worth_a_word_of_size)
    fmt::print(out,
               "by the given distance all tags are {:.2f} % of their given size; were they "
               "printed at 100 %?\n",
               100 * survey.size_factor);
}

void print_survey(const TagSurvey& survey, const set::Set& set, std::ostream& out) {
  for (const SurveyedTag& tag : survey.tags) {
    fmt::print(out, "  tag {}: {} pictures spanning {:.0f} degrees, rms {:.3f} px", tag.id,
               tag.pictures, tag.views_rad / degree, tag.rms_px);
    if (tag.position_sigma_m > 0)
      fmt::print(out, "; accurate to {:.2f} mm, {:.3f} degrees", 1000 * tag.position_sigma_m,
                 tag.rotation_sigma_rad / degree);
    const auto before = std::ranges::find(set.tracking.tags, tag.id, &set::Tag::id);
    if (before != set.tracking.tags.end()) {
      const double moved_m =
          glm::distance(glm::dvec3(before->world_from_tag[3]), glm::dvec3(tag.world_from_tag[3]));
      if (moved_m > worth_a_word_m)
        fmt::print(out, "; {:.1f} mm from its place in the set file", 1000 * moved_m);
    }
    out << '\n';
  }
  fmt::print(out,
             "rms {:.3f} px over {} tags in {} pictures; {} of {} sightings rejected; beyond the "
             "pictures' noise, corners are off by {:.3f} px\n",
             survey.rms_px, survey.tags.size(), survey.pictures,
             survey.sightings - survey.sightings_used, survey.sightings, survey.model_error_px);
  print_sizes(survey, out);
  for (const MovedTag& moved : survey.moved)
    fmt::print(out, "tag {} did not stay in place and is ignored: {}\n", moved.id, words_of(moved));
}

void print_refined(const RefinedLens& refined, std::ostream& out) {
  if (!refined.is_refined) return fmt::print(out, "the lens is not changed: {}\n", refined.why_not);
  fmt::print(
      out,
      "the lens is refined by boards and tags together: rms {:.3f} px, {}; it moves by {:.2f} "
      "px in the corner of the picture, and is accurate to {:.3f} px at worst ({:.3f} px by "
      "the boards alone)\n",
      refined.survey.rms_px,
      refined.rms_before_px > 0 ? fmt::format("before {:.3f} px", refined.rms_before_px)
                                : "before no map fitted the pictures",
      refined.corner_moved_px, refined.sigma_px, refined.sigma_before_px);
  if (refined.boards_factor > 1)
    fmt::print(out,
               "warning: tags and boards disagree about the lens by more than their noise, "
               "so the boards count for less (deviations times {:.1f}): check that zoom and focus "
               "are the same, boards and tags flat, and tags as large as given\n",
               std::sqrt(refined.boards_factor));
}

// Refines the lens where the set has the statistics of its boards.
TagSurvey surveyed_with_lens(const TagWalk& walk, const PinholeIntrinsics& lens,
                             const set::Set& set, const TagSurveyOptions& how, std::ostream& out) {
  const set::LensFit& table = set.observer.lens_fit;
  std::string why_not =
      table.values.empty()
          ? "the set has no [observer.lens_fit], which calibrate observer prints; the accuracy of "
            "the lens is unknown"
          : why_not_of(lens_prior(table), lens);
  if (!why_not.empty()) {
    if (!table.values.empty())
      why_not = "[observer.lens_fit] is not of [observer.intrinsics]: " + why_not;
    fmt::print(out, "the lens is not changed: {}\n", why_not);
    return survey_tags(walk, lens, how);
  }
  const RefinedLens refined = survey_tags_and_lens(walk, lens, how, lens_prior(table));
  print_refined(refined, out);
  return refined.survey;
}

}  // namespace

void calibrate_tags(const TagsOptions& options, std::ostream& out) {
  if (options.write && !options.set_file)
    throw Error("--write needs --set: it changes that set file");
  set::Set set;
  if (options.set_file) set = set::load_set(*options.set_file);
  const ObserverCalibration camera = known_observer(options.set_file, options.footage);
  const auto source = open_source(options.footage, "observer");
  const TagWalk walk =
      gather_walk(*source, camera.intrinsics, camera.response, walk_options(options, set),
                  [&](const std::string& line) { out << line << '\n'; });
  const TagSurveyOptions how = survey_options(options, set, walk);
  const TagSurvey survey = surveyed_with_lens(walk, camera.intrinsics, set, how, out);
  print_survey(survey, set, out);
  std::vector<int> wanted;
  for (const set::Tag& tag : set.tracking.tags) wanted.push_back(tag.id);
  const std::string doubts =
      insist(missing_of_tags(survey, wanted, how.origin), options.force, out);
  if (options.write) {
    const std::string text =
        with_lens(with_tags(set::read_set_file(*options.set_file), survey, doubts),
                  camera.intrinsics, survey.lens);
    set::parse_set(text, *options.set_file);
    write_back(*options.set_file, text, out);
  }
  write_tables(lens_table(camera.intrinsics, survey.lens) + doubts + tag_tables(survey),
               options.table_file, out);
}

}  // namespace previz::calibrate
