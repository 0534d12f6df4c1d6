#include "daemon/tools/model/parts_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <set>
#include <utility>

#include "daemon/core/session/marks.hpp"
#include "drivers/keys/value.hpp"

namespace previz::model {
namespace {

// Tags lie in one plane within so much.
constexpr double flat_m = 4e-3, flat_cos = 0.998;

std::string text_of(const MarkedPicture& picture) {
  std::string text = fmt::format("\n[[picture]]\nfile = {}  # {}\n[picture.points]\n",
                                 codec::quote(picture.name), picture_file(picture.name));
  if (picture.marks.empty()) return text + "# crate_1 = [312.4, 200.1]\n";
  for (const Mark& mark : picture.marks)
    text += fmt::format("{} = [{}, {}]\n", codec::quote(mark.point), mark.px.x, mark.px.y);
  return text;
}

std::string text_of(const BoxPart& box) {
  std::vector<std::string> corners;
  for (const std::string& corner : box.top) corners.push_back(codec::quote(corner));
  return fmt::format("\n[[box]]\nname = {}\non = {}\ntop = [{}]\n", codec::quote(box.name),
                     codec::quote(box.on), fmt::join(corners, ", "));
}

}  // namespace

std::vector<TagPlane> tag_planes(const std::vector<set::Tag>& tags) {
  std::vector<TagPlane> planes;
  std::set<int> used;
  for (const set::Tag& first : tags) {
    if (used.contains(first.id)) continue;
    TagPlane plane{fmt::format("plane {}", planes.size() + 1), {}};
    const glm::dvec3 normal(first.world_from_tag[2]), at(first.world_from_tag[3]);
    for (const set::Tag& tag : tags) {
      const glm::dvec3 its(tag.world_from_tag[2]), off = glm::dvec3(tag.world_from_tag[3]) - at;
      const bool is_flat =
          glm::dot(its, normal) > flat_cos && std::abs(glm::dot(off, normal)) < flat_m;
      if (used.contains(tag.id) || !is_flat) continue;
      plane.tags.push_back(tag.id);
      used.insert(tag.id);
    }
    planes.push_back(std::move(plane));
  }
  return planes;
}

std::string picture_file(const std::string& picture) {
  std::string file = picture.ends_with(".png") ? picture : picture + ".png";
  std::ranges::replace(file, ' ', '_');
  return file;
}

std::string parts_text(const std::vector<MarkedPicture>& pictures,
                       const std::vector<TagPlane>& planes, const std::vector<BoxPart>& boxes) {
  std::string text =
      "# The parts of the real scene, for previz model; previzd(8), \"The model\", says what can "
      "be listed.\n"
      "# Mark the same corners in two pictures or more: pixels from the centre of the top left "
      "one.\n";
  const bool is_aimed = std::ranges::any_of(
      pictures, [](const MarkedPicture& picture) { return !picture.marks.empty(); });
  if (is_aimed)
    text += fmt::format("\n[marks]\naccuracy_px = {}  # as they were made by aiming the camera\n",
                        session::aimed_px);
  for (const MarkedPicture& picture : pictures) text += text_of(picture);
  for (const TagPlane& plane : planes)
    text += fmt::format("\n[[plane]]\nname = {}\ntags = [{}]\n", codec::quote(plane.name),
                        fmt::join(plane.tags, ", "));
  for (const BoxPart& box : boxes) text += text_of(box);
  if (boxes.empty())
    text +=
        "\n# [[box]]\n# name = \"crate\"\n# on = \"plane 1\"\n# top = [\"crate_1\", \"crate_2\", "
        "\"crate_3\", \"\"]  # in order around\n";
  return text;
}

}  // namespace previz::model
