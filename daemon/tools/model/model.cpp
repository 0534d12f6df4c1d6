#include "daemon/tools/model/model.hpp"

#include <fmt/ostream.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <vector>

#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/scene/load.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/set/check.hpp"
#include "daemon/core/set/file_edit.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/core/set/problems.hpp"
#include "daemon/tools/calibrate/known_camera.hpp"
#include "daemon/tools/calibrate/lens/report.hpp"
#include "daemon/tools/calibrate/lens/source.hpp"
#include "daemon/tools/model/colours.hpp"
#include "daemon/tools/model/fit.hpp"
#include "daemon/tools/model/glb.hpp"
#include "daemon/tools/model/on_phantom.hpp"
#include "daemon/tools/model/overlay.hpp"
#include "daemon/tools/model/parts.hpp"
#include "daemon/tools/model/parts_text.hpp"
#include "daemon/tools/model/pictures.hpp"
#include "daemon/tools/model/rig_marks.hpp"
#include "daemon/tools/model/scans.hpp"
#include "daemon/tools/model/solids.hpp"
#include "daemon/tools/model/start.hpp"
#include "daemon/tools/model/tag_papers.hpp"
#include "daemon/tools/model/under_tags.hpp"
#include "daemon/tools/model/views.hpp"
#include "drivers/error.hpp"
#include "drivers/keys/value.hpp"

namespace previz::model {
namespace {

// A face that may be off by more is worth another picture.
constexpr double accurate_m = 2e-3;

set::Set set_of(const ModelOptions& options) {
  if (options.set_file) return set::load_set(*options.set_file);
  if (calibrate::is_session(options.footage)) return pipeline::open_take(options.footage, {}).set;
  throw Error(options.footage.string() +
              ": is not a session; name the set with --set, for its tags and lens");
}

std::filesystem::path file_of(const ModelOptions& options) {
  if (options.out) return *options.out;
  if (!options.parts_file.empty())
    return std::filesystem::path(options.parts_file).replace_extension(".glb");
  // Without a file of parts the model is named as the take is, and goes beside the set file, or
  // into the current folder; never into the take.
  const std::filesystem::path take = std::filesystem::absolute(options.footage / "");
  const std::string name = take.lexically_normal().parent_path().filename().string() + ".glb";
  return options.set_file ? options.set_file->parent_path() / name : std::filesystem::path(name);
}

// The three marks that are farthest off: where to look again.
void print_worst_marks(std::vector<MarkResidual> marks, std::ostream& out) {
  constexpr std::size_t most = 3;
  std::ranges::sort(marks, std::greater(), &MarkResidual::off_px);
  marks.resize(std::min(marks.size(), most));
  std::string list;
  for (const MarkResidual& mark : marks)
    list += fmt::format("{}\"{}\" in {} by {:.1f} px", list.empty() ? "" : ", ", mark.point,
                        mark.picture, mark.off_px);
  if (!list.empty()) fmt::print(out, "farthest off: {}\n", list);
}

void print_unused(const Parts& parts, const Layout& layout, std::ostream& out) {
  std::vector<std::string> used;
  for (const auto& [name, place] : layout.places) used.push_back(name);
  for (const std::string& point : layout.unused_points) {
    const std::string meant = set::nearest(point, used);
    fmt::print(out, "warning: {}: point \"{}\" belongs to no part and is ignored{}\n",
               parts.file.string(), point, meant.empty() ? "" : "; did you mean " + meant + "?");
  }
}

void print_fit(const Parts& parts, const Layout& layout, const Fit& fit, std::ostream& out) {
  std::set<std::string> pictures;
  for (const MarkResidual& mark : fit.marks) pictures.insert(mark.picture);
  if (!fit.marks.empty())
    fmt::print(out, "{} in {}, rms {:.2f} px\n", set::plural(fit.marks.size(), "mark"),
               set::plural(pictures.size(), "picture"), fit.rms_px);
  print_worst_marks(fit.marks, out);
  if (!fit.edges_off_px.empty()) {
    std::vector<double> off = fit.edges_off_px;
    std::ranges::sort(off);
    fmt::print(out,
               "{} pieces of edges found in the pictures: the model is {:.2f} px off in the "
               "median, and 90 % of them by at most {:.2f} px\n",
               off.size(), off[off.size() / 2], off[off.size() * 9 / 10]);
  }
  if (fit.mark_factor > 1.5)
    fmt::print(out,
               "warning: the marks disagree by {:.1f} times their accuracy of {:g} px; look at "
               "those that are farthest "
               "off again, or give their accuracy: [marks] with accuracy_px\n",
               fit.mark_factor, parts.mark_px);
  print_unused(parts, layout, out);
  for (std::size_t i = 0; i < parts.boxes.size(); ++i) {
    glm::dvec3 mm = 1000.0 * fit.shape.boxes[i].size;
    if (layout.is_clockwise[i]) std::swap(mm.x, mm.y);  // length and width as they are marked
    fmt::print(out, "{}: {:.1f} x {:.1f} x {:.1f} mm\n", parts.boxes[i].name, mm.x, mm.y, mm.z);
  }
  for (std::size_t i = 0; i < parts.cylinders.size(); ++i)
    fmt::print(out, "{}: diameter {:.1f} mm, height {:.1f} mm\n", parts.cylinders[i].name,
               2000 * fit.shape.cylinders[i].radius, 1000 * fit.shape.cylinders[i].height);
}

// The faces of a part, each name once, with what to do about those that are uncertain.
void print_faces(const Fit& fit, std::ostream& out) {
  std::vector<FaceAccuracy> faces;
  for (const FaceAccuracy& face : fit.faces) {
    const auto same = std::ranges::find_if(
        faces, [&](const FaceAccuracy& f) { return f.part == face.part && f.face == face.face; });
    if (same == faces.end())
      faces.push_back(face);
    else
      same->sigma_m = std::max(same->sigma_m, face.sigma_m);
  }
  for (const FaceAccuracy& face : faces) {
    fmt::print(out, "  {}, {}: accurate to {:.1f} mm", face.part, face.face, 1000 * face.sigma_m);
    if (face.sigma_m > accurate_m)
      out << "; to improve it, mark its corners in pictures from other sides and nearer by, or put "
             "a tag on it";
    out << '\n';
  }
}

// Returns nothing if no colours are wanted or nothing shows the light.
std::unique_ptr<ColourComparison> comparison(const ModelOptions& options, bool has_tags,
                                             std::ostream& out) {
  if (options.grey) return {};
  if (!calibrate::is_session(options.footage)) {
    out << "colours: all faces are grey, because pictures alone do not show the light; name a "
           "session in their place to measure the colours\n";
    return {};
  }
  out << "colours: reading the take" << std::endl;
  pipeline::Take take = pipeline::open_take(options.footage, options.set_file);
  const render::DeviceOptions wanted =
      render::options_for(options.device, take.set.quality.hardware_rays);
  return std::make_unique<ColourComparison>(std::move(take), render::open_device(wanted), has_tags,
                                            out, options.terminal);
}

void print_colour(const std::string& name, const Colour& colour, std::ostream& out) {
  fmt::print(out, "  {}: colour (albedo) {:.3f} {:.3f} {:.3f}", name, colour.albedo.r,
             colour.albedo.g, colour.albedo.b);
  if (colour.sigma != glm::dvec3(0))
    fmt::print(out, ", accurate to {:.4f} {:.4f} {:.4f} in this light", colour.sigma.r,
               colour.sigma.g, colour.sigma.b);
  out << '\n';
  if (std::max({colour.albedo.r, colour.albedo.g, colour.albedo.b}) > 1)
    fmt::print(out,
               "warning: {} reflects more light than falls on it: the light and the film camera "
               "disagree; run previz calibrate balance with a surface of known colour first\n",
               name);
}

// Reports the measured colours, and returns what the model gets: `usual` ones of tags that were not
// measured, and grey for all else.
Colours reported(const std::map<std::string, Colour>& colours,
                 const std::map<std::string, glm::dvec3>& usual,
                 const std::vector<std::string>& names, std::ostream& out) {
  Colours albedos = usual;
  for (const std::string& name : names) {
    const auto found = colours.find(name);
    if (found != colours.end()) {
      print_colour(name, found->second, out);
      albedos[name] = glm::clamp(found->second.albedo, 0.0, 1.0);
    } else if (!colours.empty()) {
      fmt::print(out, "  {}: no plate shows enough of it; {}\n", name,
                 usual.contains(name) ? "it gets the usual colour of tags" : "it stays grey");
    }
  }
  return albedos;
}

bool is_same(const std::filesystem::path& a, const std::filesystem::path& b) {
  return std::filesystem::weakly_canonical(a) == std::filesystem::weakly_canonical(b);
}

// Refuses to replace what the model is made of.
void insist_on_outputs(const ModelOptions& options) {
  const std::filesystem::path file = file_of(options);
  if (file.extension() != ".glb")
    throw Error(file.string() + ": the model is a .glb file; name one with --out");
  if (is_same(file, options.footage))
    throw Error(file.string() + ": is the footage; name another file with --out");
}

void insist_on_scans(const ModelOptions& options, const Parts& parts) {
  const std::filesystem::path file = file_of(options);
  for (const ScanPart& scan : parts.scans)
    if (is_same(file, scan.file))
      throw Error(file.string() + ": is a scan of the model; name another file with --out");
}

bool is_taken(const set::FileEdit& edit, const std::string& name) {
  for (std::size_t i = 0; i < edit.count("object"); ++i)
    if (edit.written("object", i, "name") == codec::quote(name)) return true;
  return false;
}

// Returns the set file's text with the model; nothing if the set has it. Throws previz::Error if
// the file cannot be changed.
std::optional<std::string> with_model(const std::filesystem::path& set_file, const set::Set& set,
                                      const ModelOptions& options) {
  const std::filesystem::path model = file_of(options);
  for (const set::Object& object : set.objects) {
    if (!is_same(object.file, model)) continue;
    if (object.presence == set::Presence::phantom) return {};
    throw Error(fmt::format(
        "{}: has {} as the object \"{}\", which is not a phantom; name another file with --out",
        set_file.string(), model.string(), object.name));
  }
  set::FileEdit edit(set::read_set_file(set_file));
  const std::string name =
      std::filesystem::relative(std::filesystem::absolute(model),
                                std::filesystem::absolute(set_file).parent_path())
          .string();
  std::string own = model.stem().string();
  for (int number = 2; is_taken(edit, own); ++number)
    own = fmt::format("{} {}", model.stem().string(), number);
  edit.append(fmt::format("[[object]]\nname = {}\nfile = {}\npresence = \"phantom\"\n",
                          codec::quote(own), codec::quote(name)));
  // The model is not there yet; another file stands in for it.
  set::parse_set(edit.text(), set_file, {{name, std::filesystem::absolute(set_file)}});
  return edit.text();
}

void warn_of_others(const set::Set& set, const std::filesystem::path& model, std::ostream& out) {
  for (const set::Object& object : set.objects)
    if (object.presence == set::Presence::phantom && !is_same(object.file, model))
      fmt::print(out,
                 "the set has a phantom \"{}\" beside this model; remove its [[object]] if it is "
                 "of the same things, or keep it and make the tags alone, with --tags-only\n",
                 object.name);
}

// An adjusted model, of which colours are measured.
struct Adjusted {
  const Parts& parts;
  const Views& views;
  const Layout& layout;
  const Shape& shape;
};

// Adds what is shown in place of tags that are hidden.
void add_under_tags(ColourComparison& comparison, const TaggedModel& model,
                    std::vector<NamedMesh>& meshes, std::ostream& out) {
  if (model.layout.tags.empty()) return;
  const calibrate::SurfacePixels seen = comparison.look_around(meshes, model.colours);
  for (UnderTag& under : under_tags(model, seen, comparison.take().observer.intrinsics)) {
    if (under.mesh.mesh.positions.empty()) {
      fmt::print(out,
                 "  tag {}: no plate shows enough of what is around it; if tags are hidden, its "
                 "place has the colour of the whole surface\n",
                 under.id);
      continue;
    }
    fmt::print(out, "  under tag {}: continued from {} pixels around it\n", under.id, under.pixels);
    // Seen from far away it coincides with what it lies on, and the first of the two is what is
    // hit.
    meshes.insert(meshes.begin(), std::move(under.mesh));
  }
}

// Puts tags onto the phantoms that the set has beside this model.
void put_onto_phantoms(const ModelOptions& options, set::Set set, const Adjusted& at,
                       std::vector<NamedMesh>& tags, std::ostream& out) {
  std::erase_if(set.objects, [&](const set::Object& object) {
    return object.presence != set::Presence::phantom || is_same(object.file, file_of(options));
  });
  set.surfaces.clear();
  const PhantomSurface phantoms(scene::load_scene(set), set);
  double most_m = 0;
  std::set<int> beside;
  for (NamedMesh& mesh : tags) {
    const int id = scene::named_tag(mesh.name).id;
    const auto flat =
        std::ranges::find(at.layout.tags, id, [](const FlatTag& tag) { return tag.tag->id; });
    const auto moved = phantoms.put(mesh, ground_of(*flat, at.shape));
    most_m = std::max(most_m, moved.value_or(0));
    if (!moved) beside.insert(id);
  }
  fmt::print(out,
             "tags are put onto the set's phantoms, at most {:.1f} mm from where they are seen\n",
             1000 * most_m);
  for (const int id : beside)
    fmt::print(
        out,
        "warning: the set has no phantom within 20 mm of tag {}: hidden, its place will show "
        "an edge\n",
        id);
}

// Returns the bytes of the model's file, with the tags and the colours of everything.
std::string coloured_model(const ModelOptions& options, const set::Set& set, const Adjusted& at,
                           const std::vector<Solid>& solids, const std::vector<NamedMesh>& scans,
                           const ResponseCurve& response, std::ostream& out) {
  std::vector<NamedMesh> meshes;
  for (const Solid& solid : solids) meshes.push_back(mesh_of(solid));
  meshes.insert(meshes.end(), scans.begin(), scans.end());
  const auto lit = comparison(options, !at.layout.tags.empty(), out);
  std::map<std::string, Colour> colours;
  if (lit) colours = lit->measure(meshes);
  colours.merge(
      tag_colours(set.tracking.family, at.layout, at.views, at.shape, solids, response, colours));
  for (const Solid& tag : tag_solids(set.tracking.family, at.layout, at.parts, at.shape))
    meshes.push_back(mesh_of(tag));
  std::vector<std::string> names;
  for (const NamedMesh& mesh : meshes) names.push_back(mesh.name);
  const Colours albedos = reported(colours, usual_tag_colours(at.layout), names, out);
  if (lit)
    add_under_tags(*lit, {set.tracking.family, at.parts, at.layout, at.shape, solids, albedos},
                   meshes, out);
  if (options.tags_only) {
    std::erase_if(meshes, [](const NamedMesh& mesh) {
      return scene::named_tag(mesh.name).part == scene::TagPart::none;
    });
    put_onto_phantoms(options, set, at, meshes, out);
  }
  return glb_of(meshes, albedos);
}

// Only a session has marks of the rig.
void insist_on_parts(const ModelOptions& options) {
  if (options.parts_file.empty() && !options.tags_only && !calibrate::is_session(options.footage))
    throw Error(options.footage.string() +
                ": is not a session, and only those have marks that were made on the rig; give "
                "--parts, the file that lists the scene's parts, which --pictures FOLDER writes");
}

// Returns the parts that were marked on the rig: boxes, and the planes that they stand on.
Parts marked_parts(const ModelOptions& options, const ObserverCalibration& camera,
                   const set::Tracking& tracking, std::ostream& out) {
  const std::string footage = options.footage.string();
  const RigMarks marks = rig_marks(options.footage, camera, tracking);
  for (const std::string& what : marks.missing) fmt::print(out, "warning: {}\n", what);
  if (marks.pictures.empty())
    throw Error(footage +
                (marks.missing.empty()
                     ? ": nothing was marked on the rig while it was recorded; give "
                     : ": none of its marks can be used; give ") +
                "--parts, the file that lists the scene's parts, which --pictures FOLDER writes to "
                "be filled in");
  const MarkedBoxes marked = boxes_of(marks, tracking.tags, options.footage);
  for (const std::string& remark : marked.remarks) fmt::print(out, "{}\n", remark);
  if (marked.boxes.empty())
    throw Error(footage +
                ": none of the boxes that were marked can be made; mark the rest in another take, "
                "or go on with --pictures FOLDER, which writes the marks into a file of parts");
  std::vector<TagPlane> planes = tag_planes(tracking.tags);
  std::erase_if(planes, [&](const TagPlane& plane) {
    const bool carries =
        std::ranges::find(marked.boxes, plane.name, &BoxPart::on) != marked.boxes.end();
    if (!carries)
      fmt::print(out, "{} (tags {}) carries no box and is not in the model\n", plane.name,
                 fmt::join(plane.tags, ", "));
    return !carries;
  });
  // The model follows the edges of further pictures, too.
  const std::vector<MarkedPicture> pictures =
      only_of(marked.boxes, with_marks(pictures_apart(options.footage, camera, tracking), marks));
  return parse_parts(parts_text(pictures, planes, marked.boxes), options.footage);
}

// Returns the parts that the file lists; without one, the planes of the tags if these are all that
// is wanted, else what was marked on the rig.
Parts parts_of(const ModelOptions& options, const ObserverCalibration& camera,
               const set::Tracking& tracking, std::ostream& out) {
  if (!options.parts_file.empty())
    return parse_parts(session::read_file(options.parts_file, {"a file of parts", 1 << 22}),
                       options.parts_file);
  if (!options.tags_only) return marked_parts(options, camera, tracking, out);
  const auto pictures = with_marks(pictures_apart(options.footage, camera, tracking), {});
  return parse_parts(parts_text(pictures, tag_planes(tracking.tags), {}), options.footage);
}

}  // namespace

void make_model(const ModelOptions& options, std::ostream& out) {
  if (options.pictures)
    return write_pictures(options.footage,
                          calibrate::known_observer(options.set_file, options.footage),
                          set_of(options).tracking, *options.pictures, out);
  if (options.write && !options.set_file)
    throw Error("--write needs --set: it changes that set file");
  insist_on_parts(options);
  const set::Set set = set_of(options);
  const ObserverCalibration camera = calibrate::known_observer(options.set_file, options.footage);
  insist_on_outputs(options);
  const Parts parts = parts_of(options, camera, set.tracking, out);
  insist_on_scans(options, parts);
  const std::vector<ReadScan> read = read_scans(parts, set.tracking, out);
  const auto edited = options.write ? with_model(*options.set_file, set, options) : std::nullopt;
  out << options.footage.string() << ": looking for tags and edges" << std::endl;
  const auto source = calibrate::open_source(options.footage, "observer");
  const Views views = find_views(*source, camera, set.tracking, parts);
  const Start start = first_guess(parts, views, set.tracking.tags);
  if (options.tags_only && start.layout.tags.empty())
    throw Error(parts.file.string() +
                ": no tag lies on a part; list tags in a [[plane]] or a [[box]]");
  const Fit fit = adjust_to_edges(parts, views, start, camera.response);
  print_fit(parts, start.layout, fit, out);
  print_faces(fit, out);
  const std::vector<NamedMesh> scans = place_scans(parts, start.layout, fit.shape, read, out);
  const std::vector<Solid> solids = solids_of(parts, start.layout, fit.shape, &views);
  const std::string model = coloured_model(options, set, {parts, views, start.layout, fit.shape},
                                           solids, scans, camera.response, out);
  const std::filesystem::path file = file_of(options);
  session::replace_file(file, model);
  fmt::print(out, "model: {}\n", file.string());
  if (options.overlay && !views.views.empty())
    write_overlays(views, fit.shape, solids, *options.overlay);
  if (options.overlay && !scans.empty()) out << "scans are not drawn over the pictures\n";
  if (!options.tags_only) warn_of_others(set, file, out);
  if (edited) {
    calibrate::write_back(*options.set_file, *edited, out);
  } else if (options.write) {
    fmt::print(out, "{}: lists this model already and stays as it is\n",
               options.set_file->string());
  }
}

}  // namespace previz::model
