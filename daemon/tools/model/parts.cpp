#include "daemon/tools/model/parts.hpp"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <list>
#include <map>
#include <set>

#include "daemon/core/scene/scene.hpp"
#include "daemon/core/set/read_tables.hpp"
#include "drivers/error.hpp"

namespace previz {

template <>
struct Codec<std::vector<int>> {
  static std::vector<int> read(const Value& value, const Rule& rule) {
    const std::string allowed = describe(rule);
    std::vector<int> ids;
    for (const Value& entry : codec::list(value, allowed))
      ids.push_back(static_cast<int>(codec::whole_number(entry, rule)));
    return ids;
  }
  static std::string describe(const Rule&) { return "list of tag ids, like [0, 3]"; }
};

template <>
struct Codec<std::vector<std::array<std::string, 2>>> {
  using Pairs = std::vector<std::array<std::string, 2>>;
  static Pairs read(const Value& value, const Rule& rule) {
    const std::string allowed = describe(rule);
    Pairs pairs;
    for (const Value& entry : codec::list(value, allowed)) {
      const std::vector<Value>& points = codec::list(entry, allowed);
      if (points.size() != 2) codec::misread(entry, allowed);
      pairs.push_back({codec::text(points[0]), codec::text(points[1])});
    }
    return pairs;
  }
  static std::string describe(const Rule&) {
    return "list of pairs of points, like [[\"a\", \"b\"], [\"b\", \"c\"]]";
  }
};

namespace model {
namespace {

using set::Given, set::Key, set::Problems, set::Section;
using Keys = std::vector<Key>;
using Texts = std::vector<std::string>;

constexpr Rule ids = units::plain.within(0, 65535);
constexpr Rule length = units::m.within(1e-4, 1000);
constexpr Rule thin = units::m.within(0, 0.1);

Need optional(std::string example) {
  return {Need::Kind::optional, std::move(example)};
}
Need required(std::string example) {
  return {Need::Kind::required, std::move(example)};
}

// The parts as they are read. A list keeps each where it is, which the keys are bound to.
template <class Part>
using Drafts = std::list<std::pair<Given, Part>>;

struct Draft {
  Parts parts;
  Given marking;
  Drafts<MarkedPicture> pictures;
  std::list<Given> points;  // of each [picture.points]
  Drafts<PlanePart> planes;
  Drafts<BoxPart> boxes;
  Drafts<CylinderPart> cylinders;
  Drafts<RoomPart> rooms;
  Drafts<ScanPart> scans;
  std::list<Given> scan_points;  // of each scan
};

constexpr const char* tag_paper_about =
    "Width and height of that paper, with the tag in the middle. Default: it ends where the tag's "
    "white cells end.";

// clang-format off
Keys plane_keys(PlanePart& p) {
  return {
      {"name", &p.name, {}, "Name of the plane.", required("\"table\"")},
      {"tags", &p.tags, ids, "Tags that lie flat on it.", optional("[0, 1, 2]")},
      {"tag_thickness_m", &p.tag_thickness_m, thin, "Thickness of their paper or board."},
      {"tag_paper_m", &p.tag_paper_m, length, tag_paper_about, optional("[0.21, 0.297]")},
      {"points", &p.points, {}, "Points that lie on it.", optional("[\"a\", \"b\", \"c\"]")},
      {"outline", &p.outline, {}, "Points at its corners, in order around. Default: a rectangle around everything on it; that of a wall goes up to the top of the pictures.", optional("[\"a\", \"b\", \"c\", \"d\"]")},
      {"margin_m", &p.margin_m, units::m.within(0, 1000), "How far that rectangle extends beyond what is on the plane."},
      {"height_m", &p.height_m, length, "Height of an upright plane over the one that it stands on. Default of a wall: up to the top of the pictures, and the margin beyond.", optional("2.6")},
      {"edges", &p.edges, {}, "Pairs of points on its borders, where the rectangle ends.", optional("[[\"a\", \"b\"]]")},
      {"upright_on", &p.upright_on, {}, "Plane that it stands on at a right angle.", optional("\"floor\"")},
      {"foot", &p.foot, {}, "Points where it meets that plane.", optional("[\"a\", \"b\"]")},
  };
}

Keys box_keys(BoxPart& b) {
  return {
      {"name", &b.name, {}, "Name of the box.", required("\"crate\"")},
      {"on", &b.on, {}, "Plane that it stands on.", optional("\"table\"")},
      {"top", &b.top, {}, "Points at the four corners of its upper side, in order around; \"\" for one that is not marked.", optional("[\"a\", \"b\", \"c\", \"d\"]")},
      {"bottom", &b.bottom, {}, "Points at the corners below them.", optional("[\"e\", \"f\", \"\", \"\"]")},
      {"tags", &b.tags, ids, "Tags that lie flat on its sides.", optional("[7]")},
      {"tag_thickness_m", &b.tag_thickness_m, thin, "Thickness of their paper or board."},
      {"tag_paper_m", &b.tag_paper_m, length, tag_paper_about, optional("[0.1, 0.1]")},
      {"length_m", &b.length_m, length, "Distance of the first two corners, if it is known; of a box with tags only, its size along the first tag's right or up, whichever is more level.", optional("0.3")},
      {"width_m", &b.width_m, length, "Distance of the second and the third corner, or at a right angle to that of the tag.", optional("0.2")},
      {"height_m", &b.height_m, length, "Height; of a box with tags only that stands on nothing, along the first tag's normal.", optional("0.1")},
  };
}

Keys cylinder_keys(CylinderPart& c) {
  return {
      {"name", &c.name, {}, "Name of the cylinder.", required("\"can\"")},
      {"on", &c.on, {}, "Plane that it stands on.", required("\"table\"")},
      {"top", &c.top, {}, "Points on its upper rim; each may be visible in one picture only.", optional("[\"a\", \"b\", \"c\"]")},
      {"bottom", &c.bottom, {}, "Points on its lower rim.", optional("[\"d\", \"e\"]")},
      {"diameter_m", &c.diameter_m, length, "Diameter, if it is known.", optional("0.066")},
      {"height_m", &c.height_m, length, "Height, if it is known.", optional("0.115")},
  };
}

Keys room_keys(RoomPart& r) {
  return {
      {"name", &r.name, {}, "Name of the room.", required("\"room\"")},
      {"floor", &r.floor, {}, "Plane of the floor.", required("\"floor\"")},
      {"walls", &r.walls, {}, "The four planes of its walls, in order around.", required("[\"north\", \"east\", \"south\", \"west\"]")},
      {"height_m", &r.height_m, length, "Height of the ceiling.", required("2.6")},
  };
}

Keys scan_keys(ScanPart& s) {
  return {
      {"name", &s.name, {}, "Name of the scan.", required("\"statue\"")},
      {"file", &s.file, {}, "Its mesh: OBJ, PLY, STL, FBX or glTF.", required("\"statue.ply\"")},
      {"unit", &s.unit, {}, "Unit of the file's coordinates, unless the file gives it.", optional("\"mm\"")},
      {"up", &s.up, {}, "Axis of the file that points up, unless the file gives it.", optional("\"y\"")},
      {"error_m", &s.error_m, thin, "Largest deviation of the simplified surface; 0: it is not simplified."},
  };
}
// clang-format on

template <class Part>
Section many(const std::string& path, Drafts<Part>& parts, Keys (*keys)(Part&)) {
  return {path, Section::Kind::repeated, "", [path, &parts, keys]() -> Section::Opened {
            auto& [given, part] = parts.emplace_back();
            given.path = path;
            return {&given, keys(part)};
          }};
}

Section points_section(Draft& d) {
  return {"picture.points", Section::Kind::optional, "", [&d]() -> Section::Opened {
            d.points.emplace_back().path = "picture.points";
            const auto mark = [&d](Position at, const std::string& name, const Value& value) {
              if (name.empty()) throw Misread{at, "has an empty name; allowed: a name"};
              const auto px = codec::numbers(value, 2, units::px.within(-1e5, 1e5));
              if (!d.pictures.empty())
                d.pictures.back().second.marks.push_back({name, {px[0], px[1]}});
            };
            return {&d.points.back(), {}, mark};
          }};
}

Section scan_section(Draft& d) {
  return {"scan", Section::Kind::repeated, "", [&d]() -> Section::Opened {
            auto& [given, scan] = d.scans.emplace_back();
            given.path = "scan";
            d.scan_points.emplace_back().path = "scan.points";
            return {&given, scan_keys(scan)};
          }};
}

Section scan_points_section(Draft& d) {
  return {"scan.points", Section::Kind::optional, "", [&d]() -> Section::Opened {
            if (d.scans.empty()) scan_section(d).open();
            const auto add = [given = &d.scan_points.back(), scan = &d.scans.back().second](
                                 Position at, const std::string& name, const Value& value) {
              const auto xyz = codec::numbers(value, 3, units::plain);
              given->keys[name] = {at, true};
              scan->points.push_back({name, {xyz[0], xyz[1], xyz[2]}});
            };
            return {&d.scan_points.back(), {}, add};
          }};
}

std::vector<Section> sections(Draft& d) {
  const auto picture_keys = +[](MarkedPicture& p) {
    return Keys{{"file", &p.name, {}, "Name of the picture.", required("\"0000.png\"")}};
  };
  return {{"marks", Section::Kind::always, "",
           [&d]() -> Section::Opened {
             d.marking.path = "marks";
             return {&d.marking,
                     {{"accuracy_px", &d.parts.mark_px, units::px.within(0.01, 100),
                       "How far off a mark's coordinates are (standard deviation)."}}};
           }},
          many("picture", d.pictures, picture_keys),
          points_section(d),
          many("plane", d.planes, plane_keys),
          many("box", d.boxes, box_keys),
          many("cylinder", d.cylinders, cylinder_keys),
          many("room", d.rooms, room_keys),
          scan_section(d),
          scan_points_section(d)};
}

// Finds what is wrong with the parts beyond each value.
class Checker {
 public:
  Checker(const Draft& draft, Problems& problems) : draft_(draft), problems_(problems) {
    for (const auto& [given, picture] : draft.pictures)
      for (const Mark& mark : picture.marks) ++pictures_of_[mark.point];
  }

  void check() {
    check_names();
    for (const auto& [given, plane] : draft_.planes) check(given, plane);
    for (const auto& [given, box] : draft_.boxes) check(given, box);
    for (const auto& [given, cylinder] : draft_.cylinders) check(given, cylinder);
    for (const auto& [given, room] : draft_.rooms) check(given, room);
    auto points = draft_.scan_points.begin();
    for (const auto& [given, scan] : draft_.scans) check(given, *points++, scan);
  }

 private:
  void add(const Given& given, const std::string& key, const std::string& what) {
    problems_.add(given.where(key), given.path + '.' + key, what);
  }

  void name(const Given& given, const std::string& name) {
    if (name.empty()) return add(given, "name", "is empty; allowed: a name");
    if (!names_.insert(name).second)
      add(given, "name", '"' + name + "\" is used twice; allowed: a name for each part");
    if (scene::named_tag(name).part != scene::TagPart::none)
      add(given, "name",
          '"' + name +
              "\" is how printed tags are named, which can be hidden; allowed: another name");
  }

  void check_names() {
    std::set<std::string> pictures;
    for (const auto& [given, picture] : draft_.pictures)
      if (!pictures.insert(picture.name).second)
        add(given, "file", '"' + picture.name + "\" has a table already; put all its points there");
    for (const auto& [given, plane] : draft_.planes) name(given, plane.name);
    for (const auto& [given, box] : draft_.boxes) name(given, box.name);
    for (const auto& [given, cylinder] : draft_.cylinders) name(given, cylinder.name);
    for (const auto& [given, room] : draft_.rooms) name(given, room.name);
    for (const auto& [given, scan] : draft_.scans) name(given, scan.name);
    if (names_.empty())
      problems_.add({}, "",
                    "has no part; add a [[plane]], [[box]], [[cylinder]], [[room]] or [[scan]]");
  }

  // A corner of a box need not be marked: "" stands for it.
  enum class Empty { refused, allowed };

  // A point that is given must be marked; how often, says what it is used for.
  void points(const Given& given, const std::string& key, const Texts& names, int least,
              Empty empty = Empty::refused) {
    for (const std::string& point : names) {
      if (point.empty()) {
        if (empty == Empty::refused) add(given, key, "has an empty name; allowed: names of points");
        continue;
      }
      const auto found = pictures_of_.find(point);
      if (found == pictures_of_.end()) {
        Texts known;
        for (const auto& [name, count] : pictures_of_) known.push_back(name);
        const std::string meant = set::nearest(point, known);
        add(given, key,
            "no picture has a point \"" + point + "\"; " +
                (meant.empty() ? "mark it under [picture.points]" : "did you mean " + meant + "?"));
      } else if (found->second < least) {
        add(given, key,
            "point \"" + point +
                "\" is marked in one picture only; mark it in another one, taken from another "
                "side");
      }
    }
  }

  // A tag lies on one thing.
  void flat_tags(const Given& given, const std::vector<int>& tags) {
    for (const int tag : tags)
      if (!tags_.insert(tag).second)
        add(given, "tags", fmt::format("tag {} is listed twice; it can lie on one part only", tag));
  }

  // Returns the name of the cylinder that has this point on a rim; null if none has.
  const std::string* rim_of(const std::string& point) const {
    for (const auto& [given, c] : draft_.cylinders)
      for (const auto* rim : {&c.top, &c.bottom})
        if (std::ranges::find(*rim, point) != rim->end()) return &c.name;
    return nullptr;
  }

  // Returns whether the plane exists.
  bool plane(const Given& given, const std::string& key, const std::string& name) {
    Texts known;
    for (const auto& [of, plane] : draft_.planes) known.push_back(plane.name);
    if (std::ranges::find(known, name) != known.end()) return true;
    const std::string meant = set::nearest(name, known);
    add(given, key,
        "there is no plane \"" + name + "\"; " +
            (meant.empty() ? "add a [[plane]] of this name" : "did you mean " + meant + "?"));
    return false;
  }

  static std::size_t marked(const Texts& names) {
    return names.size() - static_cast<std::size_t>(std::ranges::count(names, ""));
  }

  void check(const Given& given, const PlanePart& p) {
    points(given, "points", p.points, 2);
    points(given, "outline", p.outline, 2);
    for (const auto& [a, b] : p.edges) points(given, "edges", {a, b}, 1);
    points(given, "foot", p.foot, 1);
    for (const std::string& point : points_on(p))
      if (const std::string* rim = rim_of(point))
        add(given, "name",
            "point \"" + point + "\" is on a rim of cylinder \"" + *rim +
                "\", where each picture has points of its own; mark another one");
    flat_tags(given, p.tags);
    if (!p.outline.empty() && !p.edges.empty())
      add(given, "edges", "conflicts with outline; remove one of the two");
    if (!p.foot.empty() && p.upright_on.empty())
      add(given, "foot", "needs upright_on, the plane that the foot is on");
    if (p.height_m && p.upright_on.empty())
      add(given, "height_m", "needs upright_on, the plane that it is the height over");
    if (p.height_m && !p.outline.empty())
      add(given, "height_m", "conflicts with outline; remove one of the two");
    const std::size_t on_it = marked(p.points) + marked(p.outline) + marked(p.foot);
    const std::size_t needed = p.upright_on.empty() ? 3 : 2;
    if (p.tags.empty() && on_it < needed)
      add(given, "name",
          fmt::format(
              "nothing says where plane \"{}\" is: it has no tag and {} points, and needs {}; "
              "list its tags, or mark more points on it",
              p.name, on_it, needed));
    if (!p.outline.empty() && p.outline.size() < 3)
      add(given, "outline", "has fewer than 3 corners; allowed: 3 or more points, in order around");
    if (p.upright_on.empty() || !plane(given, "upright_on", p.upright_on)) return;
    const auto below = std::ranges::find(draft_.planes, p.upright_on,
                                         [](const auto& draft) { return draft.second.name; });
    if (p.upright_on == p.name || !below->second.upright_on.empty())
      add(given, "upright_on",
          '"' + p.upright_on + "\" stands on a plane itself; allowed: a plane that does not");
  }

  bool four(const Given& given, const std::string& key, const Texts& names) {
    if (names.empty() || names.size() == 4) return true;
    add(given, key,
        fmt::format(
            "has {} corners; allowed: 4, in order around, with \"\" for one that is not marked",
            names.size()));
    return false;
  }

  void check(const Given& given, const BoxPart& b) {
    points(given, "top", b.top, 2, Empty::allowed);
    points(given, "bottom", b.bottom, b.on.empty() ? 2 : 1, Empty::allowed);
    flat_tags(given, b.tags);
    const bool has_plane = b.on.empty() || plane(given, "on", b.on);
    if (!four(given, "top", b.top) || !four(given, "bottom", b.bottom) || !has_plane) return;
    std::size_t corners = 0;  // around the box, marked above or below
    for (std::size_t i = 0; i < 4; ++i)
      corners +=
          (!b.top.empty() && !b.top[i].empty()) || (!b.bottom.empty() && !b.bottom[i].empty());
    if (corners > 0 && corners < 3 && !b.tags.empty())
      add(given, "name",
          fmt::format("box \"{}\" has tags and {} of its four upright edges marked; mark three, or "
                      "none",
                      b.name, corners));
    if (corners < 3 && b.tags.empty())
      add(given, "name",
          fmt::format(
              "box \"{}\" has {} of its four upright edges marked and needs 3; mark more of its "
              "corners, or list the tags on it",
              b.name, corners));
    const bool has_height =
        b.height_m || (marked(b.top) > 0 && (marked(b.bottom) > 0 || !b.on.empty()));
    if (b.tags.empty() && !has_height)
      add(given, "name",
          fmt::format(
              "box \"{}\" has one side only: nothing says how high it is; name the plane it stands "
              "on (on), mark corners of the other side, or give height_m",
              b.name));
  }

  void check(const Given& given, const CylinderPart& c) {
    points(given, "top", c.top, 1);
    points(given, "bottom", c.bottom, 1);
    if (!plane(given, "on", c.on)) return;
    if (marked(c.top) + marked(c.bottom) < 3)
      add(given, "name",
          fmt::format("cylinder \"{}\" has fewer than 3 points on its rims; mark more of them",
                      c.name));
    if (marked(c.top) == 0 && !c.height_m)
      add(given, "height_m",
          "is missing, and no point of the upper rim is marked; give one of them");
  }

  void check(const Given& given, const RoomPart& r) {
    if (r.walls.size() != 4)
      add(given, "walls",
          fmt::format("has {} planes; allowed: 4, in order around", r.walls.size()));
    std::set<std::string> different(r.walls.begin(), r.walls.end());
    different.insert(r.floor);
    if (different.size() != r.walls.size() + 1)
      add(given, "walls", "has a plane twice, or the floor; allowed: 4 different planes");
    plane(given, "floor", r.floor);
    for (const std::string& wall : r.walls) plane(given, "walls", wall);
    for (const auto& [of, side] : draft_.planes) {
      if (!different.contains(side.name)) continue;
      for (const auto& [key, is_empty] :
           {std::pair("edges", side.edges.empty()), {"outline", side.outline.empty()}})
        if (!is_empty)
          add(of, key,
              fmt::format("\"{}\" is a side of room \"{}\" and ends where the room's other sides "
                          "are; remove {}",
                          side.name, r.name, key));
    }
  }

  void check(const Given& given, const Given& points_given, const ScanPart& s) {
    if (!s.points.empty() && s.points.size() < 3)
      add(given, "points",
          fmt::format("scan \"{}\" has {} points, and needs 3 that are marked in pictures; give "
                      "the scan's own coordinates of them under [scan.points], or remove "
                      "[scan.points] to place the scan by the set's tags that its colours show",
                      s.name, s.points.size()));
    for (const ScanPoint& point : s.points) {
      points(points_given, point.name, {point.name}, 2);
      for (const auto& [of, c] : draft_.cylinders)
        for (const auto* rim : {&c.top, &c.bottom})
          if (std::ranges::find(*rim, point.name) != rim->end())
            add(points_given, point.name,
                "is on a rim of cylinder \"" + c.name +
                    "\", where each picture may show another point; allowed: a corner or spot that "
                    "is the same in all pictures");
    }
  }

  const Draft& draft_;
  Problems& problems_;
  std::map<std::string, int> pictures_of_;  // how many show each point
  std::set<std::string> names_;
  std::set<int> tags_;  // that lie on a part
};

template <class Part>
std::vector<Part> values_of(const Drafts<Part>& drafts) {
  std::vector<Part> parts;
  for (const auto& [given, part] : drafts) parts.push_back(part);
  return parts;
}

// Where [[picture]] is forgotten, its points are a second table of the picture before.
toml::table parsed(const std::string& text, const std::string& file,
                   const std::vector<Section>& sections, Problems& problems) {
  try {
    return set::parse_toml(text, file, sections, problems);
  } catch (const Error& error) {
    const std::string what = error.what();
    const bool is_second = what.find("'picture.points'") != std::string::npos;
    throw Error(what + (is_second ? "; is [[picture]] with its file missing above it?" : ""));
  }
}

}  // namespace

std::vector<std::string> points_on(const PlanePart& part) {
  std::vector<std::string> names = part.points;
  for (const auto* more : {&part.outline, &part.foot})
    names.insert(names.end(), more->begin(), more->end());
  for (const auto& pair : part.edges) names.insert(names.end(), pair.begin(), pair.end());
  std::ranges::sort(names);
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

Parts parse_parts(const std::string& text, const std::filesystem::path& file) {
  Problems problems(file.string());
  Draft draft;
  const auto home_of = [](const std::string& key) {
    Draft scratch;
    return set::home_among(sections(scratch), key);
  };
  const std::vector<Section> all = sections(draft);
  set::read_tables(parsed(text, file.string(), all, problems), all, home_of, problems);
  problems.throw_if_any();
  Checker(draft, problems).check();
  problems.throw_if_any();
  Parts parts = draft.parts;
  parts.file = file;
  parts.pictures = values_of(draft.pictures);
  parts.planes = values_of(draft.planes);
  parts.boxes = values_of(draft.boxes);
  parts.cylinders = values_of(draft.cylinders);
  parts.rooms = values_of(draft.rooms);
  parts.scans = values_of(draft.scans);
  for (ScanPart& scan : parts.scans) scan.file = file.parent_path() / scan.file;
  return parts;
}

}  // namespace model
}  // namespace previz
