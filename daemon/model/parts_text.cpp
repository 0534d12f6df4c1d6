#include "daemon/model/parts_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <set>

#include "drivers/keys/value.hpp"

namespace previz::model {
namespace {

// Tags lie in one plane within so much.
constexpr double flat_m = 4e-3, flat_cos = 0.998;
// Who aims a camera at a corner does so within about this.
constexpr double aimed_px = 2;

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

std::string plane_name(std::size_t group) {
  return fmt::format("plane {}", group + 1);
}

std::string picture_file(const std::string& picture) {
  std::string file = picture.ends_with(".png") ? picture : picture + ".png";
  std::ranges::replace(file, ' ', '_');
  return file;
}

std::string parts_text(const std::vector<MarkedPicture>& pictures,
                       const std::vector<set::Tag>& tags, const std::vector<BoxPart>& boxes) {
  std::string text =
      "# The parts of the real scene, for previzd model; previzd(8), \"The model\", says what can "
      "be listed.\n"
      "# Mark the same corners in two pictures or more: pixels from the centre of the top left "
      "one.\n";
  const bool is_aimed = std::ranges::any_of(
      pictures, [](const MarkedPicture& picture) { return !picture.marks.empty(); });
  if (is_aimed)
    text += fmt::format("\n[marks]\naccuracy_px = {}  # of the marks made on the rig\n", aimed_px);
  for (const MarkedPicture& picture : pictures) text += text_of(picture);
  std::size_t group = 0;
  for (const std::vector<int>& ids : flat_groups(tags))
    text += fmt::format("\n[[plane]]\nname = {}\ntags = [{}]\n", codec::quote(plane_name(group++)),
                        fmt::join(ids, ", "));
  for (const BoxPart& box : boxes) text += text_of(box);
  if (boxes.empty())
    text +=
        "\n# [[box]]\n# name = \"crate\"\n# on = \"plane 1\"\n# top = [\"crate_1\", \"crate_2\", "
        "\"crate_3\", \"\"]  # in order around\n";
  return text;
}

}  // namespace previz::model
