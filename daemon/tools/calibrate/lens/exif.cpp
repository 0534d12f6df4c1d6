#include "daemon/tools/calibrate/lens/exif.hpp"

#include <cmath>
#include <exiv2/exiv2.hpp>

#include "drivers/box/reading.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

// Returns a positive finite number or nothing; cameras write 0 for what they do not know.
std::optional<double> number(const Exiv2::ExifData& data, const char* key) {
  const auto found = data.findKey(Exiv2::ExifKey(key));
  if (found == data.end() || found->count() == 0) return std::nullopt;
  const double value = found->toFloat();
  if (!(value > 0) || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<double> times(std::optional<double> value, double factor) {
  return value ? std::optional(*value * factor) : std::nullopt;
}

}  // namespace

PhotoData read_exif(const std::filesystem::path& file) try {
  const box::Reading reading(file);
  const auto image = Exiv2::ImageFactory::open(file.string());
  image->readMetadata();
  const Exiv2::ExifData& data = image->exifData();
  PhotoData photo;
  photo.exposure_s = number(data, "Exif.Photo.ExposureTime");
  photo.f_number = number(data, "Exif.Photo.FNumber");
  photo.iso = number(data, "Exif.Photo.ISOSpeedRatings");
  photo.focal_length_m = times(number(data, "Exif.Photo.FocalLength"), 1e-3);
  photo.focus_distance_m = number(data, "Exif.Photo.SubjectDistance");
  const auto lens = data.findKey(Exiv2::ExifKey("Exif.Photo.LensModel"));
  if (lens != data.end()) photo.lens = lens->toString();
  return photo;
} catch (const Exiv2::Error& error) {
  throw Error(file.string() + ": cannot be read: " + error.what());
}

}  // namespace previz::calibrate
