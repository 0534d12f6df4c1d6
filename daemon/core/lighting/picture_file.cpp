#include "daemon/core/lighting/picture_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string_view>

#include "daemon/core/lighting/exr_picture.hpp"
#include "daemon/core/lighting/radiance_picture.hpp"
#include "daemon/core/session/files.hpp"
#include "drivers/error.hpp"

namespace previz::lighting {
namespace {

using namespace std::string_view_literals;

// The formats that people try, by the bytes that a file of each has at an offset.
struct Format {
  std::string_view name;
  std::size_t offset;
  std::string_view bytes;
  bool has_floats = false;  // the format can hold linear light
};

constexpr Format others[] = {
    {"a PNG", 0, "\x89PNG"sv},
    {"a JPEG", 0, "\xff\xd8\xff"sv},
    {"a TIFF", 0, "II*\0"sv, true},
    {"a TIFF", 0, "MM\0*"sv, true},
    {"a TIFF", 0, "II+\0"sv, true},
    {"a KTX texture", 0, "\xabKTX"sv, true},
    {"a DDS texture", 0, "DDS "sv, true},
    {"a WebP", 8, "WEBP"sv},
    {"a BMP", 0, "BM"sv},
    {"a GIF", 0, "GIF8"sv},
    {"a Photoshop file", 0, "8BPS"sv, true},
    {"a HEIF or AVIF picture, or a video", 4, "ftyp"sv},
    {"a JPEG XL", 0, "\xff\x0a"sv, true},
    {"a JPEG XL", 4, "JXL "sv, true},
    {"a PFM", 0, "PF\n"sv, true},
};

[[noreturn]] void refuse(const std::filesystem::path& path, std::string_view bytes) {
  const auto* format = std::ranges::find_if(others, [&](const Format& f) {
    return bytes.size() >= f.offset && bytes.substr(f.offset).starts_with(f.bytes);
  });
  const bool is_known = format != std::end(others);
  std::string message = fmt::format(
      "{}: is {}; an environment needs linear light without an upper end: OpenEXR "
      "(.exr) or Radiance (.hdr)",
      path.string(),
      is_known        ? format->name
      : bytes.empty() ? "empty"
                      : "neither OpenEXR nor Radiance");
  if (is_known && format->has_floats)
    message += ". If its values are floats, convert it: oiiotool IN -o OUT.exr";
  else if (is_known)
    message +=
        ". A file made of it by oiiotool IN --colorconvert sRGB linear -o OUT.exr can be read, but "
        "its lamps are no brighter than white; better export the bracketed picture again, as .exr "
        "or .hdr";
  throw Error(message);
}

}  // namespace

LinearPicture read_linear_picture(const std::filesystem::path& path,
                                  std::vector<std::string>& notes, std::int64_t most_kept) {
  const std::string bytes = session::read_beginning(path, 16);
  if (bytes.starts_with("\x76\x2f\x31\x01"sv))
    return read_exr_picture(path, notes, {.most_kept = most_kept});
  // The name of the program follows.
  if (bytes.starts_with("#?"sv)) return read_radiance_picture(path, notes, most_kept);
  refuse(path, bytes);
}

}  // namespace previz::lighting
