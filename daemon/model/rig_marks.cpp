#include "daemon/model/rig_marks.hpp"

#include <fmt/ostream.h>

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <map>
#include <optional>
#include <utility>

#include "daemon/calibrate/lens/source.hpp"
#include "daemon/model/parts_text.hpp"
#include "daemon/model/views.hpp"
#include "daemon/set/check.hpp"
#include "drivers/session/marks.hpp"
#include "drivers/session/session.hpp"

namespace previz::model {
namespace {

// The upper side of a box is parallel to the plane that it stands on, within what marks of small
// boxes leave uncertain (20 degrees).
constexpr double parallel_cos = 0.94;

// A plane of flat tags.
struct TagPlane {
  std::string name;
  glm::dvec3 at{0}, normal{0, 0, 1};
};

std::vector<TagPlane> tag_planes(const std::vector<set::Tag>& tags) {
  std::vector<TagPlane> planes;
  for (const std::vector<int>& group : flat_groups(tags)) {
    const glm::dmat4& first = std::ranges::find(tags, group.front(), &set::Tag::id)->world_from_tag;
    planes.push_back({plane_name(planes.size()), first[3], glm::normalize(glm::dvec3(first[2]))});
  }
  return planes;
}

// Returns the name of the plane that a box stands on; empty: none is below it.
std::string plane_below(const std::array<glm::dvec3, session::corners_of_a_box>& top,
                        const std::vector<TagPlane>& planes) {
  const glm::dvec3 across = glm::normalize(glm::cross(top[1] - top[0], top[2] - top[0]));
  const glm::dvec3 middle = 0.5 * (top[0] + top[2]);
  std::string name;
  double nearest = 0;
  for (const TagPlane& ground : planes) {
    const double height = glm::dot(middle - ground.at, ground.normal);
    if (!(std::abs(glm::dot(across, ground.normal)) > parallel_cos) || !(height > 0)) continue;
    if (name.empty() || height < nearest) name = ground.name, nearest = height;
  }
  return name;
}

// Returns why a box cannot be used; nothing if it can, which then is in `part`.
std::optional<std::string> box_of(std::size_t box, const RigMarks::Rays& corners,
                                  const std::vector<TagPlane>& planes, BoxPart& part) {
  std::array<glm::dvec3, session::corners_of_a_box> top{};
  for (std::size_t corner = 0; corner < top.size(); ++corner) {
    const std::string name = session::name_of({box, corner});
    if (corners[corner].size() < 2)
      return fmt::format("{} is marked in {} and needs two, from different sides", name,
                         set::plural(corners[corner].size(), "picture"));
    top[corner] = tracking::meeting_of(corners[corner]).at;
    part.top.push_back(name);
  }
  part.top.emplace_back();
  part.name = fmt::format("box {}", box + 1);
  part.on = plane_below(top, planes);
  if (!part.on.empty()) return std::nullopt;
  return "no tag of the set lies flat on what it stands on; write a file of parts with --pictures, "
         "and give its height_m or mark a corner of its lower side there";
}

// Finds the rays of marks in pictures, by the tags that these show.
class PictureRays {
 public:
  PictureRays(const ObserverCalibration& camera, const set::Tracking& tracking)
      : lens_(camera.intrinsics),
        tracking_(tracking),
        detector_({tracking.family, tracking.min_margin, tracking.max_hamming}, camera.intrinsics,
                  camera.response) {}

  // Adds a picture's marks to the boxes; returns why they cannot be used, if so.
  std::optional<std::string> add(const Frame& frame, const MarkedPicture& picture,
                                 std::map<std::size_t, RigMarks::Rays>& boxes) {
    insist_on_size(frame, lens_, picture.name);
    const auto pose = pose_by_tags(detector_.detect(frame, 1), lens_, tracking_);
    if (!pose)
      return fmt::format("{}: shows no tags of the set that fit together; its marks are not used",
                         picture.name);
    const Views views{lens_, tracking_.family, {}};
    const MarkedView view{picture.name, picture.marks, *pose};
    for (const Mark& mark : picture.marks)
      if (const auto at = session::box_corner_of(mark.point))
        boxes[at->box].at(at->corner).push_back(ray_of(views, view, mark));
    return std::nullopt;
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
  PictureRays rays(camera, tracking);
  for (auto mark = marks.marks.begin(); mark != marks.marks.end();) {
    const auto next = std::find_if(mark, marks.marks.end(), [&](const session::Marks::Mark& other) {
      return other.picture != mark->picture;
    });
    MarkedPicture picture{fmt::format("frame {}", mark->picture), {}};
    const FramePtr frame = observer->read(mark->picture);
    for (; mark != next; ++mark) picture.marks.push_back({mark->point, mark->px});
    if (auto why_not = rays.add(*frame, picture, result.boxes))
      result.missing.push_back(*std::move(why_not));
    else
      result.pictures.push_back(std::move(picture));
  }
  return result;
}

std::vector<BoxPart> boxes_of(const RigMarks& marks, const std::vector<set::Tag>& tags,
                              std::ostream& out) {
  for (const std::string& what : marks.missing) fmt::print(out, "warning: {}\n", what);
  const std::vector<TagPlane> planes = tag_planes(tags);
  std::vector<BoxPart> boxes;
  for (const auto& [box, corners] : marks.boxes) {
    BoxPart part;
    if (const auto why_not = box_of(box, corners, planes, part))
      fmt::print(out, "warning: box {} is not in the model: {}\n", box + 1, *why_not);
    else
      boxes.push_back(std::move(part));
  }
  return boxes;
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
