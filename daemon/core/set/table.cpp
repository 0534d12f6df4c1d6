#include "daemon/core/set/table.hpp"

#include <string_view>
#include <variant>

#include "daemon/core/set/actions.hpp"
#include "daemon/core/set/tag_families.hpp"
#include "drivers/camera_drivers.hpp"
#include "drivers/display_drivers.hpp"

namespace previz {

template <>
struct Codec<DisplayMode> {
  static DisplayMode read(const Value& value, const Rule& rule) {
    if (const auto mode = parse_display_mode(codec::text(value))) return *mode;
    codec::misread(value, describe(rule));
  }
  static std::string print(const DisplayMode& mode, const Rule&) {
    return codec::quote(to_string(mode));
  }
  static std::string describe(const Rule&) { return "text, WIDTHxHEIGHT or WIDTHxHEIGHT@RATE"; }
};

namespace set {
namespace {

using namespace units;
using calibration::far_m, calibration::max_picture_side_px;

constexpr Unit seconds{"s", 1}, stops{"stops", 1}, megabytes{"MB", 1};

// What nobody can mean is refused where it is written, and not met as a picture without sense.
constexpr double least_m = 1e-6, most_radiance = 1e12, most_gain = 1e6;
constexpr Rule place = m.within(-far_m, far_m);
constexpr Rule turn = deg.within(-36'000, 36'000);  // a hundred times around
constexpr Rule axis = plain.within(-1e6, 1e6);      // of a direction, whose length does not matter
constexpr Rule matrix = plain.within(-far_m, far_m);
constexpr Rule length = m.within(least_m, far_m);
constexpr Rule radiance = plain.within(0, most_radiance);
constexpr Rule gain = plain.within(0, most_gain);
constexpr Rule absolute_exposure = plain.within(1e-12, 1e12);
constexpr Rule shutter = seconds.within(1e-7, 100);

// Lists what a camera's `driver` may be: a replayed session, a camera driver, or none.
std::span<const char* const> camera_driver_words() {
  static const std::vector<const char*> words = [] {
    std::vector<const char*> all{replay_driver};
    for (const char* name : camera_driver_names()) all.push_back(name);
    all.push_back(no_driver);
    return all;
  }();
  return words;
}

std::span<const char* const> display_driver_words() {
  static const std::vector<const char*> words = [] {
    std::vector<const char*> all;
    for (const char* name : display_driver_names()) all.push_back(name);
    all.push_back(no_driver);
    return all;
  }();
  return words;
}

Need required(const char* example) {
  return {Need::Kind::required, example};
}
Need optional(const char* example) {
  return {Need::Kind::optional, example};
}

using Keys = std::vector<Key>;

// Returns the keys of a calibration that stand in one table.
template <class Draft>
Keys calibration_keys(Draft& draft, std::string_view table) {
  Keys rows;
  for (const calibration::Key& key : calibration::keys(draft))
    if (key.table == table)
      std::visit(
          [&](auto* to) {
            rows.push_back({key.name, to, key.rule, key.about, key.need});
          },
          key.to);
  return rows;
}

// One row, one line: name, where its value goes, unit and range, what it means, what if left out.
// clang-format off

Keys set_keys(Set& set) {
  return {
      {"name", &set.name, plain, "What the crew calls this set. Default: the file's name.", optional("\"desk\"")},
  };
}

Keys observer_keys(Observer& o) {
  return {
      {"driver", &o.driver, Rule{.words = camera_driver_words()}, "Driver of the film camera."},
      {"device", &o.device, plain, "The camera's stable name, as `previzd devices` lists it; for replay the folder of the session, relative to this file. Default: the session named on the command line.", optional("\"sessions/take1\"")},
      {"faults", &o.faults, plain, "Faults to simulate, for rehearsals, and the frames at which they happen: drop, corrupt, late, stall, disconnect.", optional("[\"stall@250\", \"disconnect@1000+2.5s\"]")},
      {"exposure", &o.exposure, absolute_exposure, "Absolute exposure, overriding the frames' own: signal = exposure * radiance, where a signal of 1 is the sensor's white.", optional("1.0")},
  };
}

Keys lens_fit_keys(LensFit& f) {
  return {
      {"values", &f.values, plain.within(-1e9, 1e9), "fx, fy, cx, cy, k1, k2, p1, p2 and k3 as the boards have them if none is left at 0: 9 numbers.", required("[1850.0, 1850.0, 959.5, 539.5, -0.1, 0.02, 0.0, 0.0, 0.0]")},
      {"covariance_root", &f.covariance_root, plain.within(-1e9, 1e9), "How far off they may be, together: the lower triangle, row by row, of the matrix L whose L L^T is their covariance; 45 numbers.", required("[0.4, 0.0, 0.4, 0.0, 0.0, 0.6, 0.0, 0.0, 0.0, 0.6, 0.0, 0.0, 0.0, 0.0, 0.002, 0.0, 0.0, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0001, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0001, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.02]")},
  };
}

Keys camera_keys(CameraWish& wish) {
  CameraSettings& c = wish.settings;
  return {
      {"pixel_format", &c.format, plain, "Pixel format, by the driver's name: YUYV, NV12, YU12 (planar 4:2:0; YUV420 in libcamera) and so on. Formats with more bits are worth their bandwidth.", optional("\"BayerRG12\"")},
      {"width", &c.width, px.within(1, max_picture_side_px), "Width of the pictures; height must be given as well.", optional("1920")},
      {"height", &c.height, px.within(1, max_picture_side_px), "Height of the pictures; width must be given as well.", optional("1080")},
      {"rate_hz", &c.rate_hz, plain.within(0.001, 1e4), "Frames per second. Of a rate that the camera does not have, a message lists those that it has: aravis refuses it, and v4l2 and libcamera use the nearest.", optional("25.0")},
      {"exposure_s", &c.exposure_s, shutter, "Shutter time. Turns the camera's automatic exposure off.", optional("0.01")},
      {"gain", &c.gain, plain.within(1, 1e4), "Linear gain, for cameras that report their gain in dB.", optional("2.0")},
      {"raw_gain", &c.raw_gain, plain.within(-most_gain, most_gain), "Gain in the camera's own units. Its effect must be included in the responsivity.", optional("64.0")},
      {"white_balance_k", &c.white_balance_k, plain.within(1000, 25000), "Colour temperature in kelvin. Turns the camera's automatic white balance off.", optional("5600.0")},
      {"trigger", &c.trigger, plain, "\"software\", or the camera's input line that triggers each frame. Default: no trigger, the camera runs at its own rate.", optional("\"Line1\"")},
      {"packet_size", &c.packet_size, plain.within(576, 16000), "Packet size of network cameras, in bytes. Default: the largest that the network passes. A size that is given is used untried; no frame arrives if the network does not pass it.", optional("9000")},
      {"start_timeout_s", &wish.start_timeout_s, seconds.within(0.001, 600), "A camera that delivers no frame for this long after starting is reopened."},
      {"stall_timeout_s", &wish.stall_timeout_s, seconds.within(0.001, 600), "A camera that delivers no frame for this long counts as stalled and is soon reopened."},
  };
}

Keys light_camera_driving_keys(CameraWish& wish) {
  Keys keys = camera_keys(wish);
  keys.push_back({"bracket_s", &wish.bracket_s, shutter, "Shutter times to cycle through (a bracket), because one exposure cannot hold both the lamps and the room.", optional("[0.0002, 0.002, 0.02]")});
  return keys;
}

Keys light_camera_keys(LightCamera& c) {
  return {
      {"driver", &c.driver, Rule{.words = camera_driver_words()}, "Driver of the light camera, the fisheye that looks at the lamps."},
      {"device", &c.device, plain, "As in [observer].", optional("\"sessions/take1\"")},
      {"faults", &c.faults, plain, "As in [observer].", optional("[\"drop@30+5\"]")},
      {"exposure", &c.exposure, absolute_exposure, "Absolute exposure, overriding the frames' own; see [observer].", optional("0.35")},
  };
}

Keys tracking_keys(Tracking& t) {
  return {
      {"enabled", &t.enabled, plain, "Find the film camera's pose from the tags in its picture; false: use the poses recorded in the session."},
      {"family", &t.family, Rule{.words = tag_families}, "AprilTag family of the printed tags."},
      {"decimate", &t.decimate, plain.within(1, 8), "Search for tags in a picture reduced by this factor: faster, but misses small tags."},
      {"min_margin", &t.min_margin, plain.within(0, 255), "Detections that are less certain than this (AprilTag's decision margin) are dropped."},
      {"max_hamming", &t.max_hamming, plain.within(0, 3), "Bits of a tag's code that may be corrected."},
      {"ambiguity_ratio", &t.ambiguity_ratio, plain.within(0, 1), "A single tag can look the same from two poses. It counts as ambiguous if the best pose's error, divided by the second best's, is above this."},
      {"search_parts", &t.search_parts, plain, "Live, search for tags where they are expected, and the rest of the picture in strips, all of it within 16 frames, to keep up with large pictures. false: search the whole picture of every frame, as `previz render` does."},
      {"smooth", &t.smooth, plain, "Smooth out jitter and jumps of the film camera's pose in live pictures. Takes, refinements and `previz render` use the poses as found."},
      {"hold_s", &t.hold_s, seconds.within(0, 60), "How long live pictures continue with a predicted pose while none is found, as when a hand covers the tags; 0: not at all. A predicted pose is never recorded."},
      {"hold_error", &t.hold_error, plain.within(0, 1), "The predicted pose is dropped earlier if objects are likely to be off by more than this fraction of the picture's width, as happens soon while the camera moves."},
  };
}

Keys tag_keys(TagDraft& t) {
  return {
      {"id", &t.id, plain.within(0, 65535), "The tag's id; must be unique.", required("0")},
      {"size_m", &t.size, m.within(1e-4, 100), "Outer side of the black border. Required unless corners_m is given.", optional("0.08")},
      {"position_m", &t.pose.position, place, "Position of the tag's centre in the world (Z up).", optional("[0.0, 0.0, 0.0]")},
      {"rotation_deg", &t.pose.rotation, turn, "Rotation about world X, then Y, then Z. Without it the tag lies face up with its right along X; [90, 0, 0] hangs it on a wall, facing -Y.", optional("[0.0, 0.0, 0.0]")},
      {"corners_m", &t.corners, place, "Instead of position and rotation: the corners of the black border, as printed: lower left, lower right, upper right, upper left.", optional("[[-0.04, -0.04, 0], [0.04, -0.04, 0], [0.04, 0.04, 0], [-0.04, 0.04, 0]]")},
      {"world_from_tag", &t.pose.matrix, matrix, "Instead of position and rotation: the rigid transform; the tag's axes point right, up and out of the paper.", optional("[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]")},
      {"carrier", &t.carrier, plain, "Name of what carries the tag, if that is moved by hand: a stick, a tray. The tag's pose is then relative to the carrier; without a pose, the tag defines the carrier's frame.", optional("\"stick\"")},
  };
}

Keys object_keys(ObjectDraft& o) {
  return {
      {"name", &o.object.name, plain, "Name used in messages; must be unique.", required("\"vase\"")},
      {"file", &o.file, plain, "glTF 2.0 (.glb or .gltf); its Y-up is turned to the world's Z-up.", required("\"vase.glb\"")},
      {"presence", &o.object.presence, plain, "\"phantom\" is the model of a real thing, \"virtual\" is added to the picture, \"removed\" is a real thing that is removed from it.", required("\"virtual\"")},
      {"nodes", &o.object.nodes, plain, "Names of the glTF nodes to use; empty: the whole file."},
      {"animation", &o.object.animation, plain, "The animation in the file that is played (nodes, joints of skins and weights of morph targets), in the time of the pictures: its name, its index from \"0\", or \"*\" for all of them at once. A wrong name is answered with a list of what there is. Default: nothing moves.", optional("\"walk\"")},
      {"loops", &o.object.loops, plain, "Loop the animation; false: it stops at its end."},
      {"variant", &o.object.variant, plain, "Material variant to show the object in (KHR_materials_variants); \"\" is the file without a variant. The action next_variant steps through the variants of a virtual object.", optional("\"blue\"")},
      {"lamp_gain", &o.object.lamp_gain, gain, "Brightness factor of the lamps in the file (KHR_lights_punctual); surfaces that glow keep theirs. Candela are used as W/sr and lux as W/m^2, in the units of the set's radiance: 0.001464 (1 / 683) undoes the lumens per watt of Blender's \"standard\" lighting mode. `previzd check` compares each lamp with white."},
      {"position_m", &o.pose.position, place, "Position of the file's origin in the world.", optional("[0.2, 0.1, 0.0]")},
      {"rotation_deg", &o.pose.rotation, turn, "Rotation about world X, then Y, then Z, applied before the position.", optional("[0.0, 0.0, 45.0]")},
      {"scale", &o.scale, plain.within(1e-9, 1e6), "Scale factor, applied before the rotation."},
      {"carrier", &o.object.carrier, plain, "Carrier of a [[tag]] to attach it to: it moves along, and its pose is relative to the carrier.", optional("\"stick\"")},
      {"world_from_file", &o.pose.matrix, matrix, "Instead of position, rotation and scale: any invertible transform.", optional("[[1, 0, 0, 0.2], [0, 1, 0, 0.1], [0, 0, 1, 0], [0, 0, 0, 1]]")},
  };
}

Keys surface_keys(Surface& s) {
  return {
      {"material", &s.material, plain, "Name of the material in the glTF files of real objects.", required("\"table top\"")},
      {"albedo", &s.albedo, plain.within(0, 1), "Base colour, linear Rec. 709; a texture is multiplied by it (previz calibrate balance measures it).", required("[0.52, 0.46, 0.38]")},
  };
}

Keys light_keys(LightDraft& d) {
  Light& l = d.light;
  return {
      {"name", &l.name, plain, "Name used in messages.", optional("\"key light\"")},
      {"type", &l.type, plain, "Shape of the lamp.", required("\"spot\"")},
      {"position_m", &l.position, place, "Position of its centre; not for a directional light.", optional("[0.0, -1.0, 2.0]")},
      {"direction", &l.direction, axis, "Direction in which the light travels: spot, directional, rectangle.", optional("[0.0, 0.5, -1.0]")},
      {"up", &l.up, axis, "Rectangle: direction of its height; the part along `direction` is ignored.", optional("[0.0, 1.0, 0.0]")},
      {"emission", &l.emission, radiance, "Linear Rec. 709, in the units of the set's radiance. Point, spot: intensity in W/sr; directional: W/m^2 on a plane that faces it; rectangle, sphere: radiance in W/sr/m^2. Required, except with captured = true: without it, that lamp is as bright as the light camera sees it.", optional("[10.0, 9.5, 8.0]")},
      {"width_m", &l.width_m, length, "Rectangle: its width.", optional("1.0")},
      {"height_m", &l.height_m, length, "Rectangle: its height.", optional("0.5")},
      {"radius_m", &l.radius_m, length, "Sphere: its radius.", optional("0.05")},
      {"angular_radius_deg", &l.angular_radius_rad, deg.within(0, 90), "Directional: half its angular diameter; 0 gives sharp shadows, the sun has 0.265.", optional("0.265")},
      {"inner_cone_deg", &l.inner_cone_rad, deg.within(0, 90), "Spot: half angle of its full intensity. Default: 0.", optional("20.0")},
      {"outer_cone_deg", &l.outer_cone_rad, deg.within(0.01, 90), "Spot: half angle at which its light ends. Default: 45.", optional("35.0")},
      {"carrier", &l.carrier, plain, "Carrier of a [[tag]] to attach it to: it moves along, and its pose is relative to the carrier.", optional("\"stick\"")},
      {"gain_mixed", &l.gain_mixed, gain, "Brightness in the composite: 1 as it is, 0 off, 0.3 dimmed to 30 %."},
      {"gain_real", &l.gain_real, gain, "Brightness on the real set: 1 for a real lamp, 0 for one that is added."},
      {"tint", &l.tint, gain, "Colour of its light in the composite relative to the real set: factors of red, green and blue.", optional("[1.0, 0.8, 0.6]")},
      {"captured", &d.captured, plain, "Whether the environment light also contains this lamp. It is then subtracted, so that it does not shine twice and can be dimmed or removed. Default: true for a lamp with gain_real above 0 and no carrier if the light comes from a light camera.", optional("false")},
      {"cone_deg", &l.cone_rad, deg.within(0.01, 60), "With captured = true: half angle of the cone around the lamp that is subtracted. Default: its outline as the light camera sees it, plus 1 degree; for a lamp without a size, also the whole bright region there, up to a cone of 10 degrees.", optional("5.0")},
  };
}

Keys captured_lamp_keys(CapturedLamp& l) {
  return {
      {"name", &l.name, plain, "Name used in messages and by the buttons; must be unique, also among [[light]].", required("\"window\"")},
      {"direction", &l.direction, axis, "Direction from the light camera towards the lamp, in world axes, even with [lighting.room]. Required unless position_m is given.", optional("[0.71, 0.33, 0.62]")},
      {"position_m", &l.position, place, "Instead of direction: the lamp's position, from which its light comes.", optional("[1.2, 0.4, 2.3]")},
      {"cone_deg", &l.cone_rad, deg.within(0.01, 60), "Half angle of a cone that contains the whole lamp; light in it above the level at its edge is the lamp's.", required("6.0")},
      {"gain_mixed", &l.gain_mixed, gain, "Brightness in the composite: 1 as it is, 0 off, 0.3 dimmed to 30 %."},
      {"tint", &l.tint, gain, "Colour of its light in the composite, as factors of red, green and blue."},
  };
}

Keys tags_keys(Set& s) {
  return {
      {"hide", &s.hides_tags, plain, "Whether printed tags are removed from the picture, with their light, shadows and reflections. What is known of them are the nodes of phantoms that are named \"tag 3\" or \"tag 3 paper\"; in their place the picture shows the nodes \"under tag 3\", or whatever phantom is below. `previz model` makes both."},
  };
}

Keys lighting_keys(Draft& d) {
  auto& l = d.set.lighting;
  return {
      {"from", &l.from, plain, "\"camera\": the light is measured in the light camera's frames, live or recorded. \"recording\": the lamps are those that were found while the session was recorded with mode = \"sources\". \"set\": all light is declared in this file, by environment and [[light]]."},
      {"mode", &l.mode, plain, "\"image\": the whole fisheye picture lights the scene. \"sources\": the lamps in it become discs or spheres, which needs far fewer samples; the rest of the picture is blurred or dropped. \"hybrid\": the lamps likewise, and the rest of the picture unchanged."},
      {"sampling", &l.sampling, plain, "How directions towards the light are chosen: by its brightness, or by the surfaces alone (\"bsdf\"), which is noisier and meant for comparison."},
      {"environment", &d.environment, plain, "Picture of the light from all around, which replaces the light camera: OpenEXR or Radiance .hdr, latitude-longitude (2:1) or a cube cross (3:4 or 4:3); Z up, the centre of the picture, or of the middle face, is +X. Linear light, of the primaries that the file names (Rec. 709 if it names none).", optional("\"env.exr\"")},
      {"environment_rotation_deg", &l.environment_rotation_rad, turn, "Rotation of the environment about world Z, counter-clockwise as seen from above."},
      {"environment_gain", &l.environment_gain, gain, "Brightness factor of the environment."},
      {"balance", &l.balance, plain.within(1e-6, 1e6), "Factors of red, green and blue that turn the light camera's radiance, or the environment's, into the film camera's (previz calibrate balance)."},
      {"resolution", &l.resolution, plain.within(0, 4096), "Size of the light map in texels per side, a power of two; 0: as fine as its source picture."},
      {"unseen", &l.unseen, plain, "What is assumed where the light camera cannot see. \"horizon\" continues the edge of its picture, \"mirror\" mirrors the picture about the plane of the lens, \"observer\" uses what the film camera has seen there and the horizon elsewhere, \"constant\" uses unseen_radiance."},
      {"unseen_radiance", &d.unseen_radiance, radiance, "With unseen = \"constant\" only: linear Rec. 709 radiance.", optional("[0.1, 0.1, 0.1]")},
      {"smoothing_s", &l.smoothing_s, seconds.within(0, 60), "Time over which steady light is averaged. Changes that exceed the sensor's noise are followed at once. 0: no averaging."},
      {"clipped_gain", &l.clipped_gain, plain.within(1, 1e6), "Light that clips in every exposure may be assumed up to this many times brighter than the clipping level; 1: exactly that level, its lower bound."},
      {"frame", &l.frame, plain.within(-1, 1'000'000), "Light frame to use for the whole take; -1: for each picture the last bracket before it."},
  };
}

Keys room_keys(Draft& d) {
  return {
      {"size_m", &d.room.size_m, length, "Inner size of a box-shaped room along X, Y and Z, before its rotation. Required unless file is given.", optional("[6.0, 5.0, 2.8]")},
      {"file", &d.room_file, plain, "Instead of size_m: a glTF 2.0 file with the walls and lamps, as in [[object]].", optional("\"room.glb\"")},
      {"position_m", &d.room_pose.position, place, "Position of the box's centre, or of the file's origin, in the world.", optional("[0.0, 0.0, 1.4]")},
      {"rotation_deg", &d.room_pose.rotation, turn, "Rotation about world X, then Y, then Z, applied before the position.", optional("[0.0, 0.0, 30.0]")},
      {"seen_from_m", &d.room.seen_from, place, "Where the light is needed: a place among the virtual objects."},
  };
}

Keys light_sources_keys(LightSources& l) {
  return {
      {"contrast", &l.contrast, plain.within(2, 1e6), "A lamp must be at least this many times as bright as the mean of everything that is not a lamp."},
      {"least_share", &l.least_share, plain.within(0, 1), "A lamp must give at least this fraction of all light; fainter ones, such as reflections of lamps, stay in the picture."},
      {"residual", &l.residual, plain, "With mode = \"sources\": light that is not from lamps is heavily blurred, or dropped (its fraction is then reported)."},
      {"distance_m", &l.distance_m, length, "Distance of the lamps from the light camera. Default: they are on the walls of [lighting.room], or infinitely far away if there is none.", optional("2.5")},
  };
}

Keys estimator_keys(Estimation& e) {
  return {
      {"kind", &e.estimator, plain, "\"paired\" traces both worlds in full, the set as it is and the set with the virtual objects. \"difference\" traces only how they differ wherever no virtual object covers the picture, which needs fewer samples (with composite = \"additive\"; the others always trace both)."},
      {"composite", &e.composite, plain, "How shadows and light are put onto the plate. \"additive\" adds the difference of the two worlds. \"ratio\" multiplies by their ratio, which forgives a phantom of the wrong colour but cannot light a black surface. \"hybrid\" uses the ratio on bright surfaces and the sum on dark ones."},
      {"real_radiance", &e.real_radiance, plain, "Radiance of real surfaces in reflections and bounced light. \"traced\" simulates it. \"camera\" takes it from the plate wherever that shows a matt surface (specularFactor 0), in focus and unclipped: reflections then show the true texture, and paths end sooner."},
      {"composite_floor", &e.composite_floor, plain.within(0.0001, 1), "With composite = \"hybrid\": a real surface counts as dark below this fraction of the sensor's white."},
      {"max_depth", &e.max_depth, plain.within(1, 64), "Largest number of bounces."},
      {"roulette_depth", &e.roulette_depth, plain.within(1, 64), "From this bounce on, faint paths are ended at random (Russian roulette)."},
      {"seed", &e.seed, plain, "The same seed gives the same noise. All frames share one pattern of noise; in `previz render` with quality.neighbours, each frame has a pattern of its own, which depends on its number."},
      {"specular_roughness", &e.specular_roughness, plain.within(0, 0.1), "A surface counts as a perfect mirror if its roughness (GGX alpha) is at or below this."},
      {"difference_sampling", &e.difference_sampling, plain.within(0, 0.8), "Largest fraction of directions aimed at virtual and removed objects, because only there can the two worlds differ. Fewer are aimed where small lamps give most of the light, because the rays towards those lamps find the difference anyway. 0: none, as in the paper that previzd follows."},
      {"caustics", &e.caustics, plain, "Light that reaches rough surfaces via mirrors and glass. \"photons\": soft at first, then sharper. \"traced\": by paths that happen to find it, noisy. \"none\": off."},
      {"photons", &e.photons, plain.within(0.001, 10), "With caustics = \"photons\": photons per sample and pixel; at least 1024 per sample in all."},
      {"photon_radius_px", &e.photon_radius_px, plain.within(0.1, 100), "Blur of caustics in the first sample: radius over which photons are averaged, in pixels. It shrinks with every sample."},
      {"filter_textures", &e.filter_textures, plain, "Averages colour, roughness and emission of textures over the area that a sample covers, which calms fine distant patterns at few samples per pixel. The area shrinks with every sample. Textures need a third more memory."},
  };
}

Keys quality_keys(Quality& q) {
  return {
      {"samples", &q.samples, plain.within(1, 1'000'000), "Samples per pixel and frame. If error or seconds is set: those of the first round, to which more are added."},
      {"adaptive", &q.adaptive, plain, "Spends more samples where the picture is noisy: the number of samples is then the average, and a pixel gets between an eighth and eight times as many. Offline only, from 32 samples on, and only if neither error nor seconds is set."},
      {"denoise", &q.denoise, plain, "Removes noise from the composite, in the preview as well, guided by the noise that was measured in each pixel. The fewer the samples, the more it helps and the more it blurs. The other layers of an EXR file stay as rendered."},
      {"accumulate", &q.accumulate, plain, "Live and in review, averages what is added to the plate over previous frames, where they show the same surfaces in the same light: less noise at the same rate. The plate is never averaged. What moves fast or has changed starts over. A snapshot's frame stands alone, so that it can be compared with what is rendered from a take. The action \"accumulate\" toggles it. Not used by refinement; for offline rendering see neighbours."},
      {"neighbours", &q.neighbours, plain.within(0, 4), "With denoise, `previz render` averages what is added to the plate over this many frames of the take on each side, where they show the same surfaces in the same light. Composite, mask and variance of an EXR file then belong to the averaged picture, which is the same whatever part of the take is rendered. 0: every frame stands alone, as in a snapshot. Live, in review and in snapshots the key is unused."},
      {"memory_mb", &q.memory_mb, megabytes.within(500, 1e7), "Memory of the computer that `previz render` may take. What has more (a picture of 3840x2160 with two neighbours 12 GB, without a graphics card 15) works in scratch files, in $TMPDIR or /var/tmp, and every picture is the same to the last bit. Default: nine tenths of what is free, and no more than 4000. Live the key is unused.", optional("8000")},
      {"error", &q.error, plain.within(0, 1), "Adds samples wherever the estimated error is above this fraction of the picture's brightness; 0: a fixed number of samples."},
      {"seconds", &q.seconds, plain.within(0, 86'400), "Adds samples for this long, where the picture needs them most; 0: a fixed number of samples."},
      {"scale", &q.scale, plain.within(0.01, 1), "Size of what the preview renders, relative to the camera's picture. The picture itself is always full size, and as sharp as the camera's: what is rendered smaller is what virtual things add to it. Offline rendering is always full size."},
      {"fps", &q.fps, plain.within(0, 240), "Frame rate that the preview holds by changing its samples (1 to 50) and, if one sample is too many, its size (up to scale), or by the [[quality.preview]] tables. 0: samples and scale stay as set."},
      {"cpu_instead", &q.cpu_instead, plain, "Live, if the graphics card is gone: render on the CPU, slowly, as long as the set runs. Otherwise the plate is shown until the card is back. A rig that never had a card always renders on the CPU."},
      {"hardware_rays", &q.hardware_rays, plain, "Lets the graphics card trace rays in hardware, where its driver does so (VK_KHR_ray_query: NVIDIA RTX, AMD from the RX 6000 series on, Intel Arc). False: compute shaders trace them, as on any other card. The picture is the same but for rounding; `previzd bench` shows what it brings. Live it is read when the service starts."},
  };
}

Keys preview_step_keys(PreviewStep& s) {
  return {
      {"samples", &s.samples, plain.within(1, 50), "Minimum samples per pixel; more are used if they fit."},
      {"scale", &s.scale, plain.within(0.01, 1), "Size of what is rendered, relative to the camera's picture, as quality.scale."},
      {"denoise", &s.denoise, plain, "Whether noise is removed. Default: quality.denoise.", optional("true")},
  };
}

Keys button_keys(Button& b) {
  return {
      {"name", &b.name, plain, "The button, as `previzd devices` lists it.", required("\"gpio:rig-buttons:button1\"")},
      {"press", &b.press, plain, "How it is pressed: released at once, held for 0.6 s, or pressed twice within 0.3 s."},
      {"action", &b.action, Rule{.words = action_names()}, "What it does; `previzctl actions` explains each.", required("\"record\"")},
  };
}

Keys gpio_keys(GpioContact& c) {
  return {
      {"name", &c.name, plain, "A button on a GPIO line; without its last part, all lines of the chip that have no table of their own.", required("\"gpio:rig-buttons\"")},
      {"active_low", &c.wiring.active_low, plain, "Whether a pressed button pulls the line low (a contact to ground)."},
      {"bias", &c.wiring.bias, plain, "The chip's resistor on the line; \"as_is\" leaves it unchanged."},
      {"debounce_s", &c.wiring.debounce_s, seconds.within(0, 1), "Changes that follow another within this time are treated as contact bounce."},
  };
}

Keys control_keys(Control& c) {
  return {
      {"move_step_m", &c.move_step_m, m.within(least_m, 100), "How far move_left and the like move."},
      {"turn_step_deg", &c.turn_step_rad, deg.within(0.001, 180), "How far turn_left and the like turn."},
      {"scale_step", &c.scale_step, plain.within(1.0001, 100), "Factor by which scale_up enlarges."},
      {"light_step_stops", &c.light_step_stops, stops.within(0.001, 20), "How much light_up and light_down change; a stop is a factor of two."},
      {"tint_step_stops", &c.tint_step_stops, stops.within(0.001, 20), "How much light_warmer and light_greener change the balance between the colours."},
      {"exposure_step_stops", &c.exposure_step_stops, stops.within(0.001, 20), "How much exposure_up and exposure_down change."},
  };
}

Keys recording_keys(Recording& r) {
  return {
      {"directory", &r.directory, plain, "Folder for takes; each gets its own folder: SLATE_take001 and so on."},
      {"second_directory", &r.second_directory, plain, "Folder on another disk, in which recording continues when the disk of `directory` is full or fails. Take numbers run across both, and the set's files are kept in both. Default: the recording ends.", optional("\"/media/second/takes\"")},
      {"slate", &r.slate, plain, "Scene and shot, as on the slate. Default: the set's name.", optional("\"12A\"")},
      {"notes", &r.notes, plain, "Notes that are written into every take.", optional("\"second unit, 35 mm\"")},
      {"preroll_s", &r.preroll_s, seconds.within(0, 60), "A take begins this long before the button was pressed; the frames are kept in memory until then."},
      {"most_behind_s", &r.most_behind_s, seconds.within(0.2, 600), "The disk and the encoder are never more than this behind the cameras, because what waits in memory is lost if the computer crashes: if more waits, the oldest frame is dropped, counted and reported. What pre-roll adds at the beginning of a take is given ten seconds."},
      {"codec", &r.codec, plain, "Form of the cameras' pictures in a take, both without loss: ffv1 is about half as large and costs a processor core for every few pictures of 1920x1080 per second; raw costs a fast disk (1920x1080 at 25 frames per second: 160 MB per second) and no processor. The rig says before the first take which does not keep up."},
      {"queue_mb", &r.queue_mb, megabytes.within(1, 1e6), "Memory for frames that wait for the disk, half of it for those before the button, and at most three quarters of the computer's. Frames that do not fit are dropped, counted and reported. Default: a quarter of the memory that is free at the start.", optional("1024.0")},
      {"reserve_mb", &r.reserve_mb, megabytes.within(1, 1e9), "A take is closed cleanly before free disk space falls below this."},
      {"timecode_fps", &r.timecode_fps, plain.within(1, 240), "Frames per second of the timecode (time of day)."},
      {"composite", &r.composite, plain, "Also record the composite that was shown, without overlay: composite.mkv, lossless, for viewing the take elsewhere."},
      {"end_over_bus", &r.end_over_bus, plain, "Whether a take may be ended over D-Bus, as by `previzctl record off`. If not, only the crew's buttons end one; anybody who may operate the rig can still begin one."},
  };
}

Keys display_keys(Display& d) {
  return {
      {"driver", &d.driver, Rule{.words = display_driver_words()}, "\"kms\": a screen on this computer's graphics card that no window system uses. \"headless\": no screen; the same is drawn and written to screen.png in the output folder about once a second. \"none\": nothing is drawn."},
      {"connector", &d.connector, plain, "Connector of the screen, as `previzd devices` lists it. Default: the first one that has a screen.", optional("\"HDMI-A-1\"")},
      {"mode", &d.mode, plain, "Size and refresh rate. Default: what the screen prefers.", optional("\"1920x1080@50\"")},
      {"scale", &d.scale, plain, "\"letterbox\": the picture is as large as fits. \"1:1\": each pixel of the picture is one pixel of the screen."},
      {"osd", &d.osd, plain, "Overlay on the picture: mode, take, tracking, faults. It is never recorded. The action \"osd\" switches it."},
      {"text_height", &d.text_height, plain.within(0.01, 0.2), "Size of the overlay's text, relative to the height of the screen."},
  };
}

Keys output_keys(Output& o) {
  return {
      {"directory", &o.directory, plain, "Folder for rendered frames; live, for snapshots, picture.png and metrics.json (these two are in /run/previzd if the service runs)."},
      {"exr", &o.exr, plain, "Write a multi-layer EXR for each frame: composite, mixed, real, diff, mask, depth, normal, variance."},
      {"png", &o.png, plain, "Write a PNG for each frame, as the display shows it."},
      {"video", &o.video, plain, "Write a review video of the take."},
  };
}

// clang-format on
}  // namespace

std::vector<Section> sections(Draft& d) {
  const auto once = [&d](const char* path, Section::Kind kind, const char* about, auto keys) {
    return Section{path, kind, about, [&d, path, keys] {
                     auto& given = d.given[path];
                     given.path = path;
                     return Section::Opened{&given, keys()};
                   }};
  };
  const auto many = [](const char* path, const char* about, auto& drafts, auto keys) {
    return Section{path, Section::Kind::repeated, about, [path, &drafts, keys] {
                     auto& draft = drafts.emplace_back();
                     draft.given.path = path;
                     return Section::Opened{&draft.given, keys(draft)};
                   }};
  };
  using enum Section::Kind;
  // clang-format off
  return {
      once("set", always, "The set as a whole.", [&d] { return set_keys(d.set); }),
      once("observer", always, "The film camera.", [&d] { return observer_keys(d.set.observer); }),
      once("observer.camera", optional, "Settings of a live camera; those not given stay as the camera has them.", [&d] { return camera_keys(d.set.observer.camera); }),
      once("observer.intrinsics", optional, "The calibrated lens of the film camera. A calibration given here replaces all of the session's.", [&d] { return calibration_keys(d.observer, "intrinsics"); }),
      once("observer.lens_fit", optional, "How accurate that lens is: the statistics of the boards, as `previz calibrate observer` prints them. `previz calibrate tags` refines the lens with it; nothing else reads it.", [&d] { return lens_fit_keys(d.set.observer.lens_fit); }),
      once("observer.lens", optional, "The lens, for depth of field. Without this table everything is in focus.", [&d] { return calibration_keys(d.observer, "lens"); }),
      once("observer.response", optional, "How its sensor turns light into picture values.", [&d] { return calibration_keys(d.observer, "response"); }),
      once("light_camera", always, "The light camera: a fisheye that sees the lamps.", [&d] { return light_camera_keys(d.set.light_camera); }),
      once("light_camera.camera", optional, "Settings of a live camera, as in [observer.camera].", [&d] { return light_camera_driving_keys(d.set.light_camera.camera); }),
      once("light_camera.intrinsics", optional, "The calibrated fisheye lens of the light camera.", [&d] { return calibration_keys(d.light_camera, "intrinsics"); }),
      once("light_camera.response", optional, "How its sensor turns light into picture values.", [&d] { return calibration_keys(d.light_camera, "response"); }),
      once("light_camera.pose", optional, "The light camera's pose.", [&d] { return calibration_keys(d.light_camera, "pose"); }),
      once("tracking", always, "How the film camera's pose is found, from printed AprilTags.", [&d] { return tracking_keys(d.set.tracking); }),
      once("tags", always, "The printed tags in the picture.", [&d] { return tags_keys(d.set); }),
      many("tag", "A printed tag; one table for each. Its pose is given in one of three forms.", d.tags, tag_keys),
      many("object", "A piece of geometry, real or virtual; one table for each.", d.objects, object_keys),
      many("surface", "The colour of a real surface, where it is known better than by the model; one table for each.", d.surfaces, [](SurfaceDraft& s) { return surface_keys(s.surface); }),
      many("light", "A lamp that is added, or a real one whose brightness or colour is changed; one table for each.", d.lights, light_keys),
      many("captured_light", "A real lamp known only from the light camera's picture; one table for each. Its light can be dimmed, tinted and removed. (Lamps are found in that picture without such a table too, and the buttons can change them; a table is tied to a direction, so it always means the same lamp.)", d.captured_lamps, [](CapturedLampDraft& l) { return captured_lamp_keys(l.lamp); }),
      once("lighting", always, "The light on the set.", [&d] { return lighting_keys(d); }),
      once("lighting.room", optional, "The room, if the lamps and walls are near: the light camera's picture is projected onto its walls, and the set sees them from where it is. Without this table, light comes from far away.", [&d] { return room_keys(d); }),
      once("lighting.sources", always, "How lamps are found in the light camera's picture, with mode = \"sources\" or \"hybrid\".", [&d] { return light_sources_keys(d.set.lighting.sources); }),
      once("estimator", always, "How light is simulated.", [&d] { return estimator_keys(d.set.estimation); }),
      once("quality", always, "How much time and noise a frame may have.", [&d] { return quality_keys(d.set.quality); }),
      many("quality.preview", "What the preview may do to hold quality.fps; one table for each step, best first: the first one that fits is used. `previz trade` prints those that suit a set. Default: one sample at quality.scale, then half as many pixels at each step.", d.preview_steps, [](PreviewStepDraft& s) { return preview_step_keys(s.step); }),
      many("button", "What a button does; one table for each way to press it.", d.buttons, [](ButtonDraft& b) { return button_keys(b.button); }),
      many("gpio", "How buttons on GPIO lines are wired; one table for each chip or line that differs from the defaults below.", d.contacts, [](GpioDraft& g) { return gpio_keys(g.contact); }),
      once("control", always, "The step of each action.", [&d] { return control_keys(d.set.control); }),
      once("recording", always, "How takes are recorded.", [&d] { return recording_keys(d.set.recording); }),
      once("display", always, "The crew's screen.", [&d] { return display_keys(d.set.display); }),
      once("output", always, "Where pictures go, and what `previz render` writes.", [&d] { return output_keys(d.set.output); }),
  };
  // clang-format on
}

}  // namespace set
}  // namespace previz
