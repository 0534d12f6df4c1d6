#include "tests/truth/truth_take.hpp"

#include <algorithm>
#include <numbers>
#include <sstream>

#include "daemon/core/output/png.hpp"
#include "daemon/core/session/session.hpp"
#include "drivers/error.hpp"
#include "drivers/plate.hpp"

namespace previz::truth {
namespace {

namespace fs = std::filesystem;

std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + "\"";
}

std::string matrix(const glm::dmat4& m) {
  std::ostringstream out;
  out.precision(17);
  out << std::showpoint << "[";
  for (int row = 0; row < 4; ++row) {
    out << (row > 0 ? ", [" : "[");
    for (int column = 0; column < 4; ++column) out << (column > 0 ? ", " : "") << m[column][row];
    out << "]";
  }
  return out.str() + "]";
}

std::string row(const glm::dvec3& v) {
  std::ostringstream out;
  out.precision(17);
  out << std::showpoint << "[" << v.x << ", " << v.y << ", " << v.z << "]";
  return out.str();
}

// A fisheye's lens and pixels spread a lamp by about this much around its disc.
constexpr double blur_deg = 1.5;

// Paths in the set file, which the session's assets stand for.
std::string as_written(const fs::path& file) {
  return file.filename().string();
}

// Written as a shutter time with unit gain and responsivity, so that exposure is their product.
void stamp(Frame& frame, std::uint64_t sequence, std::int64_t timestamp_ns, double exposure) {
  frame.sequence = sequence;
  frame.timestamp_ns = timestamp_ns;
  frame.arrival_ns = timestamp_ns;
  frame.exposure_s = exposure;
  frame.gain = 1;
  frame.exposure = exposure;
}

void require(const TruthSet& set, const TakeOptions& options) {
  const std::string where = set.directory.string() + ": ";
  if (!set.has_pictures) throw Error(where + "has no pictures, which a session is made of");
  if (options.pose == PoseFrom::tracked && set.tags.empty()) {
    throw Error(where + "has no tags, so the pose cannot be tracked (use --pose truth)");
  }
  if (options.light != LightFrom::captured) return;
  if (!set.light_camera || set.light_frames.empty()) {
    throw Error(where + "has no light camera frames (use --light truth)");
  }
}

}  // namespace

Frame frame_from_png(const fs::path& file, const char* source) {
  const Plate plate = output::read_png(file);
  Frame frame;
  frame.source = source;
  frame.width = plate.width;
  frame.height = plate.height;
  frame.format = plate.bits == 8 ? PixelFormat::rgb8 : PixelFormat::rgb16;
  for (const std::uint16_t sample : plate.samples) {
    frame.bytes.push_back(static_cast<std::uint8_t>(sample & 0xff));
    if (plate.bits > 8) frame.bytes.push_back(static_cast<std::uint8_t>(sample >> 8));
  }
  return frame;
}

std::string set_file_text(const TruthSet& set, const TakeOptions& options) {
  std::ostringstream out;
  out.precision(17);
  out << "# Ground truth set " << set.name << ", written by the truth runner.\n"
      << "[set]\nname = " << quoted(set.name) << "\n\n"
      << "[observer]\ndriver = \"replay\"\n\n"
      << "[light_camera]\ndriver = \"" << (set.light_frames.empty() ? "none" : "replay") << "\"\n\n"
      << "[tracking]\nenabled = " << (options.pose == PoseFrom::tracked ? "true" : "false") << "\n";
  if (!set.tag_family.empty()) out << "family = " << quoted(set.tag_family) << "\n";
  for (const set::Tag& tag : set.tags) {
    out << "\n[[tag]]\nid = " << tag.id << "\nsize_m = " << tag.size_m
        << "\nworld_from_tag = " << matrix(tag.world_from_tag) << "\n";
  }
  out << "\n[[object]]\nname = \"phantom\"\nfile = " << quoted(as_written(set.phantom))
      << "\npresence = \"phantom\"\n"
      << "\n[[object]]\nname = \"virtual\"\nfile = " << quoted(as_written(set.virtual_objects))
      << "\npresence = \"virtual\"\n"
      << "\n";
  for (std::size_t i = 0; i < set.relit.size(); ++i) {
    const RelitLamp& lamp = set.relit[i];
    const double cone_deg = lamp.radius_rad * 180 / std::numbers::pi + blur_deg;
    out << "[[captured_light]]\nname = \"lamp " << i << "\"\ndirection = " << row(lamp.direction)
        << "\ncone_deg = " << cone_deg << "\ntint = " << row(lamp.gain_mixed) << "\n\n";
  }
  for (const set::Light& lamp : set.lamps)
    out << "[[light]]\nname = " << quoted(lamp.name)
        << "\ntype = \"sphere\"\nposition = " << row(lamp.position)
        << "\nradius_m = " << lamp.radius_m << "\nemission = " << row(lamp.emission)
        << "\ngain_real = 1\n\n";
  out << "[lighting]\n";
  if (options.light == LightFrom::truth) {
    out << "environment = " << quoted(as_written(set.environment)) << "\n";
  }
  for (const std::string& line : options.lighting) out << line << "\n";
  if (options.hides_tags) out << "\n[tags]\nhide = true\n";
  out << "\n[estimator]\nmax_depth = 16\n";
  for (const std::string& line : options.estimator) out << line << "\n";
  return out.str();
}

void write_take(const TruthSet& set, const TakeOptions& options, const fs::path& directory) {
  require(set, options);
  session::SessionInfo info;
  info.name = set.name;
  info.set_text = set_file_text(set, options);
  info.observer = set.observer;
  info.light = set.light_camera;
  session::SessionWriter writer(directory, info);
  writer.add_asset(as_written(set.phantom), set.phantom);
  writer.add_asset(as_written(set.virtual_objects), set.virtual_objects);
  if (options.light == LightFrom::truth) {
    writer.add_asset(as_written(set.environment), set.environment);
  }

  if (set.light_camera) {
    for (std::size_t i = 0; i < set.light_frames.size(); ++i) {
      const LightFrame& light = set.light_frames[i];
      Frame frame = frame_from_png(light.file, "light");
      stamp(frame, i, light.timestamp_ns, light.exposure);
      writer.write(frame);
    }
  }
  for (std::size_t i = 0; i < set.frames.size(); ++i) {
    const ObserverFrame& observer = set.frames[i];
    Frame frame = frame_from_png(observer.file, "observer");
    stamp(frame, static_cast<std::uint64_t>(observer.index), observer.timestamp_ns, set.exposure);
    writer.write(frame);
    if (options.pose == PoseFrom::tracked) continue;
    session::TrackRecord record;
    record.frame = i;
    record.timestamp_ns = observer.timestamp_ns;
    record.tracked = true;
    record.world_from_camera = observer.world_from_camera;
    writer.write(record);
  }
  writer.close();
}

std::uint64_t session_index(const TruthSet& set, int frame) {
  const auto found = std::find_if(set.frames.begin(), set.frames.end(),
                                  [&](const auto& f) { return f.index == frame; });
  if (found == set.frames.end()) {
    throw Error(set.name + ": has no observer frame " + std::to_string(frame));
  }
  return static_cast<std::uint64_t>(found - set.frames.begin());
}

}  // namespace previz::truth
