#include "daemon/tools/calibrate/tags/tag_tables.hpp"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <sstream>

#include "daemon/core/pipeline/edits.hpp"
#include "daemon/core/set/file_edit.hpp"
#include "daemon/core/set/print.hpp"
#include "daemon/core/tracking/pose_starts.hpp"
#include "daemon/tools/calibrate/lens/observer.hpp"
#include "daemon/tools/calibrate/lens/report.hpp"
#include "drivers/keys/value.hpp"

namespace previz::calibrate {
namespace {

constexpr double steps_of_a_metre = 1e6, steps_of_a_degree = 1e4, steps_of_a_number = 1e9;

std::string toml_number(double value, double steps) {
  return codec::print_number(std::round(value * steps) / steps + 0.0);
}

std::string toml_vector(const glm::dvec3& v, double steps) {
  return '[' + toml_number(v.x, steps) + ", " + toml_number(v.y, steps) + ", " +
         toml_number(v.z, steps) + ']';
}

std::string size_text(const SurveyedTag& tag) {
  return toml_number(tag.size_m, steps_of_a_metre);
}

std::string position_text(const SurveyedTag& tag) {
  return toml_vector(glm::dvec3(tag.world_from_tag[3]), steps_of_a_metre);
}

std::string rotation_text(const SurveyedTag& tag) {
  return toml_vector(pipeline::angles_of(glm::dmat3(tag.world_from_tag)) / degree,
                     steps_of_a_degree);
}

std::string corners_text(const SurveyedTag& tag) {
  std::string text = "[";
  for (std::size_t i = 0; i < 4; ++i)
    text += (i ? ", " : "") +
            toml_vector(
                glm::dvec3(tag.world_from_tag * glm::dvec4(tracking::tag_corner(tag.size_m, i), 1)),
                steps_of_a_metre);
  return text + ']';
}

std::string matrix_text(const SurveyedTag& tag) {
  std::string text = "[";
  for (int row = 0; row < 4; ++row) {
    text += row ? ", [" : "[";
    for (int column = 0; column < 4; ++column)
      text +=
          (column ? ", " : "") + toml_number(tag.world_from_tag[column][row],
                                             column == 3 ? steps_of_a_metre : steps_of_a_number);
    text += ']';
  }
  return text + ']';
}

std::string tag_table(const SurveyedTag& tag) {
  return fmt::format("[[tag]]\nid = {}\nsize_m = {}\nposition_m = {}\nrotation_deg = {}\n", tag.id,
                     size_text(tag), position_text(tag), rotation_text(tag));
}

void put_tag(const SurveyedTag& tag, std::size_t index, set::FileEdit& file) {
  if (file.has("tag", index, "corners_m")) {  // which say the size, too
    if (file.has("tag", index, "size_m")) file.put("tag", index, "size_m", size_text(tag));
    return file.put("tag", index, "corners_m", corners_text(tag));
  }
  file.put("tag", index, "size_m", size_text(tag));
  if (file.has("tag", index, "world_from_tag"))
    return file.put("tag", index, "world_from_tag", matrix_text(tag));
  file.put("tag", index, "position_m", position_text(tag));
  file.put("tag", index, "rotation_deg", rotation_text(tag));
}

// Puts the comment before the first [[tag]] table, and takes away that of an earlier calibration.
std::string with_doubts(const std::string& text, const std::string& doubts) {
  std::istringstream lines(text);
  std::string result;
  bool is_old = false, is_written = false;
  for (std::string line; std::getline(lines, line);) {
    is_old = line.starts_with(fmt::format("# {}", not_to_be_relied_on)) ||
             (is_old && line.starts_with('#'));
    if (is_old) continue;
    if (!is_written && line.starts_with("[[tag]]")) {
      result += doubts;
      is_written = true;
    }
    result += line + "\n";
  }
  if (!text.ends_with('\n') && !result.empty()) result.pop_back();
  return result;
}

}  // namespace

std::string tag_tables(const TagSurvey& survey) {
  std::string text;
  for (const SurveyedTag& tag : survey.tags) {
    if (!text.empty()) text += '\n';
    text += tag.position_sigma_m > 0
                ? fmt::format("# accurate to {:.2f} mm, {:.3f} degrees, from {} pictures\n",
                              1000 * tag.position_sigma_m, tag.rotation_sigma_rad / degree,
                              tag.pictures)
                : fmt::format("# defines the world; in {} pictures\n", tag.pictures);
    text += tag_table(tag);
  }
  return text;
}

std::string with_tags(const std::string& text, const TagSurvey& survey, const std::string& doubts) {
  set::FileEdit file(text);
  std::map<std::string, std::size_t> tables;
  for (std::size_t i = 0; i < file.count("tag"); ++i)
    if (const auto id = file.written("tag", i, "id")) tables[*id] = i;
  for (const SurveyedTag& tag : survey.tags) {
    const auto known = tables.find(std::to_string(tag.id));
    if (known == tables.end())
      file.append(tag_table(tag));
    else
      put_tag(tag, known->second, file);
  }
  return with_doubts(file.text(), doubts);
}

std::string lens_table(const PinholeIntrinsics& before, const PinholeIntrinsics& after) {
  if (lens_vector(before) == lens_vector(after)) return "";
  ObserverCalibration camera;
  camera.intrinsics = after;
  return "# refined by the tags\n" + set::intrinsics_toml(camera) + "\n";
}

std::string with_lens(const std::string& text, const PinholeIntrinsics& before,
                      const PinholeIntrinsics& after) {
  if (lens_vector(before) == lens_vector(after)) return text;
  set::FileEdit file(text);
  const LensVector values = lens_vector(after);
  for (int i = 0; i < lens_size; ++i) {
    const char* const key = observer_parameters[std::size_t(i)];
    if (values[i] != 0 || file.has("observer.intrinsics", 0, key))
      file.put("observer.intrinsics", 0, key, codec::print_number(values[i]));
  }
  return file.text();
}

}  // namespace previz::calibrate
