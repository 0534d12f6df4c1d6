#include "daemon/exchange/picture_header.hpp"

#include <algorithm>
#include <string>

#include "daemon/exchange/footage.hpp"
#include "drivers/error.hpp"
#include "drivers/session/files.hpp"

namespace previz::exchange {
namespace {

using namespace std::string_view_literals;

// The bytes of a file, read as numbers of either order; what is past the end reads as nothing.
class HeaderBytes {
 public:
  explicit HeaderBytes(std::string_view bytes, bool big_endian = true)
      : bytes_(bytes), big_endian_(big_endian) {}

  std::optional<std::uint64_t> number(std::uint64_t at, std::size_t size) const {
    if (at > bytes_.size() || bytes_.size() - at < size) return std::nullopt;
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < size; ++i)
      value =
          value << 8 | static_cast<unsigned char>(bytes_[at + (big_endian_ ? i : size - 1 - i)]);
    return value;
  }

 private:
  std::string_view bytes_;
  bool big_endian_;
};

std::optional<PictureSize> both(std::optional<std::uint64_t> width,
                                std::optional<std::uint64_t> height) {
  if (!width || !height) return std::nullopt;
  return PictureSize{*width, *height};
}

// ISO/IEC 10918-1, B.2: segments with their lengths up to the frame header (SOF).
std::optional<PictureSize> jpeg_size(const HeaderBytes& bytes) {
  for (std::uint64_t at = 2;;) {
    const auto marker = bytes.number(at, 2);
    if (!marker || *marker >> 8 != 0xff) return std::nullopt;
    const std::uint64_t kind = *marker & 0xff;
    if (kind == 0xff) {  // a fill byte
      ++at;
      continue;
    }
    // C4, C8 and CC are no frame headers.
    if (kind >= 0xc0 && kind <= 0xcf && kind != 0xc4 && kind != 0xc8 && kind != 0xcc)
      return both(bytes.number(at + 7, 2), bytes.number(at + 5, 2));
    const auto length = bytes.number(at + 2, 2);
    if (!length || *length < 2) return std::nullopt;
    at += 2 + *length;
  }
}

// TIFF 6.0, section 2: the first directory has the tags 256 and 257. OpenCV reads the first
// picture.
std::optional<PictureSize> tiff_size(const HeaderBytes& bytes) {
  constexpr std::uint64_t of_two_bytes = 3, width_tag = 256, height_tag = 257;
  const auto directory = bytes.number(4, 4);
  const auto entries = directory ? bytes.number(*directory, 2) : std::nullopt;
  if (!entries) return std::nullopt;
  std::optional<std::uint64_t> width, height;
  for (std::uint64_t i = 0; i < *entries; ++i) {
    const std::uint64_t entry = *directory + 2 + 12 * i;
    const auto tag = bytes.number(entry, 2);
    const bool is_width = tag == width_tag;
    if (!is_width && tag != height_tag) continue;
    std::optional<std::uint64_t>& length = is_width ? width : height;
    if (length) return std::nullopt;  // of two, libraries choose differently
    const std::size_t size = bytes.number(entry + 2, 2) == of_two_bytes ? 2 : 4;
    length = bytes.number(entry + 8, size);
  }
  return both(width, height);
}

}  // namespace

std::optional<PictureSize> picture_size(std::string_view file) {
  const HeaderBytes bytes(file);
  if (file.starts_with("\x89PNG\r\n\x1a\n"sv))
    return both(bytes.number(16, 4), bytes.number(20, 4));
  if (file.starts_with("\xff\xd8\xff"sv)) return jpeg_size(bytes);
  if (file.starts_with("MM\0*"sv)) return tiff_size(bytes);
  if (file.starts_with("II*\0"sv)) return tiff_size(HeaderBytes(file, false));
  return std::nullopt;
}

void check_picture_file(const std::filesystem::path& file) {
  const std::optional<PictureSize> size = picture_size(session::read_file(file));
  if (!size) throw Error(file.string() + ": cannot be read as a picture; allowed: PNG, JPEG, TIFF");
  if (size->width == 0 || size->height == 0 || size->width > most_pixels / size->height)
    throw Error(file.string() + ": has " + std::to_string(size->width) + "x" +
                std::to_string(size->height) + " pixels; allowed: at most " +
                std::to_string(most_pixels));
}

}  // namespace previz::exchange
