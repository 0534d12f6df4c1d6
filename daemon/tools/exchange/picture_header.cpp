#include "daemon/tools/exchange/picture_header.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "daemon/tools/exchange/footage.hpp"
#include "drivers/error.hpp"

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

// ISO/IEC 10918-1, B.2: segments with their lengths up to the frame header (SOF), whose place is
// returned.
std::optional<std::uint64_t> jpeg_frame(const HeaderBytes& bytes) {
  for (std::uint64_t at = 2;;) {
    const auto marker = bytes.number(at, 2);
    if (!marker || *marker >> 8 != 0xff) return std::nullopt;
    const std::uint64_t kind = *marker & 0xff;
    if (kind == 0xff) {  // a fill byte
      ++at;
      continue;
    }
    // C4, C8 and CC are no frame headers.
    if (kind >= 0xc0 && kind <= 0xcf && kind != 0xc4 && kind != 0xc8 && kind != 0xcc) return at;
    const auto length = bytes.number(at + 2, 2);
    if (!length || *length < 2) return std::nullopt;
    at += 2 + *length;
  }
}

std::optional<PictureSize> jpeg_size(const HeaderBytes& bytes) {
  const auto at = jpeg_frame(bytes);
  return at ? both(bytes.number(*at + 7, 2), bytes.number(*at + 5, 2)) : std::nullopt;
}

// Tags of TIFF 6.0, TIFF/EP and DNG.
enum Tag : std::uint64_t {
  subfile_type = 254,
  image_width = 256,
  image_height = 257,
  bits_per_sample = 258,
  compression = 259,
  photometric = 262,
  planar_configuration = 284,
  sample_format = 339,
  sub_directories = 330,
  dng_version = 50706,
};

// The first value of each tag of a directory, if it is of two or four bytes; nothing for a tag that
// is there twice, of which libraries choose differently.
using Directory = std::map<std::uint64_t, std::optional<std::uint64_t>>;

HeaderBytes tiff_bytes(std::string_view file) {
  return HeaderBytes(file, file.starts_with('M'));
}

// TIFF 6.0, section 2. An entry whose values do not fit into four bytes has their place there.
Directory tiff_directory(const HeaderBytes& bytes, std::uint64_t at) {
  constexpr std::uint64_t of_two_bytes = 3, of_four_bytes = 4;
  Directory directory;
  const std::uint64_t entries = bytes.number(at, 2).value_or(0);
  for (std::uint64_t i = 0; i < entries; ++i) {
    const std::uint64_t entry = at + 2 + 12 * i;
    const auto tag = bytes.number(entry, 2), type = bytes.number(entry + 2, 2);
    if (!tag || !type) break;
    const std::size_t size = *type == of_two_bytes ? 2 : 4;
    std::uint64_t place = entry + 8;
    if ((*type == of_two_bytes || *type == of_four_bytes) &&
        bytes.number(entry + 4, 4).value_or(0) > 4 / size)
      place = bytes.number(place, 4).value_or(0);
    const bool is_number = *type == of_two_bytes || *type == of_four_bytes;
    const auto [known, is_new] =
        directory.try_emplace(*tag, is_number ? bytes.number(place, size) : std::nullopt);
    if (!is_new) known->second = std::nullopt;
  }
  return directory;
}

Directory first_directory(std::string_view tiff) {
  const HeaderBytes bytes = tiff_bytes(tiff);
  const auto at = bytes.number(4, 4);
  return at ? tiff_directory(bytes, *at) : Directory{};
}

std::optional<std::uint64_t> value_of(const Directory& directory, Tag tag) {
  const auto found = directory.find(tag);
  return found == directory.end() ? std::nullopt : found->second;
}

// OpenCV reads the first picture.
std::optional<PictureSize> tiff_size(std::string_view file) {
  const Directory first = first_directory(file);
  return both(value_of(first, image_width), value_of(first, image_height));
}

// Google's "WebP Container Specification": a canvas, a lossy picture or one without loss.
std::optional<PictureSize> webp_size(std::string_view file) {
  const HeaderBytes bytes(file, false);
  const std::string_view form = file.substr(std::min<std::size_t>(file.size(), 12), 4);
  const auto one_more = [](std::optional<std::uint64_t> value, int shift, std::uint64_t mask) {
    return value ? std::optional((*value >> shift & mask) + 1) : std::nullopt;
  };
  if (form == "VP8X"sv)
    return both(one_more(bytes.number(24, 3), 0, ~0u), one_more(bytes.number(27, 3), 0, ~0u));
  if (form == "VP8L"sv)
    return both(one_more(bytes.number(21, 4), 0, 0x3fff),
                one_more(bytes.number(21, 4), 14, 0x3fff));
  if (form != "VP8 "sv) return std::nullopt;
  const auto width = bytes.number(26, 2), height = bytes.number(28, 2);
  return width && height ? std::optional(PictureSize{*width & 0x3fff, *height & 0x3fff})
                         : std::nullopt;
}

// SMPTE ST 268: numbers are of the order in which the magic number stands.
std::optional<PictureSize> dpx_size(std::string_view file) {
  constexpr std::size_t header_bytes = 1664;  // file, image and orientation
  if (file.size() < header_bytes) return std::nullopt;
  const HeaderBytes bytes(file, file.starts_with('S'));
  return both(bytes.number(772, 4), bytes.number(776, 4));
}

// How the files of a format begin.
struct Beginning {
  std::string_view bytes;
  std::size_t at = 0;
};

constexpr std::array<std::pair<Beginning, PictureKind>, 8> kinds = {
    {{{"\x89PNG\r\n\x1a\n"sv}, PictureKind::png},
     {{"\xff\xd8\xff"sv}, PictureKind::jpeg},
     {{"MM\0*"sv}, PictureKind::tiff},
     {{"II*\0"sv}, PictureKind::tiff},
     {{"WEBP"sv, 8}, PictureKind::webp},
     {{"SDPX"sv}, PictureKind::dpx},
     {{"XPDS"sv}, PictureKind::dpx},
     {{"\x76\x2f\x31\x01"sv}, PictureKind::exr}}};

constexpr const char* raw_photograph =
    "is a raw photograph; develop it to TIFF or PNG, or take the camera's JPEG";
constexpr const char* video_file = "is a video; give it as \"video\", not as a picture";

// What people have and previzd does not read, with what to do.
constexpr std::array<std::pair<Beginning, const char*>, 20> others = {
    {{{"ftypcrx"sv, 4}, raw_photograph},
     {{"FUJIFILMCCD-RAW"sv}, raw_photograph},
     {{"IIU\0"sv}, raw_photograph},
     {{"IIRO"sv}, raw_photograph},
     {{"IIRS"sv}, raw_photograph},
     {{"MMOR"sv}, raw_photograph},
     {{"FOVb"sv}, raw_photograph},
     {{"\0MRM"sv}, raw_photograph},
     {{"ftyphei"sv, 4}, "is a HEIC picture; convert it (heif-convert IN.heic OUT.png)"},
     {{"ftyphev"sv, 4}, "is a HEIC picture; convert it (heif-convert IN.heic OUT.png)"},
     {{"ftypmif1"sv, 4}, "is a HEIF picture; convert it (heif-convert IN.heic OUT.png)"},
     {{"ftypavi"sv, 4}, "is an AVIF picture; convert it (heif-convert IN.avif OUT.png)"},
     {{"ftyp"sv, 4}, video_file},
     {{"\x1a\x45\xdf\xa3"sv}, video_file},
     {{"MM\0+"sv}, "is a BigTIFF; save it as a TIFF of less than 4 GiB, or as PNG"},
     {{"II+\0"sv}, "is a BigTIFF; save it as a TIFF of less than 4 GiB, or as PNG"},
     {{"8BPS"sv}, "is a Photoshop document; save it as TIFF or PNG"},
     {{"\0\0\0\x0cjP  "sv}, "is a JPEG 2000 picture; convert it to TIFF or PNG"},
     {{"\x80\x2a\x5f\xd7"sv}, "is a Cineon picture; convert it to DPX, linear OpenEXR or TIFF"},
     {{"#?R"sv}, "is a Radiance picture; convert it to OpenEXR"}}};

constexpr const char* allowed_kinds = "allowed: PNG, JPEG, TIFF, WebP, DPX, OpenEXR";

bool begins(std::string_view file, const Beginning& with) {
  return file.size() >= with.at && file.substr(with.at).starts_with(with.bytes);
}

std::optional<PictureKind> kind_of(std::string_view file) {
  for (const auto& [beginning, kind] : kinds)
    if (begins(file, beginning)) return kind;
  return std::nullopt;
}

bool is_raw_name(const std::string& ending) {
  static constexpr std::array endings = {".3fr", ".arw", ".cr2", ".cr3", ".crw", ".dcr", ".dng",
                                         ".erf", ".fff", ".iiq", ".kdc", ".mef", ".mos", ".mrw",
                                         ".nef", ".nrw", ".orf", ".pef", ".raf", ".raw", ".rw2",
                                         ".rwl", ".sr2", ".srf", ".srw", ".x3f"};
  return std::ranges::find(endings, ending) != endings.end();
}

// Raw photographs are TIFF with the sensor's mosaic in it, often behind a thumbnail.
bool is_raw(std::string_view tiff) {
  // The mosaic, and what is linear of it (TIFF/EP, DNG).
  constexpr std::array<std::uint64_t, 2> of_sensors = {32803, 34892};
  // How Sony, Nikon, Pentax, Kodak and Samsung pack it.
  constexpr std::array<std::uint64_t, 6> packings = {32767, 34713, 65535, 65000, 32770, 32772};
  const HeaderBytes bytes = tiff_bytes(tiff);
  const Directory first = first_directory(tiff);
  std::vector<Directory> directories = {first};
  if (const auto at = value_of(first, sub_directories))
    directories.push_back(tiff_directory(bytes, *at));
  return tiff.substr(0, 10).ends_with("CR"sv) || first.contains(dng_version) ||
         std::ranges::any_of(directories, [&](const Directory& directory) {
           const std::uint64_t colors = value_of(directory, photometric).value_or(0);
           const std::uint64_t packing = value_of(directory, compression).value_or(0);
           return std::ranges::find(of_sensors, colors) != of_sensors.end() ||
                  std::ranges::find(packings, packing) != packings.end();
         });
}

// Returns why a TIFF cannot be a plate, or "".
std::string tiff_fault(std::string_view tiff) {
  constexpr std::uint64_t reduced = 1, cmyk = 5, lab = 8, black_is_zero = 1, rgb = 2;
  constexpr std::uint64_t whole_numbers = 1;
  if (is_raw(tiff)) return raw_photograph;
  const Directory first = first_directory(tiff);
  if (value_of(first, subfile_type).value_or(0) & reduced)
    return first.contains(sub_directories) ? raw_photograph
                                           : "has a thumbnail as its first picture; save its full "
                                             "picture alone, as TIFF or PNG";
  const std::uint64_t colors = value_of(first, photometric).value_or(1);
  const bool is_deep = value_of(first, bits_per_sample).value_or(1) > 8;
  if (colors == cmyk) return "has the colours of print (CMYK); convert it to RGB";
  if (colors >= lab && colors <= lab + 2) return "has L*a*b* colours; convert it to RGB";
  if (is_deep && colors != black_is_zero && colors != rgb)
    return "has more than 8 bits, and is neither RGB nor grey with black as 0; save it as one of "
           "these";
  if (is_deep && value_of(first, sample_format).value_or(whole_numbers) != whole_numbers)
    return "has samples that are no whole numbers from 0 on; save it as OpenEXR, or with 16 bits";
  return {};
}

std::string jpeg_fault(std::string_view jpeg) {
  const HeaderBytes bytes(jpeg);
  const auto at = jpeg_frame(bytes);
  const bool has_four = at && bytes.number(*at + 9, 1).value_or(0) > 3;
  return has_four ? "has the colours of print (CMYK); convert it to RGB" : "";
}

void check_pixels(const std::filesystem::path& file, const PictureSize& size) {
  if (size.width == 0 || size.height == 0 || size.width > most_pixels / size.height)
    throw Error(file.string() + ": has " + std::to_string(size.width) + "x" +
                std::to_string(size.height) + " pixels; allowed: at most " +
                std::to_string(most_pixels));
}

}  // namespace

std::optional<PictureSize> picture_size(std::string_view file) {
  const auto kind = kind_of(file);
  if (kind == PictureKind::png) {
    const HeaderBytes bytes(file);
    return both(bytes.number(16, 4), bytes.number(20, 4));
  }
  if (kind == PictureKind::jpeg) return jpeg_size(HeaderBytes(file));
  if (kind == PictureKind::tiff) return tiff_size(file);
  if (kind == PictureKind::webp) return webp_size(file);
  if (kind == PictureKind::dpx) return dpx_size(file);
  return std::nullopt;
}

std::string picture_fault(const std::filesystem::path& file, std::string_view content) {
  const auto kind = kind_of(content);
  if (is_raw_name(ending_of(file))) return raw_photograph;
  if (kind == PictureKind::tiff) return tiff_fault(content);
  if (kind == PictureKind::jpeg) return jpeg_fault(content);
  for (const auto& [beginning, words] : others)
    if (!kind && begins(content, beginning)) return words;
  return {};
}

PictureKind check_picture_file(const std::filesystem::path& file, std::string_view content) {
  if (const std::string fault = picture_fault(file, content); !fault.empty())
    throw Error(file.string() + ": " + fault);
  const auto kind = kind_of(content);
  if (kind == PictureKind::exr) return *kind;  // its reader has limits of its own
  const std::optional<PictureSize> size = picture_size(content);
  if (!kind || !size)
    throw Error(file.string() + ": cannot be read as a picture; " + allowed_kinds);
  check_pixels(file, *size);
  return *kind;
}

bool has_deep_planes(std::string_view tiff) {
  constexpr std::uint64_t planes = 2;
  const Directory first = first_directory(tiff);
  return value_of(first, planar_configuration) == planes && value_of(first, bits_per_sample) == 16;
}

std::string ending_of(const std::filesystem::path& file) {
  std::string ending = file.extension().string();
  std::ranges::transform(ending, ending.begin(), [](unsigned char c) { return std::tolower(c); });
  return ending;
}

bool is_picture_name(const std::filesystem::path& file) {
  static constexpr std::array endings = {".png",  ".jpg",  ".jpeg", ".tif",
                                         ".tiff", ".webp", ".dpx",  ".exr"};
  return std::ranges::find(endings, ending_of(file)) != endings.end();
}

}  // namespace previz::exchange
