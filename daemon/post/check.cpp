#include "daemon/post/check.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <optional>
#include <ostream>
#include <sstream>
#include <string>
#include <vector>

#include "daemon/lighting/lighting.hpp"
#include "daemon/output/recorder.hpp"
#include "daemon/pipeline/room_model.hpp"
#include "daemon/pipeline/take.hpp"
#include "daemon/post/check_recording.hpp"
#include "daemon/post/implausible.hpp"
#include "daemon/render/feature.hpp"
#include "daemon/render/photon_schedule.hpp"
#include "daemon/render/picture_memory.hpp"
#include "daemon/scene/load.hpp"
#include "daemon/scene/scene.hpp"
#include "daemon/set/load.hpp"
#include "daemon/set/names.hpp"
#include "daemon/set/problems.hpp"
#include "daemon/set/set.hpp"
#include "daemon/tracking/trackers.hpp"
#include "drivers/error.hpp"
#include "drivers/session/session.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::post {
namespace {

namespace fs = std::filesystem;
using Lines = std::vector<std::string>;

// The set with the calibrations in force put into it, and further facts about it.
struct Checked {
  set::Set set;
  bool has_track = false;  // the session has poses
  bool is_take = false;    // its cameras are recorded
  Lines remarks;           // things that are allowed but unusual
};

// Writes digits in groups of three: 1 234 567.
std::string grouped(std::uint64_t number) {
  auto digits = std::to_string(number);
  for (auto at = static_cast<std::ptrdiff_t>(digits.size()) - 3; at > 0; at -= 3)
    digits.insert(static_cast<std::size_t>(at), 1, ' ');
  return digits;
}

std::string plural(std::uint64_t number, const std::string& noun) {
  return grouped(number) + ' ' + noun + (number == 1 ? "" : "s");
}

template <class... Parts>
std::string words(const Parts&... parts) {
  std::ostringstream text;
  text.precision(6);
  (text << ... << parts);
  return text.str();
}

Checked open(const fs::path& set_or_session) {
  Checked checked;
  if (fs::is_directory(set_or_session)) {
    auto take = pipeline::open_take(set_or_session, std::nullopt);
    checked.set = std::move(take.set);
    checked.set.observer.calibration = take.observer;
    checked.set.light_camera.calibration = take.light;
    checked.has_track = !take.session.track.empty();
    checked.is_take = true;
    checked.remarks = take.session.missing;
    if (!take.light_stream) checked.set.light_camera.driver = set::no_driver;
    return checked;
  }
  checked.set = set::load_set(set_or_session);
  auto& observer = checked.set.observer;
  auto& light = checked.set.light_camera;
  const auto replayed = [&](const std::string& camera, const std::string& driver,
                            const fs::path& device) {
    if (driver != set::replay_driver || device.empty()) return session::SessionInfo{};
    if (!fs::exists(device)) {
      checked.remarks.push_back(camera + ".device: no such session: " + device.string());
      return session::SessionInfo{};
    }
    const auto session = session::open_session(device);
    if (camera == "observer") checked.has_track = !session.track.empty();
    return session.info;
  };
  const auto observer_session = replayed("observer", observer.driver, observer.device);
  const auto light_session = replayed("light_camera", light.driver, light.device);
  if (!observer.calibration) observer.calibration = observer_session.observer;
  if (!light.calibration) light.calibration = light_session.light;
  return checked;
}

// Runs `work` and appends the words of an exception to `problems`.
void attempt(Lines& problems, const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& error) {
    problems.push_back(error.what());
  }
}

// Loads the scene, or appends the problems of each object's file.
std::optional<scene::Scene> load_scene(const set::Set& set, Lines& problems) {
  try {
    return scene::load_scene(set);
  } catch (const Error& whole) {
    const auto before = problems.size();
    for (const auto& object : set.objects) {
      auto alone = set;
      alone.objects = {object};
      alone.surfaces.clear();  // clears the other objects' too
      attempt(problems, [&] { scene::load_scene(alone); });
    }
    if (problems.size() == before) problems.push_back(whole.what());  // too much only together
    return std::nullopt;
  }
}

void check_environment(Checked& checked, Lines& problems) {
  if (!checked.set.lighting.environment) return;
  auto coarse = checked.set.lighting;
  coarse.resolution = 16;  // only the file is checked
  attempt(problems, [&] {
    for (const auto& note : lighting::load_environment(coarse).report.notes)
      checked.remarks.push_back(note);
  });
}

// Adds the problems for which a live set, or the rendering of a take, would be refused.
void check_cameras(const Checked& checked, Lines& problems) {
  const set::Lighting& lighting = checked.set.lighting;
  const bool from_camera = lighting.from == set::LightFrom::camera && !lighting.environment;
  if (checked.is_take && from_camera && checked.set.light_camera.driver == set::no_driver)
    problems.push_back(checked.set.file.string() + ": " + pipeline::no_light_words());
  if (checked.is_take) return;
  for (const std::string& line : other_sizes(checked.set))
    problems.push_back(checked.set.file.string() + ": " + line);
}

void check_room(const set::Set& set, Lines& problems) {
  if (!set.lighting.room) return;
  const auto& calibration = set.light_camera.calibration;
  const glm::dvec3 camera =
      calibration ? glm::dvec3(calibration->world_from_camera[3]) : set.lighting.room->seen_from;
  attempt(problems, [&] { pipeline::open_room(set, camera); });
}

void check_tracking(Checked& checked, Lines& problems) {
  const auto& tracking = checked.set.tracking;
  const auto& calibration = checked.set.observer.calibration;
  if (tracking.enabled && tracking.tags.empty())
    checked.remarks.push_back("tracking is on but there is no [[tag]]: no pose can be found");
  if (!tracking.enabled && !checked.has_track)
    checked.remarks.push_back("tracking is off: only a session with recorded poses can be used");
  if (tracking.enabled && calibration)
    attempt(problems, [&] { tracking::make_tracker(checked.set, *calibration, nullptr); });
}

void remark_on_cameras(Checked& checked) {
  const auto& set = checked.set;
  if (!set.observer.calibration)
    checked.remarks.push_back(
        "no film camera calibration here: it must come with the session to be rendered");
  const bool has_light_camera =
      set.light_camera.driver != set::no_driver && set.light_camera.calibration;
  if (set.lighting.from == set::LightFrom::camera && !set.lighting.environment && !has_light_camera)
    checked.remarks.push_back(
        "no environment and no calibrated light camera here: the session must supply the light");
}

// A take says how it was recorded, and nothing more is recorded by its set.
void check_recording(Checked& checked, Lines& problems) {
  if (checked.is_take) return;
  for (const std::string& line : why_nothing_is_recorded(checked.set)) problems.push_back(line);
  for (const std::string& line : remarks_on_recording(checked.set, output::memory_bytes()))
    checked.remarks.push_back(line);
}

void remark_on_scene(Checked& checked, const scene::Scene& scene) {
  for (const auto& note : scene.notes) checked.remarks.push_back(note);
  const auto has = [&](set::Presence presence) {
    return std::ranges::find(checked.set.objects, presence, &set::Object::presence) !=
           checked.set.objects.end();
  };
  const bool relit = std::ranges::any_of(scene.lights, &set::Light::is_relit);
  if (!has(set::Presence::virtual_object) && !has(set::Presence::removed) && !relit)
    checked.remarks.push_back(
        "nothing is virtual, removed or relit: the composite will equal the plate");
  else if (!has(set::Presence::phantom))
    checked.remarks.push_back(
        "no phantom: nothing real can catch shadows or hide a virtual object");
}

void print_cameras(const set::Set& set, std::ostream& out) {
  const auto device = [](const std::string& driver, const std::string& name) {
    return words(driver, name.empty() ? "" : " of ", name);
  };
  out << "\ncameras\n  observer      " << device(set.observer.driver, set.observer.device);
  if (const auto& c = set.observer.calibration) {
    out << words(", ", c->intrinsics.width, "x", c->intrinsics.height, ", ");
    if (c->lens)
      out << words(c->lens->focal_length_m * 1e3, " mm lens at f/", c->lens->f_number,
                   ", focus at ", c->lens->focus_distance_m, " m");
    else
      out << "everything in focus";
  }
  out << "\n  light camera  " << device(set.light_camera.driver, set.light_camera.device);
  if (const auto& c = set.light_camera.calibration; c && set.light_camera.driver != set::no_driver)
    out << words(", ", c->intrinsics.width, "x", c->intrinsics.height, ", calibrated to ",
                 c->intrinsics.max_angle_rad * 180 / std::numbers::pi, " degrees off axis");
  out << '\n';
}

void print_tags(const set::Tracking& tracking, std::ostream& out) {
  out << "\ntracking\n  ";
  if (!tracking.enabled) {
    out << "off: uses the poses recorded in the session\n";
    return;
  }
  out << plural(tracking.tags.size(), "tag") << " of family " << tracking.family;
  const char* separator = ": ";
  for (const auto& tag : tracking.tags) {
    out << separator << words(tag.id, " (", std::round(tag.size_m * 1e4) / 10, " mm)");
    separator = ", ";
  }
  out << '\n';
  for (const set::Carrier& carrier : tracking.carriers) {
    out << "  carrier " << carrier.name << ": " << plural(carrier.tags.size(), "tag");
    separator = ": ";
    for (const auto& tag : carrier.tags) {
      out << separator << words(tag.id, " (", std::round(tag.size_m * 1e4) / 10, " mm)");
      separator = ", ";
    }
    out << '\n';
  }
}

void print_objects(const set::Set& set, const scene::Scene& scene, std::ostream& out) {
  if (set.objects.empty()) return;
  std::vector<std::uint64_t> triangles(set.objects.size()), instances(set.objects.size());
  for (const auto& instance : scene.instances) {
    ++instances[instance.object];
    triangles[instance.object] += scene.meshes[instance.mesh].triangles.size();
  }
  out << "\nobjects\n";
  for (std::size_t i = 0; i < set.objects.size(); ++i) {
    const auto& object = set.objects[i];
    out << "  " << object.name << ": " << set::name_of(object.presence) << ", "
        << plural(triangles[i], "triangle") << " in " << plural(instances[i], "instance")
        << ", from " << object.file_as_written;
    if (!object.variant.empty()) out << ", variant \"" << set::printable(object.variant) << '"';
    out << '\n';
    const scene::Variants* variants = scene::variants_of(scene, i);
    if (!variants) continue;
    out << "    its variants, for the buttons:";
    const char* separator = " ";
    for (const std::string& name : variants->names) {
      out << separator << '"' << set::printable(name) << '"';
      separator = ", ";
    }
    out << '\n';
  }
}

void print_lights(const set::Set& set, const scene::Scene& scene, std::ostream& out) {
  const auto& lighting = set.lighting;
  out << "\nlight\n  environment: "
      << (lighting.environment                   ? "the file " + lighting.environment_as_written
          : lighting.from == set::LightFrom::set ? std::string("none")
          : lighting.from == set::LightFrom::recording ? std::string("as the session recorded it")
          : set.light_camera.driver == set::no_driver
              ? std::string("from the session's light camera, if it has one; this set has none")
              : words("from the light camera; outside its view: ", set::name_of(lighting.unseen)))
      << '\n';
  if (lighting.mode == set::LightMode::sources)
    out << "    its lamps light the set; the rest is " << set::name_of(lighting.sources.residual)
        << '\n';
  if (lighting.mode == set::LightMode::hybrid)
    out << "    its lamps light the set, and the rest as a picture\n";
  const auto print = [&](const std::string& name, const std::string& kind, double mixed,
                         double real, const glm::dvec3& tint, const std::string& more) {
    const char* change = real == 0                          ? "added"
                         : mixed * tint == glm::dvec3(real) ? "as it is"
                         : mixed == 0                       ? "switched off"
                         : mixed < real                     ? "dimmed"
                         : mixed > real                     ? "brightened"
                                                            : "tinted";
    out << "  " << (name.empty() ? "(no name)" : name) << ": " << kind << ", " << change
        << words(", gain ", mixed, " in the composite, ", real, " on the real set");
    if (tint != glm::dvec3(1)) out << words(", tint ", tint.r, ' ', tint.g, ' ', tint.b);
    out << more << '\n';
  };
  for (const auto& light : scene.lights)
    print(light.name, set::name_of(light.type), light.gain_mixed, light.gain_real, light.tint,
          light.captured ? words("; subtracted from the environment light",
                                 light.measured ? ", which gives its brightness" : "")
                         : "");
  for (const auto& lamp : set.captured_lamps)
    print(lamp.name,
          words("within ", lamp.cone_rad * 180 / std::numbers::pi,
                " degrees of its direction in the environment light"),
          lamp.gain_mixed, 1, lamp.tint, "; subtracted from it");
}

void print_estimator(const set::Set& set, std::ostream& out) {
  const auto& e = set.estimation;
  out << "\nestimator\n  " << set::name_of(e.estimator) << ", " << set::name_of(e.composite) << ", "
      << plural(static_cast<std::uint64_t>(set.quality.samples), "sample")
      << " per pixel and frame, at most " << e.max_depth << " bounces, caustics "
      << set::name_of(e.caustics) << ", seed " << e.seed << '\n';
}

void print_features(const render::Demand& demand, const scene::Size& size, std::ostream& out) {
  Lines used, unused;
  for (const render::Feature& feature : render::features()) {
    const bool needed = render::is_needed(feature, demand);
    (needed ? used : unused)
        .push_back(words(feature.name, ": ", needed ? feature.used : feature.left_out));
  }
  out << "\nthis set uses\n  geometry: " << plural(size.triangles, "triangle") << ", or "
      << grouped(size.instanced_triangles) << " counting every copy of an object\n";
  for (const auto& line : used) out << "  " << line << '\n';
  out << "\nnot used by this set, so switched off\n";
  for (const auto& line : unused) out << "  " << line << '\n';
}

constexpr double mebibyte = 1024.0 * 1024.0;

void print_picture_memory(const set::Quality& quality, const PinholeIntrinsics& intrinsics,
                          std::ostream& out) {
  const bool averaged_live = quality.denoise && quality.accumulate;
  const bool averaged_offline = quality.denoise && quality.neighbours > 0;
  std::uint64_t picture_bytes = render::picture_bytes(intrinsics.width, intrinsics.height, false);
  if (averaged_live || averaged_offline)
    picture_bytes += render::history_bytes(intrinsics.width, intrinsics.height);
  out << words("  picture in the GPU's memory: about ",
               std::ceil(static_cast<double>(picture_bytes) / mebibyte), " MiB\n");
  if (averaged_offline)
    out << words("  frames that are averaged offline in the computer's memory: about ",
                 std::ceil(static_cast<double>(render::kept_bytes(
                               intrinsics.width, intrinsics.height,
                               {quality.neighbours, std::numeric_limits<std::uint64_t>::max()})) /
                           mebibyte),
                 " MiB\n");
}

// Estimates what a frame asks of the GPU, without measuring; `previzd trade` measures.
void print_costs(const set::Set& set, std::uint32_t needed, const scene::Size& size,
                 std::ostream& out) {
  // These are the bytes a vertex, triangle and texel in lib/render_shared.h's buffers; a tree of
  // pairs takes about one record of 64 bytes a triangle.
  // Levels of textures take a third more.
  const double a_texel = (needed & gpu::FEATURE_FILTERED_TEXTURES) != 0 ? 8.0 * 4 / 3 : 8.0;
  const double scene_bytes =
      32.0 * size.vertices + (16.0 + 64.0) * size.triangles + a_texel * size.texels;
  constexpr auto any_number = std::numeric_limits<std::uint32_t>::max();
  out << "\na frame costs\n";
  out << words("  scene in the GPU's memory: about ", std::ceil(scene_bytes / mebibyte), " MiB\n");
  if (!set.observer.calibration) return;
  const auto& intrinsics = set.observer.calibration->intrinsics;
  const double pixels = static_cast<double>(intrinsics.width) * intrinsics.height;
  const double samples = pixels * set.quality.samples;
  print_picture_memory(set.quality, intrinsics, out);
  // A path has a segment and a light sample a bounce, and one more segment; twice as many where the
  // worlds part.
  const double most = samples * (2.0 * set.estimation.max_depth + 1) *
                      ((needed & gpu::FEATURE_FORKS) != 0 ? 2.0 : 1.0);
  out << "  rays: " << grouped(static_cast<std::uint64_t>(2 * samples)) << " at least, "
      << grouped(static_cast<std::uint64_t>(most)) << " at most\n";
  if ((needed & gpu::FEATURE_PHOTONS) != 0)
    out << "  photons: "
        << grouped(std::uint64_t{render::photon_count(set.estimation.photons, intrinsics.width,
                                                      intrinsics.height, any_number)} *
                   static_cast<std::uint64_t>(set.quality.samples))
        << '\n';
}

int refuse(const Lines& problems, std::ostream& out) {
  std::string all;
  for (const auto& problem : problems) all += problem + '\n';
  const auto count = static_cast<std::uint64_t>(std::ranges::count(all, '\n'));
  out << all << plural(count, "problem") << '\n';
  return 1;
}

}  // namespace

int check_set(const fs::path& set_or_session, std::ostream& out) {
  Lines problems;
  Checked checked;
  attempt(problems, [&] { checked = open(set_or_session); });
  if (!problems.empty()) return refuse(problems, out);

  const auto scene = load_scene(checked.set, problems);
  check_environment(checked, problems);
  check_room(checked.set, problems);
  check_cameras(checked, problems);
  check_tracking(checked, problems);
  check_recording(checked, problems);
  if (!problems.empty()) return refuse(problems, out);

  for (const std::string& line : implausible(checked.set)) checked.remarks.push_back(line);
  remark_on_cameras(checked);
  remark_on_scene(checked, *scene);
  out << checked.set.name << " (" << checked.set.file.string() << ") is valid\n";
  print_cameras(checked.set, out);
  print_tags(checked.set.tracking, out);
  print_objects(checked.set, *scene, out);
  print_lights(checked.set, *scene, out);
  print_estimator(checked.set, out);
  if (!checked.is_take) print_recording(checked.set, out);
  const scene::Size size = scene::size_of(*scene);
  const render::Demand demand = render::demand_of(
      checked.set, *scene,
      render::material_features(*scene, checked.set.estimation.specular_roughness));
  print_features(demand, size, out);
  print_costs(checked.set, render::needed_bits(demand), size, out);
  if (!checked.remarks.empty()) out << "\nworth checking\n";
  for (const auto& remark : checked.remarks) out << "  " << remark << '\n';
  return 0;
}

}  // namespace previz::post
