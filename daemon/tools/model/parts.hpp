// Reads the file of parts: the planes, boxes and other things that a model of the real scene is
// made of, and the places of their points in pictures.
#pragma once

#include <array>
#include <filesystem>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "drivers/keys/value.hpp"

namespace previz::model {

// A named point as a person found it in one picture; (0, 0) is the centre of the top left pixel.
struct Mark {
  std::string point;
  glm::dvec2 px{0};
};

struct MarkedPicture {
  std::string name;  // the picture's file, or the video and the frame's number
  std::vector<Mark> marks;
};

// A flat surface: a table, a floor, a wall. It is where its tags and points lie.
struct PlanePart {
  std::string name = {};
  std::vector<int> tags = {};     // that lie flat on it
  double tag_thickness_m = 1e-4;  // of their paper or board
  // Its width and height, with the tag in the middle; absent: it ends where the tag does.
  std::optional<std::array<double, 2>> tag_paper_m = {};
  std::vector<std::string> points = {};  // that lie on it
  // Points at its corners, in order around; empty: a rectangle around all that is on it.
  std::vector<std::string> outline = {};
  double margin_m = 0.3;  // of that rectangle
  // Of that rectangle if the plane stands on another; none: of a wall up to the top of the pictures
  // and the margin beyond.
  std::optional<double> height_m = {};
  // Pairs of points on its borders; the rectangle ends at the line through each. Points on a
  // border lie on the plane, and one picture of each is enough.
  std::vector<std::array<std::string, 2>> edges = {};
  std::string upright_on = {};  // the plane that it stands on at a right angle; empty: none
  // Points where it meets the plane that it stands on; one picture of each is enough.
  std::vector<std::string> foot = {};
};

// Four corners in order around a box's upper or lower side; "" for one that is not marked.
struct BoxPart {
  std::string name;
  std::string on;                        // the plane that it stands on; empty: none
  std::vector<std::string> top, bottom;  // empty or four; bottom i is below top i
  std::vector<int> tags;                 // that lie flat on its sides
  double tag_thickness_m = 1e-4;
  std::optional<std::array<double, 2>> tag_paper_m = {};
  // Known sizes: from the first corner to the second, from there to the third, and up.
  std::optional<double> length_m, width_m, height_m;
};

struct CylinderPart {
  std::string name;
  std::string on;                        // the plane that it stands on
  std::vector<std::string> top, bottom;  // marks on its rims; each picture may have others
  std::optional<double> diameter_m, height_m;
};

// Four walls around a floor, and a ceiling.
struct RoomPart {
  std::string name;
  std::string floor;
  std::vector<std::string> walls;  // planes, in order around
  double height_m = 0;
};

enum class LengthUnit { m, cm, mm, in };
constexpr auto names(LengthUnit) {
  return std::to_array<Name<LengthUnit>>({{"m", LengthUnit::m},
                                          {"cm", LengthUnit::cm},
                                          {"mm", LengthUnit::mm},
                                          {"in", LengthUnit::in}});
}

enum class UpAxis { x, y, z };
constexpr auto names(UpAxis) {
  return std::to_array<Name<UpAxis>>({{"x", UpAxis::x}, {"y", UpAxis::y}, {"z", UpAxis::z}});
}

struct ScanPoint {
  std::string name;
  glm::dvec3 at{0};  // in the scan's own coordinates and unit
};

// A mesh of a real thing, from a scanner or from photogrammetry, placed by points that are marked,
// or, without points, by the set's tags that its colours show.
struct ScanPart {
  std::string name;
  std::filesystem::path file;
  std::optional<LengthUnit> unit;  // none: as the file gives it
  std::optional<UpAxis> up;        // likewise
  double error_m = 5e-4;           // by which simplifying may move its surface; 0: all is kept
  std::vector<ScanPoint> points;
};

struct Parts {
  std::filesystem::path file;  // for messages
  double mark_px = 1;          // standard deviation of a mark's coordinates
  std::vector<MarkedPicture> pictures;
  std::vector<PlanePart> planes;
  std::vector<BoxPart> boxes;
  std::vector<CylinderPart> cylinders;
  std::vector<RoomPart> rooms;
  std::vector<ScanPart> scans;
};

// Returns the names of all points that lie on a plane.
std::vector<std::string> points_on(const PlanePart& part);

// Parses a file of parts; `file` names it in errors. Throws previz::Error with every problem found,
// one a line: what cannot be read, names that are used twice or not known, points that no picture
// has, and parts that nothing determines. Paths are relative to the folder of `file`.
Parts parse_parts(const std::string& text, const std::filesystem::path& file);

}  // namespace previz::model
