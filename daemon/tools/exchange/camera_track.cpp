#include "daemon/tools/exchange/camera_track.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <glm/gtc/quaternion.hpp>
#include <glm/trigonometric.hpp>
#include <initializer_list>
#include <numbers>
#include <optional>
#include <ostream>
#include <set>

#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/set/check.hpp"
#include "daemon/tools/exchange/placed_model.hpp"
#include "daemon/tools/exchange/take_track.hpp"
#include "drivers/error.hpp"

namespace previz::exchange {
namespace {

// The focal length of an unknown sensor is stated for still photography's full frame.
constexpr double full_frame_width_m = 0.036;
constexpr double tenths = 10;  // of a metre: UsdGeomCamera counts lengths on film in them

// Returns the shortest text that reads back bit for bit.
std::string number_text(double value) {
  std::array<char, 32> buffer{};
  const auto end =
      std::to_chars(buffer.data(), buffer.data() + buffer.size(), value == 0 ? 0.0 : value).ptr;
  return {buffer.data(), end};
}

std::string tuple_text(std::initializer_list<double> values) {
  std::string text;
  for (const double value : values) text += (text.empty() ? "(" : ", ") + number_text(value);
  return text + ")";
}

// Converts between a camera that looks along Z with Y down and one that looks along -Z with Y up.
glm::dmat4 turned(const glm::dmat4& world_from_camera) {
  glm::dmat4 matrix = world_from_camera;
  matrix[1] = -matrix[1];
  matrix[2] = -matrix[2];
  return matrix;
}

std::string attribute(const char* type, const char* name, const std::string& value) {
  return std::string("        ") + type + " " + name + " = " + value + "\n";
}

std::string quoted_text(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return quoted + '"';
}

std::string usd_lens(const ObserverCalibration& calibration) {
  const PinholeIntrinsics& i = calibration.intrinsics;
  const double focal = tenths * (calibration.lens ? calibration.lens->focal_length_m
                                                  : full_frame_width_m * i.fx / i.width);
  std::string text;
  text += attribute("float", "focalLength", number_text(focal));
  text += attribute("float", "horizontalAperture", number_text(focal * i.width / i.fx));
  text += attribute("float", "verticalAperture", number_text(focal * i.height / i.fy));
  // The offset is the film's middle relative to the optical axis; coordinate 0 is the centre of the
  // first pixel.
  text += attribute("float", "horizontalApertureOffset",
                    number_text(focal * (0.5 * i.width - (i.cx + 0.5)) / i.fx));
  text += attribute("float", "verticalApertureOffset",
                    number_text(focal * ((i.cy + 0.5) - 0.5 * i.height) / i.fy));
  text += attribute("float2", "clippingRange", "(0.01, 10000)");
  if (calibration.lens) {
    text += attribute("float", "fStop", number_text(calibration.lens->f_number));
    text += attribute("float", "focusDistance", number_text(calibration.lens->focus_distance_m));
  }
  return text;
}

std::string distortion_words(const PinholeIntrinsics& i) {
  const bool has_divisor = i.k4 != 0 || i.k5 != 0 || i.k6 != 0;
  std::string words = std::string("Lens distortion, ") +
                      (has_divisor ? "OpenCV's rational model: k1 " : "Brown-Conrady: k1 ") +
                      number_text(i.k1) + ", k2 " + number_text(i.k2) + ", p1 " +
                      number_text(i.p1) + ", p2 " + number_text(i.p2) + ", k3 " + number_text(i.k3);
  if (!has_divisor) return words;
  return words + ", k4 " + number_text(i.k4) + ", k5 " + number_text(i.k5) + ", k6 " +
         number_text(i.k6);
}

std::string timecode_words(const CameraTrack& track) {
  return track.timecode ? ". Timecode of frame 0: " + track.timecode->first : "";
}

// Says how far the picture's middle is from the optical axis.
std::string chan_offset_words(const PinholeIntrinsics& i) {
  std::array<char, 96> text{};
  std::snprintf(text.data(), text.size(), "which is %+.1f, %+.1f px off the picture's centre",
                i.cx + 0.5 - 0.5 * i.width, i.cy + 0.5 - 0.5 * i.height);
  return text.data();
}

// Returns a file name for each of the set's objects, all different, in one folder.
std::vector<std::string> exported_names(const set::Set& set) {
  std::vector<std::string> names;
  std::set<std::string> used{"camera.usda", "camera.chan"};
  for (const set::Object& object : set.objects) {
    const std::filesystem::path written = std::filesystem::path(object.file_as_written).filename();
    const bool is_name = !written.empty() && written != "." && written != "..";
    const std::filesystem::path wanted = is_name ? written : object.file.filename();
    std::string name = wanted.string();
    for (int number = 2; !used.insert(name).second; ++number)
      name = wanted.stem().string() + "_" + std::to_string(number) + wanted.extension().string();
    names.push_back(name);
  }
  return names;
}

bool can_be_solved(const set::Tracking& tracking) {
  return tracking.enabled && !tracking.tags.empty();
}

// Finds the poses that the take has not, as rendering it does: live, frames are left out, and an
// imported take has none.
void solve_missing(pipeline::Take& take, std::ostream& out, const std::stop_token& stop) {
  if (!can_be_solved(take.set.tracking)) return;
  std::vector<session::TrackRecord>& track = take.session.track;
  std::set<std::uint64_t> known;
  for (const session::TrackRecord& record : track)
    if (record.tracked) known.insert(record.frame);
  if (known.size() == take.observer_stream->records().size()) return;
  out << "finding the poses of "
      << set::plural(take.observer_stream->records().size() - known.size(), "frame") << std::endl;
  const auto is_missing = [&](std::uint64_t frame) { return !known.contains(frame); };
  const auto solved = track_frames(
      take, is_missing, [](const std::string&) {}, stop);
  if (stop.stop_requested()) throw Error(take.session.directory.string() + ": export interrupted");
  std::erase_if(track, [&](const auto& record) { return is_missing(record.frame); });
  for (const TrackedFrame& frame : solved) track.push_back(frame.record);
  std::ranges::sort(track, {}, &session::TrackRecord::frame);
}

// The places of an object over a take.
struct ObjectPlaces {
  std::optional<glm::dmat4> first;  // world_from_file; nothing: it is nowhere in the take
  bool moves = false;
};

ObjectPlaces places_of(const set::Object& object, const std::vector<session::TrackRecord>& track) {
  ObjectPlaces places;
  for (const session::TrackRecord& record : track) {
    const auto found = record.scene.objects.find(object.name);
    std::optional<glm::dmat4> place;
    if (found != record.scene.objects.end())
      place = found->second;
    else if (object.carrier.empty())
      place = object.world_from_file;
    if (!place) continue;
    places.moves = places.moves || (places.first && *places.first != *place);
    if (!places.first) places.first = place;
  }
  return places;
}

void export_scene(const pipeline::Take& take, const std::filesystem::path& directory,
                  std::ostream& out) {
  const std::vector<std::string> names = exported_names(take.set);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const set::Object& object = take.set.objects[i];
    const ObjectPlaces places = places_of(object, take.session.track);
    if (!places.first) {
      out << "object \"" << object.name << "\" is skipped: its carrier, \"" << object.carrier
          << "\", is never found in the take" << std::endl;
      continue;
    }
    std::string content = session::read_file(object.file, {"a model", std::uint64_t{1} << 32});
    try {
      if (*places.first != glm::dmat4(1))
        content = placed_model(content, object.name, *places.first);
    } catch (const Error& error) {
      throw Error(object.file.string() + ": " + error.what());
    }
    session::replace_file(directory / names[i], content);
    out << "  " << names[i] << ": object \"" << object.name << "\", at its position"
        << (places.moves ? " at the start of the take (it moves later)" : "")
        << (object.nodes.empty() ? "" : "; includes nodes that the set file omits") << std::endl;
  }
}

}  // namespace

CameraTrack camera_track(const session::Session& session,
                         const std::vector<session::FrameRecord>& frames,
                         const ObserverCalibration& calibration) {
  std::vector<std::int64_t> times;
  for (const session::FrameRecord& frame : frames) times.push_back(frame.timestamp_ns);
  CameraTrack track{session.info.name,         calibration,   session::nominal_rate(times),
                    timecode_of(session.info), frames.size(), {}};
  for (const session::TrackRecord& record : session.track)
    if (record.tracked) track.keys.push_back({record.frame, record.world_from_camera});
  if (track.keys.empty())
    throw Error(
        session.directory.string() +
        ": no frame has a pose, so there is no camera to export; `previz track` says why; "
        "the set file needs [[tag]] tables (`previz calibrate tags` measures them; --set names "
        "another set file than the take's own), or FRAMES.json a track");
  return track;
}

std::string to_usda(const CameraTrack& track) {
  const std::string fps = number_text(track.rate.fps);
  std::string text =
      "#usda 1.0\n(\n    defaultPrim = \"camera\"\n    metersPerUnit = 1\n"
      "    upAxis = \"Z\"\n    startTimeCode = 0\n    endTimeCode = " +
      std::to_string(track.frames == 0 ? 0 : track.frames - 1) +
      "\n    timeCodesPerSecond = " + fps + "\n    framesPerSecond = " + fps + "\n)\n\n";
  text += "def Xform \"camera\" (\n    doc = " +
          quoted_text(track.name + ". " + distortion_words(track.calibration.intrinsics) +
                      timecode_words(track)) +
          "\n)\n{\n";
  std::string places, turns;
  glm::dquat before(1, 0, 0, 0);
  for (const CameraKey& key : track.keys) {
    const glm::dmat4 m = turned(key.world_from_camera);
    glm::dquat turn = glm::normalize(glm::quat_cast(glm::dmat3(m)));
    if (glm::dot(turn, before) < 0) turn = -turn;  // the same turn: readers interpolate
    before = turn;
    const std::string at = "        " + std::to_string(key.frame) + ": ";
    places += at + tuple_text({m[3].x, m[3].y, m[3].z}) + ",\n";
    turns += at + tuple_text({turn.w, turn.x, turn.y, turn.z}) + ",\n";
  }
  text += "    double3 xformOp:translate.timeSamples = {\n" + places + "    }\n";
  text += "    quatd xformOp:orient.timeSamples = {\n" + turns + "    }\n";
  text += "    uniform token[] xformOpOrder = [\"xformOp:translate\", \"xformOp:orient\"]\n\n";
  return text + "    def Camera \"lens\"\n    {\n" + usd_lens(track.calibration) + "    }\n}\n";
}

glm::dvec3 zxy_degrees(const glm::dmat3& rotation) {
  const auto at = [&](int row, int column) { return rotation[column][row]; };
  const double x = std::asin(std::clamp(-at(1, 2), -1.0, 1.0));
  const double y = std::atan2(at(0, 2), at(2, 2));
  const double z = std::atan2(at(1, 0), at(1, 1));
  // If the camera looks straight up or down, only the sum of the other two angles is known.
  if (std::abs(at(1, 2)) > 1 - 1e-12)
    return glm::degrees(glm::dvec3(x, 0, std::atan2(-at(0, 1), at(0, 0))));
  return glm::degrees(glm::dvec3(x, y, z));
}

std::string to_chan(const CameraTrack& track) {
  const glm::dmat4 y_up_from_z_up{{1, 0, 0, 0}, {0, 0, -1, 0}, {0, 1, 0, 0}, {0, 0, 0, 1}};
  const PinholeIntrinsics& lens = track.calibration.intrinsics;
  const double vfov = glm::degrees(2 * std::atan(0.5 * lens.height / lens.fy));
  std::string text;
  for (const CameraKey& key : track.keys) {
    const glm::dmat4 m = y_up_from_z_up * turned(key.world_from_camera);
    const glm::dvec3 turn = zxy_degrees(glm::dmat3(m));
    text += std::to_string(key.frame);
    for (const double value : {m[3].x, m[3].y, m[3].z, turn.x, turn.y, turn.z, vfov})
      text.append("\t").append(number_text(value));
    text += "\n";
  }
  return text;
}

void export_take(const ExportOptions& options, std::ostream& out) {
  pipeline::Take take =
      pipeline::open_take(options.session, options.set_file, options.any_paths, options.stop);
  for (const std::string& what : take.session.missing) out << "session: " << what << std::endl;
  solve_missing(take, out, options.stop);
  const CameraTrack track =
      camera_track(take.session, take.observer_stream->records(), take.observer);
  std::error_code code;
  std::filesystem::create_directories(options.directory, code);
  if (!std::filesystem::is_directory(options.directory))
    throw Error(options.directory.string() + ": cannot be created: " + code.message());
  session::replace_file(options.directory / "camera.usda", to_usda(track));
  session::replace_file(options.directory / "camera.chan", to_chan(track));
  out << options.directory.string() << ": camera.usda, camera.chan, "
      << set::plural(track.keys.size(), "pose") << " of " << set::plural(track.frames, "frame");
  if (track.keys.size() < track.frames) out << "; the others have none (`previz track` says why)";
  out << std::endl;
  out << "  " << session::words_of(track.rate);
  if (track.timecode) out << "; timecode of frame 0: " << track.timecode->first;
  out << std::endl;
  out << "  camera.chan: rotation order ZXY (set it in Blender, which uses XYZ); it holds "
         "neither "
         "the distortion nor the principal point, "
      << chan_offset_words(track.calibration.intrinsics) << std::endl;
  export_scene(take, options.directory, out);
}

}  // namespace previz::exchange
