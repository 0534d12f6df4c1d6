// Reads FRAMES.json as plain data, checked as far as possible without decoding a picture.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/session/session.hpp"
#include "daemon/core/set/set.hpp"
#include "daemon/tools/exchange/picture_sequence.hpp"
#include "daemon/tools/exchange/video_tags.hpp"
#include "drivers/calibration.hpp"

namespace previz::exchange {

// No frame is taken later than this: times have 64 bits.
inline constexpr std::int64_t latest_ns = std::numeric_limits<std::int64_t>::max();

// The frames of a camera. Lists have one entry a frame; `exposure` is resolved, never empty.
struct FootageDescription {
  std::string source;                         // "observer" or "light"
  PictureSequence pictures;                   // without files: video
  std::vector<std::filesystem::path> videos;  // one clip
  ReadAs read_as;
  std::vector<std::int64_t> timestamps_ns;  // empty: fps, or the container's if that is 0
  double fps = 0;
  std::int64_t start_ns = 0;
  // One entry for all frames, or one a frame.
  std::vector<double> exposure, exposure_s, gain;
};

struct ImportDescription {
  std::string name, clock;
  std::optional<set::Set> set;
  FootageDescription observer;
  std::optional<FootageDescription> light;
  std::optional<ObserverCalibration> observer_calibration;
  std::optional<LightCameraCalibration> light_calibration;
  std::vector<session::TrackRecord> track;  // timestamps not filled in
};

// Reads the description. Throws previz::Error as import_session() does.
ImportDescription read_description(const std::filesystem::path& file);

}  // namespace previz::exchange
