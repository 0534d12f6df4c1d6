#include "daemon/tools/model/scans.hpp"

#include <fmt/ostream.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include "daemon/core/tracking/tag_map.hpp"
#include "daemon/tools/model/scan_distance.hpp"
#include "daemon/tools/model/scan_place.hpp"
#include "daemon/tools/model/scan_simplify.hpp"
#include "drivers/error.hpp"

namespace previz::model {
namespace {

// A scan whose up axis is farther from the vertical is probably upside down, or turned.
constexpr double most_tilt = 60 * std::numbers::pi / 180;

// A marked point that is farther from its scan's surface, as a fraction of the scan's diagonal, has
// other coordinates than the file: another program's unit or axes.
constexpr double most_off_surface = 0.03;

std::string subject_of(const Parts& parts, const ScanPart& part) {
  return fmt::format("{}: scan \"{}\"", parts.file.string(), part.name);
}

glm::dvec3 world_place_of(const std::string& point, const Layout& layout, const Shape& shape) {
  return model::place_of(shape, layout.places.at(point));
}

std::vector<PointPair> marked_pairs(const ScanPart& part, const ScanFile& file,
                                    const Layout& layout, const Shape& shape) {
  std::vector<PointPair> points;
  for (const ScanPoint& point : part.points)
    points.push_back(
        {point.name, point.at - file.origin, world_place_of(point.name, layout, shape)});
  return points;
}

glm::dvec3 direction_of(UpAxis up) {
  return {up == UpAxis::x, up == UpAxis::y, up == UpAxis::z};
}

// The table's values come first: programs write a unit that they do not use.
struct ScanUnits {
  double unit_m = 1;
  glm::dvec3 up{0};
};

ScanUnits units_of(const std::string& subject, const ScanPart& part, const ScanFile& file,
                   const std::vector<PointPair>& points) {
  std::string missing;
  const auto add = [&](const char* key, const std::string& likely) {
    missing += fmt::format(
        "{}{}: {} is missing, and {} does not give it; its {} fit best with {} = \"{}\"",
        missing.empty() ? "" : "\n", subject, key, part.file.filename().string(),
        part.points.empty() ? "tags" : "points", key, likely);
  };
  if (!part.unit && !file.unit_m) add("unit", name_of(likely_unit(points)));
  if (!part.up && !file.up) add("up", name_of(likely_up(points)));
  if (!missing.empty()) throw Error(missing);
  return {part.unit ? metres(*part.unit) : *file.unit_m,
          part.up ? direction_of(*part.up) : *file.up};
}

void print_placement(const ScanPart& part, const std::string& placed_by, const ScanUnits& units,
                     const Placement& placed, std::ostream& out) {
  fmt::print(out, "scan {}: {}, rms {:.2f} mm; they would fit best at {:.4f} times its size\n",
             part.name, placed_by, 1000 * placed.rms_m, placed.best_scale);
  const double tilt = std::acos(std::clamp((placed.rotation * units.up).z, -1.0, 1.0));
  if (tilt > most_tilt)
    fmt::print(out,
               "warning: scan {}: its up axis is {:.0f} degrees from the vertical; check up, and "
               "that {}\n",
               part.name, tilt * 180 / std::numbers::pi,
               part.points.empty() ? "the scan is neither mirrored nor inside out"
                                   : "no two of its points are swapped");
}

// A corner is known to half a pixel, so that one tag alone shows little about what is far from it.
void warn_of_one_tag(const ScanPart& part, const ScanTags& tags, double unit_m, std::ostream& out) {
  if (tags.ids.size() != 1) return;
  const double side_m = glm::distance(tags.corners[0].in_world, tags.corners[1].in_world);
  fmt::print(out,
             "warning: scan {}: {} is the only tag that can be used; 1 m from it the scan is "
             "accurate to about "
             "{:.0f} mm; scan it with two or more tags, far apart\n",
             part.name, tracking::tags_in_words(tags.ids),
             std::ceil(1000 * 0.5 * tags.grain * unit_m / side_m));
}

void print_faults(const std::string& name, const MeshFaults& faults, std::ostream& out) {
  if (faults.open_borders > 0)
    fmt::print(
        out,
        "warning: scan {}: {} open borders, the longest {:.1f} mm around; close those that a "
        "camera or a shadow shows\n",
        name, faults.open_borders, 1000 * faults.longest_border);
  if (faults.opposite_edges > 0)
    fmt::print(out,
               "warning: scan {}: faces on both sides of {} edges disagree about what is outside; "
               "{} faces turned{}\n",
               name, faults.opposite_edges, faults.turned,
               faults.opposite_left == 0
                   ? std::string()
                   : fmt::format("; {} edges unchanged, because their surface has one side only",
                                 faults.opposite_left));
  if (faults.was_inside_out)
    fmt::print(out, "warning: scan {}: was inside out; all of its faces are turned\n", name);
  if (faults.crowded_edges > 0)
    fmt::print(out,
               "warning: scan {}: {} edges belong to more than two faces; faces across them are "
               "not compared\n",
               name, faults.crowded_edges);
}

struct Bounds {
  glm::dvec3 low{std::numeric_limits<double>::infinity()}, high{-low};
};

// Returns the bounds in the file's coordinates.
Bounds bounds_of(const ScanFile& file) {
  Bounds bounds;
  for (const glm::vec3& p : file.mesh.positions) {
    bounds.low = glm::min(bounds.low, glm::dvec3(p) + file.origin);
    bounds.high = glm::max(bounds.high, glm::dvec3(p) + file.origin);
  }
  return bounds;
}

// Shows coordinates to a thousandth of such a distance.
std::string in_words(const glm::dvec3& p, double distance) {
  const int digits =
      distance > 0 ? std::clamp(3 - int(std::floor(std::log10(distance))), 0, 12) : 3;
  return fmt::format("({:.{}f}, {:.{}f}, {:.{}f})", p.x, digits, p.y, digits, p.z, digits);
}

// A scan whose file keeps its coordinates in coarser steps has lost its shape.
constexpr double most_step_m = 1e-3, most_step_fraction = 1e-5;
constexpr double most_step_without_unit = 1e-4;  // as a fraction of the scan's diagonal

void insist_on_fine_steps(const std::string& subject, const ScanPart& part, const ScanFile& file) {
  const auto [low, high] = bounds_of(file);
  const double diagonal = glm::distance(low, high);
  const double unit_m = part.unit ? metres(*part.unit) : file.unit_m.value_or(0);
  const double most = unit_m > 0 ? std::max(most_step_m / unit_m, most_step_fraction * diagonal)
                                 : most_step_without_unit * diagonal;
  if (file.step <= most) return;
  throw Error(fmt::format(
      "{}: {} keeps its coordinates {}, which as far from the origin as {} to {} has steps of "
      "{:.2g} units, so that its surface is no longer smooth; subtract {} from its coordinates in "
      "the program that made it before it is exported, or export it {}",
      subject, part.file.filename().string(),
      file.is_step_of_text ? "with few digits" : "in single precision", in_words(low, diagonal),
      in_words(high, diagonal), file.step, in_words(glm::round(0.5 * (low + high)), 1e4),
      file.is_step_of_text ? "with more digits"
                           : "as OBJ with all digits, or as PLY with coordinates of type double"));
}

// The mesh must have triangles; both are in the file's unit.
void insist_on_surface(const std::string& subject, const ScanPart& part, const ScanFile& file) {
  const auto [low, high] = bounds_of(file);
  const double diagonal = glm::distance(low, high);
  const SurfaceDistance surface(file.mesh.positions, file.mesh.indices);
  for (const ScanPoint& point : part.points) {
    const double off =
        surface.from(glm::vec3(point.at - file.origin), std::numeric_limits<double>::infinity());
    if (off <= most_off_surface * diagonal) continue;
    throw Error(fmt::format(
        "{}: point \"{}\" is {:.4g} units from the surface, whose diagonal has {:.4g}; give its "
        "coordinates as the file has them, {} to {} along each axis: programs that show a scan may "
        "change its unit, swap its axes, and shift it (CloudCompare's global shift)",
        subject, point.name, off, diagonal, in_words(low, diagonal), in_words(high, diagonal)));
  }
}

NamedMesh placed_scan(const ScanPart& part, const ScanFile& file, const ScanUnits& units,
                      const Placement& placed, std::ostream& out) {
  TriangleMesh mesh = file.mesh;
  for (glm::vec3& p : mesh.positions) p = glm::vec3(units.unit_m * glm::dvec3(p));
  weld(mesh);
  print_faults(part.name, mend(mesh), out);
  if (mesh.indices.empty())
    throw Error(part.file.string() +
                ": all its triangles are without area; check the program that exported it");
  const std::size_t before = mesh.triangles();
  const Simplified simple = simplified(std::move(mesh), part.error_m);
  if (simple.mesh.triangles() < before)
    fmt::print(out, "scan {}: {} triangles, simplified to {}; largest deviation {:.3f} mm\n",
               part.name, before, simple.mesh.triangles(), 1000 * simple.error);
  else
    fmt::print(out, "scan {}: {} triangles, none removed\n", part.name, before);
  NamedMesh scan{part.name, shaded(simple.mesh)};
  for (glm::vec3& p : scan.mesh.positions)
    p = glm::vec3(placed.rotation * glm::dvec3(p) + placed.translation);
  for (glm::vec3& n : scan.mesh.normals) n = glm::vec3(placed.rotation * glm::dvec3(n));
  return scan;
}

// Takes the colours out of the file: they are not needed afterwards, and may be large.
ScanTags tags_on(const std::string& subject, const ScanPart& part, ScanFile& file,
                 const set::Tracking& tracking, std::ostream& out) {
  fmt::print(out, "looking for tags on scan {}\n", part.name);
  out.flush();
  ScanFile seen;
  seen.mesh = with_faces_turned(file.mesh);
  seen.unit_m = file.unit_m;
  seen.colours = std::exchange(file.colours, {});
  ScanTags tags = find_scan_tags(fmt::format("{}, {}", subject, part.file.filename().string()),
                                 seen, tracking, part.unit ? metres(*part.unit) : seen.unit_m);
  for (const std::string& note : tags.notes)
    fmt::print(out, "warning: scan {}: {}\n", part.name, note);
  return tags;
}

}  // namespace

std::vector<ReadScan> read_scans(const Parts& parts, const set::Tracking& tracking,
                                 std::ostream& out) {
  std::vector<ReadScan> scans;
  for (const ScanPart& part : parts.scans) {
    const bool is_by_tags = part.points.empty();
    const std::string subject = subject_of(parts, part);
    std::error_code not_there;
    const auto bytes = std::filesystem::file_size(part.file, not_there);
    if (!not_there && bytes > 10'000'000) {  // takes seconds
      fmt::print(out, "reading scan {}: {} MB\n", part.name, bytes / 1'000'000);
      out.flush();
    }
    ScanFile file = read_scan(part.file, is_by_tags ? Colouring::read : Colouring::ignored);
    for (const std::string& note : file.notes)
      fmt::print(out, "warning: scan {}: {}\n", part.name, note);
    insist_on_fine_steps(subject, part, file);
    std::optional<ScanTags> tags;
    if (is_by_tags)
      tags = tags_on(subject, part, file, tracking, out);
    else
      insist_on_surface(subject, part, file);
    scans.push_back({std::move(file), std::move(tags)});
  }
  return scans;
}

std::vector<NamedMesh> place_scans(const Parts& parts, const Layout& layout, const Shape& shape,
                                   const std::vector<ReadScan>& scans, std::ostream& out) {
  std::vector<NamedMesh> meshes;
  for (std::size_t i = 0; i < parts.scans.size(); ++i) {
    const ScanPart& part = parts.scans[i];
    const auto& [file, tags] = scans[i];
    const std::string subject = subject_of(parts, part);
    const std::vector<PointPair> points =
        tags ? tags->corners : marked_pairs(part, file, layout, shape);
    const ScanUnits units = units_of(subject, part, file, points);
    const Placement placed =
        place_scan(subject, points, units.unit_m, tags ? tags->grain * units.unit_m : 0);
    print_placement(part,
                    tags ? fmt::format("placed by {} ({} corners)",
                                       tracking::tags_in_words(tags->ids), points.size())
                         : fmt::format("{} points", points.size()),
                    units, placed, out);
    if (tags) warn_of_one_tag(part, *tags, units.unit_m, out);
    meshes.push_back(placed_scan(part, file, units, placed, out));
  }
  return meshes;
}

}  // namespace previz::model
