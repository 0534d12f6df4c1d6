// A set: everything one TOML file says about a stage, as typed values. Plain data.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/session/video_codec.hpp"
#include "drivers/button_settings.hpp"
#include "drivers/calibration.hpp"
#include "drivers/camera_settings.hpp"
#include "drivers/display.hpp"

namespace previz::set {

// Values of `driver` beside the names in drivers/camera_drivers.hpp and display_drivers.hpp: a
// recorded session stands in for the camera, or there is no camera or display at all.
inline constexpr const char* replay_driver = "replay";
inline constexpr const char* no_driver = "none";

// Says how to drive a camera that is not a recording.
struct CameraWish {
  CameraSettings settings;
  std::vector<double> bracket_s;  // shutter times in turn, one per frame; empty: one
  double start_timeout_s = 5;     // until the first frame; then the device is reopened
  double stall_timeout_s = 2;     // between two frames
};

// The fit of a lens by boards with all of its parameters, of which the lens of the set may keep
// fewer: fx, fy, cx, cy (px), k1, k2, p1, p2, k3. Empty: not given.
struct LensFit {
  std::vector<double> values;  // 9
  // The lower triangle, row by row (45), of L, where L L^T is the parameters' covariance.
  std::vector<double> covariance_root;
};

struct Observer {
  std::string driver = replay_driver;
  std::string device;  // replay: session directory; otherwise the device's stable name
  CameraWish camera;
  std::vector<std::string> faults;  // faults to rehearse, written as in drivers/faults.hpp
  // Calibration given here overrides the session's.
  std::optional<ObserverCalibration> calibration;
  LensFit lens_fit;                // what calibrate tags refines the lens by
  std::optional<double> exposure;  // absolute; overrides the frames' own

  bool is_live() const { return driver != replay_driver && driver != no_driver; }
};

struct LightCamera {
  std::string driver = replay_driver;
  std::string device;
  CameraWish camera;
  std::vector<std::string> faults;  // faults to rehearse, written as in drivers/faults.hpp
  std::optional<LightCameraCalibration> calibration;
  std::optional<double> exposure;
};

// One AprilTag: outer edge of the black border, metres. Corners in the tag's frame: x right, y up,
// z out of the paper.
struct Tag {
  int id = 0;
  double size_m = 0;
  glm::dmat4 world_from_tag{1.0};
};

// A thing with tags on it that is moved by hand: a stick, a tray. The poses of its tags, and of the
// objects and lamps fixed to it, are given in the carrier's frame instead of the world's.
struct Carrier {
  std::string name;
  std::vector<Tag> tags;
};

enum class Presence { phantom, virtual_object, removed };  // in (mixed, real): (1,1) (1,0) (0,1)

// A glTF file (all its nodes) put into the world. glTF is Y up, the world Z up; world_from_file
// applies after that conversion.
struct Object {
  std::string name;
  std::filesystem::path file;  // resolved; absolute or relative to the working directory
  std::string file_as_written;
  Presence presence = Presence::virtual_object;
  glm::dmat4 world_from_file{1.0};
  std::vector<std::string> nodes;  // glTF node names to take; empty: all
  std::string carrier;             // carrier that it is fixed to; empty: fixed in the world
  std::string animation;           // name of the file's animation to play; empty: none
  bool loops = true;               // the animation restarts when it ends
  std::string variant;             // of the file's materials; empty: those without a variant
  double lamp_gain = 1;            // times the emission of the file's lamps
};

enum class LightType { point, spot, directional, rectangle, sphere };

// A measured property of a real surface, which replaces that of its model.
struct Surface {
  std::string material;  // its name in the glTF files of phantom and removed objects
  glm::dvec3 albedo{0};  // base colour factor, linear Rec. 709
};

// A lamp of the set. Gains scale its emission in the mixed and in the real world: an added light is
// (1,0), a real light that stays is (1,1), a dimmed one (g,1). In the mixed world the tint scales
// each channel besides.
struct Light {
  std::string name;
  LightType type = LightType::point;
  glm::dvec3 position{0};          // metres (point, spot, rectangle centre, sphere centre)
  glm::dvec3 direction{0, 0, -1};  // unit, the way the light travels (spot, directional, rectangle)
  glm::dvec3 up{0, 1, 0};          // rectangle: direction of its height
  // point, spot: radiant intensity (W/sr); directional: irradiance on a facing plane (W/m^2);
  // rectangle, sphere: radiance (W/sr/m^2). Linear Rec. 709.
  glm::dvec3 emission{1};
  double width_m = 1, height_m = 1;  // rectangle
  double radius_m = 0;               // sphere (> 0)
  double angular_radius_rad = 0;     // directional: 0 is a delta light
  double inner_cone_rad = 0, outer_cone_rad = std::numbers::pi / 4;  // spot, half angles
  double gain_mixed = 1, gain_real = 0;
  glm::dvec3 tint{1};
  std::string carrier;  // carrier that it is fixed to; empty: fixed in the world
  // True: the light around the set shows this lamp too, and it is taken out of it.
  bool captured = false;
  double cone_rad = 0;    // captured: taken out is this half angle around it; 0: its outline
  bool measured = false;  // captured: its emission is that of what is taken out

  // Returns whether the lamp shines differently in the two worlds.
  bool is_relit() const { return gain_mixed * tint != glm::dvec3(gain_real); }
};

// A lamp that the light camera sees and that nothing else is known of. Its light is taken out of
// the light around the set, and shines in both worlds.
struct CapturedLamp {
  std::string name;
  glm::dvec3 direction{0, 0, 1};       // unit, from the light camera towards it
  std::optional<glm::dvec3> position;  // replaces the direction, and gives the distance too
  double cone_rad = 0;                 // half angle of the cone that holds its light
  double gain_mixed = 1;
  glm::dvec3 tint{1};  // times its light in the mixed world
};

enum class UnseenRule { constant, horizon, mirror, observer };
enum class LightFrom { camera, recording, set };
enum class LightMode { image, sources, hybrid };
enum class Residual { blurred, dropped };
enum class LightSampling { importance, bsdf };

// A rough model of the surfaces that the light comes from. It puts near walls and lamps in the
// direction in which the virtual objects see them, instead of that from the light camera.
struct Room {
  // A box around its own origin; absent: the surfaces of `file`, a glTF.
  std::optional<glm::dvec3> size_m;
  std::filesystem::path file;
  std::string file_as_written;
  glm::dmat4 world_from_room{1.0};  // rigid
  glm::dvec3 seen_from{0};          // the point that the light is computed for

  friend bool operator==(const Room&, const Room&) = default;
};

// Decides what counts as a light source in the image, and what becomes of the rest
// (LightMode::sources).
struct LightSources {
  double contrast = 8;        // times the mean luminance outside the sources
  double least_share = 0.01;  // fraction of all luminous flux
  Residual residual = Residual::blurred;
  // Distance from the light camera; absent: the sources are on the walls of the room, or at
  // infinity.
  std::optional<double> distance_m;

  friend bool operator==(const LightSources&, const LightSources&) = default;
};

struct Lighting {
  // camera: the light camera's frames, or `environment` instead. recording: the light stored in the
  // session's track.jsonl. set: `environment`, or only the set's lights.
  LightFrom from = LightFrom::camera;
  LightMode mode = LightMode::image;
  LightSampling sampling = LightSampling::importance;
  // A picture of the light from all around, used instead of the fisheye camera.
  std::optional<std::filesystem::path> environment;
  std::string environment_as_written;
  double environment_rotation_rad = 0;  // about world Z, counter-clockwise from above
  double environment_gain = 1;
  glm::dvec3 balance{1};  // film camera's radiance over the light camera's
  int resolution = 0;     // octahedral map, texels a side; 0: from the source
  UnseenRule unseen = UnseenRule::horizon;
  glm::dvec3 unseen_radiance{0};  // UnseenRule::constant
  double smoothing_s = 0.25;      // time constant; 0: none
  double clipped_gain = 1;        // radiance of light that every exposure clips, over white
  std::optional<Room> room;       // absent: all light comes from far away
  LightSources sources;           // LightMode::sources and hybrid
  // Light frame to use; -1: every bracket up to the newest before the observer frame.
  int frame = -1;

  friend bool operator==(const Lighting&, const Lighting&) = default;
};

enum class Estimator { paired, difference };
enum class Composite { additive, ratio, hybrid };
enum class RealRadiance { traced, camera };
enum class Caustics { photons, traced, none };

struct Estimation {
  Estimator estimator = Estimator::paired;
  Composite composite = Composite::additive;
  RealRadiance real_radiance = RealRadiance::traced;
  double composite_floor = 0.02;  // radiance over the sensor's white, below which hybrid adds
  int max_depth = 16;             // path vertices after the camera, 1..64
  int roulette_depth = 2;         // Russian roulette from this vertex on
  std::uint32_t seed = 1;
  double specular_roughness = 1e-3;  // alpha at or below which a lobe is a Dirac delta
  // Share of a shared path's directions that are sampled towards objects of one world only; 0 is
  // the paper's algorithm. At most 0.8: the BSDF keeps the rest.
  double difference_sampling = 0.5;
  Caustics caustics = Caustics::photons;  // how light reaches rough surfaces via mirrors and glass
  double photons = 0.1;                   // photons per pass (sample) and pixel of the picture
  double photon_radius_px = 2;            // in the first pass
  bool filter_textures = false;  // over the footprint of a sample, which shrinks with their number

  friend bool operator==(const Estimation&, const Estimation&) = default;
};

// One of the ways in which the preview may hold its rate: [[quality.preview]].
struct PreviewStep {
  int samples = 1;              // at least so many per pixel
  double scale = 1;             // times the observer's resolution
  std::optional<bool> denoise;  // absent: as quality.denoise

  friend bool operator==(const PreviewStep&, const PreviewStep&) = default;
};
struct Quality {
  int samples = 16;        // per pixel and frame, 1..1'000'000
  bool adaptive = false;   // noisy pixels get more, `samples` on average; not in the preview
  bool denoise = true;     // denoises the composite, guided by its own variance
  bool accumulate = true;  // live: averages with the frames before, where they show the same
  int neighbours = 2;      // offline, denoised: averages with so many frames on each side, 0..4
  std::optional<double> memory_mb;  // that a render may take; absent: by free memory
  double error = 0;    // refines to this rms error over the picture's rms; 0: samples decide
  double seconds = 0;  // time limit of a frame; 0: samples decide
  double scale = 1.0;  // times the observer's resolution, preview only
  double fps = 0;      // preview: kept by fewer samples, then pixels; 0: the others decide
  std::vector<PreviewStep> steps;  // how fps is held, best first; empty: scale, then ever smaller
  bool cpu_instead = false;        // live: the CPU draws while the GPU that was there is gone
  bool hardware_rays = true;       // traced by a graphics card's own units, where it has such
};

// The kinds of press that an action can be bound to.
enum class PressKind { short_press, long_press, double_press };
struct Button {
  std::string name;  // as its driver names it
  PressKind press = PressKind::short_press;
  std::string action;  // a name in daemon/core/set/actions.hpp
};
// The wiring of the contacts on a GPIO chip, or on one of its lines.
struct GpioContact {
  std::string name;  // "gpio:CHIP" or "gpio:CHIP:LINE"
  ContactWiring wiring;
};
struct Control {
  double move_step_m = 0.01;
  double turn_step_rad = 5 * std::numbers::pi / 180;
  double scale_step = 1.05;
  double light_step_stops = 1.0 / 3;
  double tint_step_stops = 0.1;  // between red and blue, or green and the others
  double exposure_step_stops = 1.0 / 3;
};

struct Recording {
  std::filesystem::path directory = "takes";
  std::optional<std::filesystem::path> second_directory;  // on another disk
  std::string slate;               // scene and shot, as on the board; empty: the set's name
  std::string notes;               // written into every take
  double preroll_s = 2;            // length kept in memory and put in front of a take
  double most_behind_s = 2;        // frames are left out rather than recorded later
  std::optional<double> queue_mb;  // limit of what is kept in memory; absent: by free memory
  double reserve_mb = 512;         // free disk space at which a take ends
  double timecode_fps = 25;
  session::VideoCodec codec = session::VideoCodec::ffv1;  // of the cameras' pictures
  bool composite = false;                                 // the shown picture is recorded too
  bool end_over_bus = true;  // members of the bus may end a take; buttons always may
};

// The crew's screen.
struct Display {
  std::string driver = no_driver;
  std::string connector;            // stable name; empty: the first connector that has a screen
  std::optional<DisplayMode> mode;  // absent: the screen's preferred mode
  DisplayScale scale = DisplayScale::letterbox;
  bool osd = true;                // text over the picture
  double text_height = 1.0 / 24;  // as a fraction of the screen's height

  friend bool operator==(const Display&, const Display&) = default;
};

struct Output {
  std::filesystem::path directory = "out";
  bool exr = true;
  bool png = true;
  bool video = true;
};

struct Tracking {
  bool enabled = true;  // false: poses of the session's track.jsonl are used
  std::string family = "tag36h11";
  double decimate = 1.0;
  double min_margin = 20.0;  // decision margin of a detection
  int max_hamming = 1;
  double ambiguity_ratio = 0.2;  // best/second reprojection error above which one tag is ambiguous
  // These are for live pictures only: takes, refinements and offline work never depend on them.
  bool search_parts = true;       // where tags are expected, and the rest in turns
  bool smooth = true;             // the shown pose
  double hold_s = 0.5;            // the longest that the expected pose is shown while none is found
  double hold_error = 0.01;       // likely error at which it ends earlier, of the picture's width
  std::vector<Tag> tags;          // fixed in the world; the camera's pose comes from them
  std::vector<Carrier> carriers;  // found after the camera
};

struct Set {
  std::string name;
  std::filesystem::path file;  // where it was read from, for messages
  Observer observer;
  LightCamera light_camera;
  Tracking tracking;
  // [tags] hide: printed tags are left out of the mixed world, as far as phantoms have them
  // (scene::TagPart).
  bool hides_tags = false;
  std::vector<Object> objects;
  std::vector<Surface> surfaces;
  std::vector<Light> lights;
  std::vector<CapturedLamp> captured_lamps;
  Lighting lighting;
  Estimation estimation;
  Quality quality;
  std::vector<Button> buttons;
  std::vector<GpioContact> contacts;
  Control control;
  Recording recording;
  Display display;
  Output output;
};

}  // namespace previz::set
