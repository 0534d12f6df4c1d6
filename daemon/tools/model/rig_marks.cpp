#include "daemon/tools/model/rig_marks.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <optional>
#include <utility>

#include "daemon/core/session/marks.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/core/set/check.hpp"
#include "daemon/core/tracking/tag_detector.hpp"
#include "daemon/tools/calibrate/lens/source.hpp"
#include "daemon/tools/model/fit.hpp"
#include "daemon/tools/model/parts_text.hpp"
#include "daemon/tools/model/start.hpp"
#include "drivers/error.hpp"

namespace previz::model {
namespace {

// The upper side of a box is parallel to the plane that it stands on, within what marks of small
// boxes leave uncertain (20 degrees).
constexpr double parallel_cos = 0.94;
// A plane that is no farther below is the upper side itself, with a tag on it.
constexpr double least_height_m = 0.01;

using CornerRays = std::array<std::vector<Ray>, session::corners_of_a_box>;
using Top = std::array<glm::dvec3, session::corners_of_a_box>;

std::map<std::size_t, CornerRays> rays_of(const Views& views) {
  std::map<std::size_t, CornerRays> boxes;
  for (const MarkedView& view : views.views)
    for (const Mark& mark : view.marks)
      if (const auto at = session::box_corner_of(mark.point))
        boxes[at->box].at(at->corner).push_back(ray_of(views, view, mark));
  return boxes;
}

// A plane of tags that a box may stand on.
struct Stand {
  TagPlane plane;
  glm::dvec3 middle{0}, normal{0, 0, 1};
  double reach_m = 0;  // from the middle, as far as the plane is in the model
};

Stand stand_of(const TagPlane& plane, const std::vector<set::Tag>& tags) {
  Stand stand{plane};
  std::vector<glm::dvec3> places;
  for (const int id : plane.tags) {
    const glm::dmat4& tag = std::ranges::find(tags, id, &set::Tag::id)->world_from_tag;
    places.emplace_back(tag[3]);
    stand.normal = glm::normalize(glm::dvec3(tag[2]));
  }
  for (const glm::dvec3& place : places) stand.middle += place / double(places.size());
  for (const glm::dvec3& place : places)
    stand.reach_m = std::max(stand.reach_m, glm::distance(place, stand.middle));
  stand.reach_m += PlanePart{}.margin_m;
  return stand;
}

// Returns what a box stands on; null: nothing is below it.
const Stand* stand_below(const Top& top, const std::vector<Stand>& stands) {
  const glm::dvec3 across = glm::normalize(glm::cross(top[1] - top[0], top[2] - top[0]));
  const glm::dvec3 middle = 0.5 * (top[0] + top[2]);
  const Stand* best = nullptr;
  std::pair<bool, double> best_rank;
  for (const Stand& stand : stands) {
    const glm::dvec3 off = middle - stand.middle;
    const double height = glm::dot(off, stand.normal);
    if (!(std::abs(glm::dot(across, stand.normal)) > parallel_cos) || !(height > least_height_m))
      continue;
    const bool is_beside = glm::length(off - height * stand.normal) > stand.reach_m;
    const std::pair rank(is_beside, height);
    if (!best || rank < best_rank) best = &stand, best_rank = rank;
  }
  return best;
}

// Returns why the marks of a box do not show where its corners are; nothing if they do.
std::optional<std::string> find_top(std::size_t box, const CornerRays& rays, Top& top) {
  for (std::size_t corner = 0; corner < top.size(); ++corner) {
    const std::string name = session::name_of({box, corner});
    if (rays[corner].size() < 2)
      return fmt::format("{} is marked in {} and needs two, from different sides", name,
                         set::plural(rays[corner].size(), "picture"));
    const tracking::Meeting met = tracking::meeting_of(rays[corner]);
    if (met.parallax_rad < session::least_parallax_rad)
      return name + " is marked from one place only; mark it from another side as well";
    if (met.off_rad > 0.1) return name + " was another corner in one of its pictures";
    top[corner] = met.at;
  }
  if (!tracking::fit_a_rectangle(top))
    return "its corners were not marked in order around its upper side";
  return std::nullopt;
}

BoxPart part_of(std::size_t box, const std::string& plane) {
  BoxPart part;
  part.name = fmt::format("box {}", box + 1);
  part.on = plane;
  for (std::size_t corner = 0; corner < session::corners_of_a_box; ++corner)
    part.top.push_back(session::name_of({box, corner}));
  part.top.emplace_back();
  return part;
}

// Returns why no model can be made of a box alone; nothing if one can.
std::optional<std::string> try_model(const BoxPart& box, const Stand& stand, const RigMarks& marks,
                                     const std::vector<set::Tag>& tags,
                                     const std::filesystem::path& footage) {
  Views views = marks.views;
  const std::vector<MarkedPicture> pictures = only_of({box}, marks.pictures);
  for (std::size_t i = 0; i < pictures.size(); ++i) views.views[i].marks = pictures[i].marks;
  try {
    const Parts parts = parse_parts(parts_text(pictures, {stand.plane}, {box}), footage);
    adjust(parts, views, first_guess(parts, views, tags));
    return std::nullopt;
  } catch (const Error& error) {
    return error.what();
  }
}

// Finds what pictures show of their cameras.
class PictureViews {
 public:
  PictureViews(const ObserverCalibration& camera, const set::Tracking& tracking)
      : lens_(camera.intrinsics),
        tracking_(tracking),
        detector_({tracking.family, tracking.min_margin, tracking.max_hamming}, camera.intrinsics,
                  camera.response) {}

  // Adds a picture with its marks to the result, or says why they are not used.
  void add(const FramePtr& frame, const MarkedPicture& picture, RigMarks& result) {
    insist_on_size(*frame, lens_, picture.name);
    if (const auto pose = pose_by_tags(detector_.detect(*frame, 1), lens_, tracking_)) {
      result.pictures.push_back(picture);
      result.views.views.push_back({picture.name, picture.marks, *pose, frame});
    } else {
      result.missing.push_back(picture.name +
                               ": shows no tags of the set that fit together; its marks are not "
                               "used");
    }
  }

 private:
  const PinholeIntrinsics lens_;
  const set::Tracking& tracking_;
  tracking::TagDetector detector_;
};

}  // namespace

RigMarks rig_marks(const std::filesystem::path& footage, const ObserverCalibration& camera,
                   const set::Tracking& tracking) {
  RigMarks result;
  if (!calibrate::is_session(footage)) return result;
  session::Session opened = session::open_session(footage);
  const auto observer = session::open_stream(opened, "observer");
  if (!observer) return result;
  session::Marks marks = session::read_marks(footage, observer->records());
  result.missing = std::move(marks.missing);
  result.views = {camera.intrinsics, tracking.family, {}};
  PictureViews views(camera, tracking);
  for (auto mark = marks.marks.begin(); mark != marks.marks.end();) {
    const std::size_t index = mark->picture;
    MarkedPicture picture{fmt::format("frame {}", index), {}};
    for (; mark != marks.marks.end() && mark->picture == index; ++mark)
      picture.marks.push_back({mark->point, mark->px});
    views.add(observer->read(index), picture, result);
  }
  return result;
}

MarkedBoxes boxes_of(const RigMarks& marks, const std::vector<set::Tag>& tags,
                     const std::filesystem::path& footage) {
  std::vector<Stand> stands;
  for (const TagPlane& plane : tag_planes(tags)) stands.push_back(stand_of(plane, tags));
  MarkedBoxes result;
  for (const auto& [box, rays] : rays_of(marks.views)) {
    Top top{};
    std::optional<std::string> why_not = find_top(box, rays, top);
    const Stand* const stand = why_not ? nullptr : stand_below(top, stands);
    if (!why_not && !stand)
      why_not =
          "no tag of the set lies flat on what it stands on; write a file of parts with "
          "--pictures, and give its height_m or mark a corner of its lower side there";
    const BoxPart part = part_of(box, stand ? stand->plane.name : "");
    if (!why_not) why_not = try_model(part, *stand, marks, tags, footage);
    if (why_not) {
      result.remarks.push_back(
          fmt::format("warning: {} is not in the model: {}", part.name, *why_not));
    } else {
      result.remarks.push_back(fmt::format("{} stands on {} (tags {})", part.name,
                                           stand->plane.name, fmt::join(stand->plane.tags, ", ")));
      result.boxes.push_back(part);
    }
  }
  return result;
}

std::vector<MarkedPicture> only_of(const std::vector<BoxPart>& boxes,
                                   std::vector<MarkedPicture> pictures) {
  for (MarkedPicture& picture : pictures)
    std::erase_if(picture.marks, [&](const Mark& mark) {
      return std::ranges::none_of(boxes, [&](const BoxPart& box) {
        return std::ranges::find(box.top, mark.point) != box.top.end();
      });
    });
  return pictures;
}

std::vector<MarkedPicture> with_marks(const std::vector<std::string>& names,
                                      const RigMarks& marks) {
  std::vector<MarkedPicture> pictures = marks.pictures;
  for (const std::string& name : names)
    if (std::ranges::find(pictures, name, &MarkedPicture::name) == pictures.end())
      pictures.push_back({name, {}});
  if (marks.pictures.empty()) return pictures;
  // All are "frame N" of a session: the shorter name has the smaller number.
  std::ranges::sort(pictures, [](const MarkedPicture& a, const MarkedPicture& b) {
    return std::pair(a.name.size(), a.name) < std::pair(b.name.size(), b.name);
  });
  return pictures;
}

}  // namespace previz::model
