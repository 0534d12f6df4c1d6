#include "daemon/tools/calibrate/sensor/brackets.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <sstream>

#include "daemon/core/session/files.hpp"
#include "daemon/tools/calibrate/lens/exif.hpp"
#include "daemon/tools/calibrate/lens/source.hpp"
#include "drivers/error.hpp"
#include "drivers/plate.hpp"

namespace previz::calibrate {
namespace {

namespace fs = std::filesystem;

constexpr double same_exposure = 0.01;
constexpr std::size_t least_pictures = 3;

BracketPicture picture_of(const NamedFrame& named, double exposure) {
  const Plate plate = to_plate(*named.frame);
  BracketPicture picture{named.name, exposure, plate.width, plate.height, {}};
  for (const std::uint16_t sample : plate.samples)
    picture.rgb.push_back(std::uint8_t(plate.bits == 8 ? sample : (sample + 128) / 257));
  return picture;
}

// Reads "0.25" or "1/4"; returns nothing if the text is neither.
std::optional<double> seconds(const std::string& text) {
  const char* const end = text.data() + text.size();
  double number = 0, divisor = 1;
  auto read = std::from_chars(text.data(), end, number);
  if (read.ec == std::errc{} && read.ptr != end && *read.ptr == '/')
    read = std::from_chars(read.ptr + 1, end, divisor);
  const double value = number / divisor;
  if (read.ec != std::errc{} || read.ptr != end || !(value > 0) || !std::isfinite(value))
    return std::nullopt;
  return value;
}

std::map<std::string, double> read_exposures(const fs::path& file) {
  std::istringstream stream(session::read_file(file, {"a list of exposure times", 1 << 22}));
  std::map<std::string, double> times;
  int number = 0;
  for (std::string line; std::getline(stream, line);) {
    ++number;
    std::istringstream words(line);
    std::string name, time;
    if (!(words >> name) || name.front() == '#') continue;
    words >> time;
    const auto value = seconds(time);
    if (!value)
      throw Error(file.string() + ":" + std::to_string(number) + ": \"" + time +
                  "\" is not an exposure time; allowed: file name and seconds, like "
                  "window_03.jpg 1/250");
    times[name] = *value;
  }
  return times;
}

// Returns a number proportional to the light that the sensor turns into a signal: time * area of
// the aperture * speed.
double exif_exposure(const fs::path& file) {
  const PhotoData photo = read_exif(file);
  if (!photo.exposure_s)
    throw Error(file.string() +
                ": has no EXIF exposure time; give --exposures, a file of lines NAME SECONDS");
  const double f = photo.f_number.value_or(1);
  return *photo.exposure_s * photo.iso.value_or(100) / 100 / (f * f);
}

double listed_exposure(const std::map<std::string, double>& times, const fs::path& file,
                       const fs::path& list) {
  const auto time = times.find(file.filename().string());
  if (time == times.end())
    throw Error(list.string() + ": has no line for " + file.filename().string());
  return time->second;
}

std::vector<BracketPicture> read_folder(const fs::path& folder,
                                        const std::optional<fs::path>& exposures) {
  std::map<std::string, double> times;
  if (exposures) times = read_exposures(*exposures);
  std::vector<BracketPicture> pictures;
  const auto source = open_source(folder, "");
  for (const fs::path& file : picture_files(folder)) {
    const double exposure =
        exposures ? listed_exposure(times, file, *exposures) : exif_exposure(file);
    pictures.push_back(picture_of(*source->next(), exposure));
  }
  return pictures;
}

bool has_exposure(const std::vector<BracketPicture>& pictures, double exposure) {
  return std::ranges::any_of(pictures, [&](const BracketPicture& picture) {
    return std::abs(picture.exposure / exposure - 1) <= same_exposure;
  });
}

std::vector<BracketPicture> read_session(const fs::path& directory, const std::string& stream) {
  std::vector<BracketPicture> pictures;
  const auto source = open_source(directory, stream);
  for (auto named = source->next(); named; named = source->next()) {
    const double exposure = named->frame->exposure_s * named->frame->gain;
    if (!(exposure > 0))
      throw Error(named->name + ": unknown shutter time; the response curve needs it");
    if (!has_exposure(pictures, exposure)) pictures.push_back(picture_of(*named, exposure));
  }
  return pictures;
}

void check(const std::vector<BracketPicture>& pictures) {
  if (pictures.size() < least_pictures)
    throw Error(std::to_string(pictures.size()) + " pictures of different exposure; at least " +
                std::to_string(least_pictures) + " are needed, a stop or two apart");
  for (std::size_t i = 1; i < pictures.size(); ++i)
    if (pictures[i].exposure <= pictures[i - 1].exposure * (1 + same_exposure))
      throw Error(pictures[i].name + ": has the same exposure as " + pictures[i - 1].name +
                  "; give each exposure once");
  for (const BracketPicture& picture : pictures)
    if (picture.width != pictures[0].width || picture.height != pictures[0].height)
      throw Error(picture.name + ": differs in size from " + pictures[0].name);
}

}  // namespace

std::vector<BracketPicture> read_bracket(const fs::path& footage, const std::string& stream,
                                         const std::optional<fs::path>& exposures) {
  if (!is_session(footage) && !fs::is_directory(footage))
    throw Error(footage.string() + ": is neither a session nor a folder of pictures");
  auto pictures =
      is_session(footage) ? read_session(footage, stream) : read_folder(footage, exposures);
  std::ranges::sort(pictures, {}, &BracketPicture::exposure);
  check(pictures);
  return pictures;
}

}  // namespace previz::calibrate
