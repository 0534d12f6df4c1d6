#include "daemon/set/table.hpp"

#include <string_view>
#include <variant>

#include "daemon/set/actions.hpp"

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

constexpr const char* tag_families[] = {"tag36h11",      "tag25h9",          "tag16h5",
                                        "tag36h10",      "tagStandard41h12", "tagStandard52h13",
                                        "tagCircle21h7", "tagCircle49h12",   "tagCustom48h12"};

Need required(const char* example) {
  return {Need::Kind::required, example};
}
Need optional(const char* example) {
  return {Need::Kind::optional, example};
}

using Keys = std::vector<Key>;

// The keys of a calibration that stand in one table.
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
      {"name", &set.name, plain, "What the crew calls this set; left out: the file's name.", optional("\"desk\"")},
  };
}

Keys observer_keys(Observer& o) {
  return {
      {"driver", &o.driver, plain, "How the film camera is reached."},
      {"device", &o.device, plain, "The camera's stable name; for replay the session's folder, relative to this file. Left out: the session named on the command line.", optional("\"sessions/take1\"")},
      {"faults", &o.faults, plain, "What is to go wrong, to rehearse it, and at which frame: drop, corrupt, late, stall, disconnect.", optional("[\"stall@250\", \"disconnect@1000+2.5s\"]")},
      {"exposure", &o.exposure, plain.above(0), "Absolute exposure, in place of what the frames say: picture signal = exposure * radiance.", optional("1.0")},
  };
}

Keys camera_keys(CameraWish& wish) {
  CameraSettings& c = wish.settings;
  return {
      {"pixel_format", &c.format, plain, "In the driver's own words; more bits are worth their bandwidth.", optional("\"BayerRG12\"")},
      {"width", &c.width, px.within(1, max_picture_side_px), "Size of the pictures; with height.", optional("1920")},
      {"height", &c.height, px.within(1, max_picture_side_px), "Size of the pictures; with width.", optional("1080")},
      {"rate_hz", &c.rate_hz, plain.above(0, 1e4), "Frames a second.", optional("25.0")},
      {"exposure_s", &c.exposure_s, seconds.above(0, 100), "Shutter time; the camera's automatic is then off.", optional("0.01")},
      {"gain", &c.gain, plain.within(1, 1e4), "Linear; of cameras whose gain is in dB.", optional("2.0")},
      {"raw_gain", &c.raw_gain, plain, "In the camera's own units; its factor then belongs to the responsivity.", optional("64.0")},
      {"white_balance_k", &c.white_balance_k, plain.within(1000, 25000), "Colour temperature; the camera's automatic is then off.", optional("5600.0")},
      {"trigger", &c.trigger, plain, "\"software\", or the camera's line that triggers a frame; left out: it runs freely.", optional("\"Line1\"")},
      {"packet_size", &c.packet_size, plain.within(576, 16000), "Bytes, of network cameras; left out: the largest that gets through.", optional("9000")},
      {"start_timeout_s", &wish.start_timeout_s, seconds.above(0, 600), "No frame so long after the start: the camera is opened anew."},
      {"stall_timeout_s", &wish.stall_timeout_s, seconds.above(0, 600), "No frame so long after the last: the camera is stalled, and soon opened anew."},
  };
}

Keys light_camera_driving_keys(CameraWish& wish) {
  Keys keys = camera_keys(wish);
  keys.push_back({"bracket_s", &wish.bracket_s, seconds.above(0, 100), "Shutter times that are driven in turn, for light brighter than one exposure holds.", optional("[0.0002, 0.002, 0.02]")});
  return keys;
}

Keys light_camera_keys(LightCamera& c) {
  return {
      {"driver", &c.driver, plain, "How the light camera (the fisheye that looks at the lamps) is reached."},
      {"device", &c.device, plain, "As in [observer].", optional("\"sessions/take1\"")},
      {"faults", &c.faults, plain, "As in [observer].", optional("[\"drop@30+5\"]")},
      {"exposure", &c.exposure, plain.above(0), "Absolute exposure, in place of what the frames say.", optional("0.35")},
  };
}

Keys tracking_keys(Tracking& t) {
  return {
      {"enabled", &t.enabled, plain, "Find the film camera by the tags in its picture; false: take the poses the session recorded."},
      {"family", &t.family, Rule{.words = tag_families}, "AprilTag family of the printed tags."},
      {"decimate", &t.decimate, plain.within(1, 8), "Tags are looked for in a picture smaller by this factor: faster, and small tags get lost."},
      {"min_margin", &t.min_margin, plain.within(0, 255), "Decision margin below which a detection is dropped."},
      {"max_hamming", &t.max_hamming, plain.within(0, 3), "Bits of a tag's code that may be corrected."},
      {"ambiguity_ratio", &t.ambiguity_ratio, plain.within(0, 1), "Error of the best over the second pose above which a single tag is called ambiguous."},
  };
}

Keys tag_keys(TagDraft& t) {
  return {
      {"id", &t.id, plain.within(0, 65535), "The number that the tag encodes; each at most once.", required("0")},
      {"size_m", &t.size, m.above(0, 100), "Outer edge of the black border. Required unless corners_m is given.", optional("0.08")},
      {"position_m", &t.pose.position, m, "Where the middle of the tag is in the world (Z up).", optional("[0.0, 0.0, 0.0]")},
      {"rotation_deg", &t.pose.rotation, deg, "Turns about world X, then Y, then Z. Unturned it lies face up, its right = X; [90, 0, 0] hangs it on a wall facing -Y.", optional("[0.0, 0.0, 0.0]")},
      {"corners_m", &t.corners, m, "In place of position and rotation: lower left, lower right, upper right, upper left of the black border, as printed.", optional("[[-0.04, -0.04, 0], [0.04, -0.04, 0], [0.04, 0.04, 0], [-0.04, 0.04, 0]]")},
      {"world_from_tag", &t.pose.matrix, plain, "In place of position and rotation: the rigid transform; tag axes right, up, out of the paper.", optional("[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]")},
      {"carrier", &t.carrier, plain, "Name of what it is stuck to, where that is moved by hand: a stick, a tray. Its frame then stands for the world in the pose, which may be left out: the tag's frame is the carrier's.", optional("\"stick\"")},
  };
}

Keys object_keys(ObjectDraft& o) {
  return {
      {"name", &o.object.name, plain, "What messages call it; each at most once.", required("\"vase\"")},
      {"file", &o.file, plain, "glTF 2.0 (.glb or .gltf); its Y-up is turned to the world's Z-up.", required("\"vase.glb\"")},
      {"presence", &o.object.presence, plain, "\"phantom\" stands for something real, \"virtual\" is added, \"removed\" is real and taken away.", required("\"virtual\"")},
      {"nodes", &o.object.nodes, plain, "Names of the glTF nodes to take; empty: all of the file."},
      {"animation", &o.object.animation, plain, "Name of the file's animation that is played (translation, rotation and scale of its nodes), with the time of the pictures; left out: nothing moves.", optional("\"walk\"")},
      {"loops", &o.object.loops, plain, "The animation begins again at its end; false: it stays there."},
      {"position_m", &o.pose.position, m, "Where the file's origin goes in the world.", optional("[0.2, 0.1, 0.0]")},
      {"rotation_deg", &o.pose.rotation, deg, "Turns about world X, then Y, then Z, before it is moved.", optional("[0.0, 0.0, 45.0]")},
      {"scale", &o.scale, plain.above(0, 1e6), "Size factor, before it is turned."},
      {"carrier", &o.object.carrier, plain, "Carrier of a [[tag]] that it is fixed to: it moves with it, and its pose is in the carrier's frame.", optional("\"stick\"")},
      {"world_from_file", &o.pose.matrix, plain, "In place of the three: any invertible transform.", optional("[[1, 0, 0, 0.2], [0, 1, 0, 0.1], [0, 0, 1, 0], [0, 0, 0, 1]]")},
  };
}

Keys surface_keys(Surface& s) {
  return {
      {"material", &s.material, plain, "Name of the material in the glTF files of real objects.", required("\"table top\"")},
      {"albedo", &s.albedo, plain.within(0, 1), "Its base colour, linear Rec. 709; a texture multiplies it (previzd calibrate balance measures it).", required("[0.52, 0.46, 0.38]")},
  };
}

Keys light_keys(Light& l) {
  return {
      {"name", &l.name, plain, "What messages call it.", optional("\"key light\"")},
      {"type", &l.type, plain, "Shape of the lamp.", required("\"spot\"")},
      {"position_m", &l.position, m, "Where it is (its centre); not for a directional light.", optional("[0.0, -1.0, 2.0]")},
      {"direction", &l.direction, plain, "The way the light travels: spot, directional, rectangle.", optional("[0.0, 0.5, -1.0]")},
      {"up", &l.up, plain, "Direction of a rectangle's height; what is along the light's direction is ignored.", optional("[0.0, 1.0, 0.0]")},
      {"emission", &l.emission, plain.at_least(0), "Linear Rec. 709. Point, spot: intensity in W/sr; directional: W/m^2 on a facing plane; rectangle, sphere: radiance in W/sr/m^2.", required("[10.0, 9.5, 8.0]")},
      {"width_m", &l.width_m, m.above(0), "Rectangle.", optional("1.0")},
      {"height_m", &l.height_m, m.above(0), "Rectangle.", optional("0.5")},
      {"radius_m", &l.radius_m, m.above(0), "Sphere.", optional("0.05")},
      {"angular_radius_deg", &l.angular_radius_rad, deg.within(0, 90), "Directional: half the angle it is seen under; 0: a sharp shadow. The sun: 0.265.", optional("0.265")},
      {"inner_cone_deg", &l.inner_cone_rad, deg.within(0, 90), "Spot: half angle of full intensity; left out: 0.", optional("20.0")},
      {"outer_cone_deg", &l.outer_cone_rad, deg.above(0, 90), "Spot: half angle where its light ends; left out: 45.", optional("35.0")},
      {"carrier", &l.carrier, plain, "Carrier of a [[tag]] that it is fixed to: it moves with it, and its pose is in the carrier's frame.", optional("\"stick\"")},
      {"gain_mixed", &l.gain_mixed, plain.at_least(0), "Brightness in the picture that is made: 1 as it is, 0 off, 0.3 dimmed."},
      {"gain_real", &l.gain_real, plain.at_least(0), "Brightness in the real scene: 0 for a lamp that is added, 1 for one that is there."},
  };
}

Keys lighting_keys(Draft& d) {
  auto& l = d.set.lighting;
  return {
      {"from", &l.from, plain, "\"camera\": the light is estimated from the light camera's frames, live or recorded. \"recording\": it is as it was when the session was recorded, with mode = \"sources\". \"set\": neither; all light is what this file says, by environment and [[light]]."},
      {"mode", &l.mode, plain, "\"image\": the whole fisheye picture lights the scene. \"sources\": its lamps do, as discs or spheres, which takes far fewer samples; what is left of it is blurred or dropped. \"hybrid\": its lamps, and all that is left of it as a picture."},
      {"sampling", &l.sampling, plain, "How directions towards the light are chosen; \"bsdf\" is noisier, for comparison."},
      {"environment", &d.environment, plain, "Latitude-longitude EXR in place of the light camera; Z up, the picture's middle is +X.", optional("\"env.exr\"")},
      {"environment_rotation_deg", &l.environment_rotation_rad, deg, "Turns that picture about world Z, counter-clockwise seen from above."},
      {"environment_gain", &l.environment_gain, plain.at_least(0), "Scales that picture."},
      {"balance", &l.balance, plain.within(1e-6, 1e6), "Red, green and blue: what the light camera's radiance is multiplied by to be the film camera's (previzd calibrate balance)."},
      {"resolution", &l.resolution, plain.within(0, 4096), "Side of the light map in texels, a power of two; 0: as fine as the source."},
      {"unseen", &l.unseen, plain, "What stands where the light camera cannot see: the edge of its picture continued, its picture mirrored about the plane it stands in, what the film camera has seen there (elsewhere the edge continued), or a constant."},
      {"unseen_radiance", &d.unseen_radiance, plain.at_least(0), "With unseen = \"constant\" only: linear Rec. 709 radiance.", optional("[0.1, 0.1, 0.1]")},
      {"smoothing_s", &l.smoothing_s, seconds.within(0, 60), "Time constant over which light that stays the same is averaged; what changes beyond the sensor's noise passes at once. 0: no averaging."},
      {"clipped_gain", &l.clipped_gain, plain.within(1, 1e6), "Light that is clipped in every exposure is taken as up to this many times the white it is clipped at; 1: as white, which is its lower bound."},
      {"frame", &l.frame, plain.within(-1, 1'000'000), "Light frame to use for the whole take; -1: the newest bracket before each picture."},
  };
}

Keys room_keys(Draft& d) {
  return {
      {"size_m", &d.room.size_m, m.above(0, far_m), "A box: its inner size along X, Y and Z, before it is turned. Required unless file is given.", optional("[6.0, 5.0, 2.8]")},
      {"file", &d.room_file, plain, "In place of size_m: glTF 2.0 of the walls and lamps, as in [[object]].", optional("\"room.glb\"")},
      {"position_m", &d.room_pose.position, m, "Where the middle of the box, or the file's origin, is in the world.", optional("[0.0, 0.0, 1.4]")},
      {"rotation_deg", &d.room_pose.rotation, deg, "Turns about world X, then Y, then Z, before it is moved.", optional("[0.0, 0.0, 30.0]")},
      {"seen_from_m", &d.room.seen_from, m, "The place in the set that the light is wanted for: among the virtual objects."},
  };
}

Keys light_sources_keys(LightSources& l) {
  return {
      {"contrast", &l.contrast, plain.within(2, 1e6), "How many times brighter than the mean of all that is no lamp a lamp is, at least."},
      {"least_share", &l.least_share, plain.within(0, 1), "Share of all light that a lamp brings, at least; fainter ones, such as reflections of lamps, stay in the picture."},
      {"residual", &l.residual, plain, "With mode = \"sources\": the light of everything but the lamps, without its shapes, or none of it (how much that is, is told)."},
      {"distance_m", &l.distance_m, m.above(0, far_m), "How far from the light camera the lamps are; left out: on the walls of [lighting.room], without one at infinity.", optional("2.5")},
  };
}

Keys estimator_keys(Estimation& e) {
  return {
      {"kind", &e.estimator, plain, "\"paired\": both worlds are traced in full, with the same random numbers. \"difference\": where no virtual object covers the picture, only what differs between the worlds is traced (with composite = \"additive\"; the others need both in full)."},
      {"composite", &e.composite, plain, "How the difference of the worlds is put onto the camera picture: added; as the ratio of the worlds, which forgives a wrong albedo of the phantom but lights no black surface; or the ratio on bright surfaces and the sum on dark ones."},
      {"real_radiance", &e.real_radiance, plain, "Where the radiance of real surfaces comes from that light reaches after a bounce: simulated; or the camera picture's own, where it shows a matt surface (specularFactor 0) in focus and unclipped: reflections then show its true texture, and paths end sooner."},
      {"composite_floor", &e.composite_floor, plain.within(0.0001, 1), "With composite = \"hybrid\": radiance below which a real surface counts as dark, as a share of the sensor's white."},
      {"max_depth", &e.max_depth, plain.within(1, 64), "Bounces of a path: vertices after the camera."},
      {"roulette_depth", &e.roulette_depth, plain.within(1, 64), "Russian roulette ends paths from this vertex on."},
      {"seed", &e.seed, plain, "The same seed gives the same noise."},
      {"specular_roughness", &e.specular_roughness, plain.within(0, 0.1), "GGX alpha at or below which a surface is a perfect mirror."},
      {"difference_sampling", &e.difference_sampling, plain.within(0, 0.8), "Largest share of directions sampled towards objects of one world only, where the worlds can differ; less where light comes from hardly more solid angle than theirs; 0: none, as in the paper."},
      {"caustics", &e.caustics, plain, "How light comes to rough surfaces by way of mirrors and glass: by photons (soft at first, then sharper), by paths that happen to find it (noisy), or not at all."},
      {"photons", &e.photons, plain.within(0.001, 10), "With caustics = \"photons\": photons of a sample, for each pixel of the picture; at least 1024 in all."},
      {"photon_radius_px", &e.photon_radius_px, plain.within(0.1, 100), "Radius over which photons of the first sample are gathered, in pixels at the distance of the nearest mirror or glass; later ones take less."},
  };
}

Keys quality_keys(Quality& q) {
  return {
      {"samples", &q.samples, plain.within(1, 1'000'000), "Samples per pixel and frame; with error or seconds: the first round, in every pixel."},
      {"adaptive", &q.adaptive, plain, "Spends the samples where the picture is noisy: so many on average, in a pixel between an eighth and eight times as many. Offline only, from 32 samples on, and where neither error nor seconds is set."},
      {"denoise", &q.denoise, plain, "Takes noise out of the composite, in the preview, too, where its own variance says that it is noise. The fewer the samples, the more it helps and the more it blurs; the other layers of an EXR file stay as they are."},
      {"error", &q.error, plain.within(0, 1), "Goes on where the picture's estimated error is above this share of its mean radiance; 0: samples alone decide."},
      {"seconds", &q.seconds, plain.within(0, 86'400), "Goes on for so long, where the picture needs it most; 0: samples alone decide."},
      {"scale", &q.scale, plain.within(0.01, 1), "Size of the preview over the camera's picture; offline rendering is always full size."},
      {"fps", &q.fps, plain.within(0, 240), "Pictures a second that the preview holds, with 1 to 50 samples, then by a smaller picture (scale is the largest); 0: the keys above decide."},
  };
}

Keys button_keys(Button& b) {
  return {
      {"name", &b.name, plain, "The button, as `previzd devices` lists it.", required("\"pedal:left\"")},
      {"press", &b.press, plain, "How it is pressed: let go at once, held for 0.6 s, or pushed twice within 0.3 s."},
      {"action", &b.action, Rule{.words = action_names()}, "What it does; `previzctl actions` explains each.", required("\"record\"")},
  };
}

Keys gpio_keys(GpioContact& c) {
  return {
      {"name", &c.name, plain, "A button on a GPIO line, or without its last part all lines of the chip that have no table of their own.", required("\"gpio:rig-buttons\"")},
      {"active_low", &c.wiring.active_low, plain, "Whether a pressed button pulls the line low (a contact to ground)."},
      {"bias", &c.wiring.bias, plain, "The chip's own resistor on the line; \"as_is\" leaves it alone."},
      {"debounce_s", &c.wiring.debounce_s, seconds.within(0, 1), "What follows an edge within this time is the contact's bouncing."},
  };
}

Keys control_keys(Control& c) {
  return {
      {"move_step_m", &c.move_step_m, m.above(0, 100), "A step of move_left and the like."},
      {"turn_step_deg", &c.turn_step_rad, deg.above(0, 180), "A step of turn_left and the like."},
      {"scale_step", &c.scale_step, plain.above(1, 100), "Factor of scale_up."},
      {"light_step_stops", &c.light_step_stops, stops.above(0, 20), "A step of light_up and light_down; a stop is a factor of two."},
      {"tint_step_stops", &c.tint_step_stops, stops.above(0, 20), "A step of light_warmer and light_greener, between the colours' strengths."},
      {"exposure_step_stops", &c.exposure_step_stops, stops.above(0, 20), "A step of exposure_up and exposure_down."},
  };
}

Keys recording_keys(Recording& r) {
  return {
      {"directory", &r.directory, plain, "Where takes go, a folder each: SLATE_take001 and so on."},
      {"slate", &r.slate, plain, "Scene and shot as on the board; left out: the set's name.", optional("\"12A\"")},
      {"notes", &r.notes, plain, "Written into every take.", optional("\"second unit, 35 mm\"")},
      {"preroll_s", &r.preroll_s, seconds.within(0, 60), "What the cameras saw before the button is put in front of the take; kept in memory."},
      {"queue_mb", &r.queue_mb, megabytes.within(1, 1e6), "Frames that may wait in memory for a slow disk; what does not fit is dropped, counted and told."},
      {"reserve_mb", &r.reserve_mb, megabytes.within(1, 1e9), "A take ends in order before the disk has less space left than this."},
      {"timecode_fps", &r.timecode_fps, plain.within(1, 240), "Frames of a second of timecode (time of day)."},
      {"composite", &r.composite, plain, "Record what was shown too, without overlay: composite.mkv, lossless, for whoever looks at takes elsewhere."},
  };
}

Keys display_keys(Display& d) {
  return {
      {"driver", &d.driver, plain, "\"kms\": a screen on this computer's graphics card, which no window system uses. \"headless\": drawn the same, and written to screen.png beside the output about once a second. \"none\": nothing is drawn."},
      {"connector", &d.connector, plain, "The screen's stable name as `previzd devices` prints it; left out: the first that has a screen.", optional("\"HDMI-A-1\"")},
      {"mode", &d.mode, plain, "Size and rate; left out: what the screen prefers.", optional("\"1920x1080@50\"")},
      {"scale", &d.scale, plain, "\"letterbox\": as large as fits. \"1:1\": a pixel of the picture is one of the screen."},
      {"osd", &d.osd, plain, "Words over the picture: mode, take, tracking, faults; never in what is recorded. The action \"osd\" changes it."},
      {"text_height", &d.text_height, plain.within(0.01, 0.2), "Size of the words, over the screen's height."},
  };
}

Keys output_keys(Output& o) {
  return {
      {"directory", &o.directory, plain, "Where rendered frames go."},
      {"exr", &o.exr, plain, "A multi-layer EXR a frame: composite, mixed, real, diff, mask, depth, normal, variance."},
      {"png", &o.png, plain, "A PNG a frame, as the display shows it."},
      {"video", &o.video, plain, "A review video of the take."},
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
      once("observer.camera", optional, "How a camera that is no recording is driven; what is left out stays as the camera has it.", [&d] { return camera_keys(d.set.observer.camera); }),
      once("observer.intrinsics", optional, "Its lens as calibrated. A calibration given here replaces the session's as a whole.", [&d] { return calibration_keys(d.observer, "intrinsics"); }),
      once("observer.lens", optional, "Depth of field; left out: everything is sharp.", [&d] { return calibration_keys(d.observer, "lens"); }),
      once("observer.response", optional, "How its sensor turns light into picture values.", [&d] { return calibration_keys(d.observer, "response"); }),
      once("light_camera", always, "The light camera.", [&d] { return light_camera_keys(d.set.light_camera); }),
      once("light_camera.camera", optional, "As [observer.camera].", [&d] { return light_camera_driving_keys(d.set.light_camera.camera); }),
      once("light_camera.intrinsics", optional, "Its fisheye as calibrated.", [&d] { return calibration_keys(d.light_camera, "intrinsics"); }),
      once("light_camera.response", optional, "How its sensor turns light into picture values.", [&d] { return calibration_keys(d.light_camera, "response"); }),
      once("light_camera.pose", optional, "Where it stands.", [&d] { return calibration_keys(d.light_camera, "pose"); }),
      once("tracking", always, "Where the film camera is, found by printed AprilTags.", [&d] { return tracking_keys(d.set.tracking); }),
      many("tag", "A printed tag; one table each. Give its pose in one of three forms.", d.tags, tag_keys),
      many("object", "A piece of geometry, real or virtual; one table each.", d.objects, object_keys),
      many("surface", "The colour of a real surface, where it is known better than the model says; one table each.", d.surfaces, [](SurfaceDraft& s) { return surface_keys(s.surface); }),
      many("light", "A lamp that is added or whose brightness is changed; one table each. A lamp of another colour is two: the real one with gain_mixed = 0, and one that is added in its place.", d.lights, [](LightDraft& l) { return light_keys(l.light); }),
      once("lighting", always, "The light around the set.", [&d] { return lighting_keys(d); }),
      once("lighting.room", optional, "Where the light comes from, if it is near: the light camera's picture is put on these walls and seen anew from the set. Left out: from far away.", [&d] { return room_keys(d); }),
      once("lighting.sources", always, "The lamps that are found in the light camera's picture, with mode = \"sources\" or \"hybrid\".", [&d] { return light_sources_keys(d.set.lighting.sources); }),
      once("estimator", always, "How light is simulated.", [&d] { return estimator_keys(d.set.estimation); }),
      once("quality", always, "What a frame may cost.", [&d] { return quality_keys(d.set.quality); }),
      many("button", "What a button does; one table for each way to press it.", d.buttons, [](ButtonDraft& b) { return button_keys(b.button); }),
      many("gpio", "How buttons on GPIO lines are wired; one table for each chip or line that is wired otherwise than as below.", d.contacts, [](GpioDraft& g) { return gpio_keys(g.contact); }),
      once("control", always, "How much an action changes.", [&d] { return control_keys(d.set.control); }),
      once("recording", always, "Takes.", [&d] { return recording_keys(d.set.recording); }),
      once("display", always, "The crew's screen.", [&d] { return display_keys(d.set.display); }),
      once("output", always, "What is written.", [&d] { return output_keys(d.set.output); }),
  };
  // clang-format on
}

}  // namespace set
}  // namespace previz
