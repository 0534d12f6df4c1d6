#include "daemon/tools/exchange/picture_color.hpp"

extern "C" {
#include <libavutil/pixdesc.h>
}

#include <fmt/format.h>
#include <lcms2.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <exiv2/exiv2.hpp>
#include <map>
#include <span>
#include <type_traits>

#include "daemon/core/set/problems.hpp"
#include "drivers/calibration.hpp"
#include "drivers/error.hpp"

namespace previz::exchange {
namespace {

using namespace std::string_view_literals;

constexpr std::array<double, 9> unit_matrix = {1, 0, 0, 0, 1, 0, 0, 0, 1};

std::uint32_t big_endian(std::string_view bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i)
    value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  return value;
}

// ---- which tag holds

// The chunks of a PNG that stand before its pixels (PNG, third edition, section 5).
std::map<std::string_view, std::string_view> png_chunks(std::string_view file) {
  constexpr std::size_t signature = 8, head = 8, checksum = 4;
  std::map<std::string_view, std::string_view> chunks;
  if (!file.starts_with("\x89PNG"sv)) return chunks;
  for (std::size_t at = signature; at + head <= file.size();) {
    const std::size_t length = big_endian(file, at);
    const std::string_view name = file.substr(at + 4, 4);
    if (name == "IDAT" || length > file.size() - at - head) break;
    chunks.try_emplace(name, file.substr(at + head, length));
    at += head + length + checksum;
  }
  return chunks;
}

// The PNG's own order: cICP, iCCP, sRGB, gAMA with cHRM.
ColorTag png_tag(std::string_view file) {
  constexpr std::size_t cicp_bytes = 4, gamma_bytes = 4, chromaticity_bytes = 32;
  const std::string gamma_of_srgb("\0\0\xb1\x8f", gamma_bytes);  // 45455
  const auto chunks = png_chunks(file);
  const auto of = [&](const char* name, std::size_t bytes) {
    const auto found = chunks.find(name);
    return found == chunks.end() || found->second.size() != bytes ? std::string()
                                                                  : std::string(found->second);
  };
  if (const std::string cicp = of("cICP", cicp_bytes); !cicp.empty())
    return {ColorTag::Kind::cicp, cicp};
  if (chunks.contains("iCCP")) return {ColorTag::Kind::icc};  // packed: see color_tag_of()
  if (chunks.contains("sRGB")) return {ColorTag::Kind::srgb};
  const std::string gamma = of("gAMA", gamma_bytes), primaries = of("cHRM", chromaticity_bytes);
  if (gamma.empty() && primaries.empty()) return {};
  return {ColorTag::Kind::gamma, (gamma.empty() ? gamma_of_srgb : gamma) + primaries};
}

std::string exif_numbers(const Exiv2::ExifData& data, const char* key, std::size_t count) {
  const auto found = data.findKey(Exiv2::ExifKey(key));
  if (found == data.end() || static_cast<std::size_t>(found->count()) != count) return {};
  std::string text;
  for (std::size_t i = 0; i < count; ++i)
    text += fmt::format("{} ", found->toFloat(static_cast<long>(i)));
  return text;
}

Chromaticities chromaticities_in(const std::string& text) {
  Chromaticities colors{};
  const char* at = text.data();
  const char* const end = at + text.size();
  for (std::size_t i = 0; i < 8 && at < end; ++i, ++at)
    at = std::from_chars(at, end, colors[i / 2][i % 2]).ptr;
  return colors;
}

ColorTag exif_tag(const Exiv2::ExifData& data, bool is_tiff) {
  // Exif 2.32, table 8; 2 is written by cameras though it is not there.
  constexpr std::int64_t srgb = 1, adobe = 2;
  const auto text_of = [&](const char* key) {
    const auto found = data.findKey(Exiv2::ExifKey(key));
    return found == data.end() || found->count() == 0 ? std::string() : found->toString();
  };
  const std::string space = text_of("Exif.Photo.ColorSpace");
  // DCF 2.0, 3.2.5: "R03" is the option file, whose colours are Adobe RGB.
  if (space == std::to_string(adobe) ||
      text_of("Exif.Iop.InteroperabilityIndex").starts_with("R03"))
    return {ColorTag::Kind::adobe};
  if (is_tiff && !text_of("Exif.Image.TransferFunction").empty())
    return {ColorTag::Kind::white, "curve"};
  const std::string primaries = exif_numbers(data, "Exif.Image.PrimaryChromaticities", 6);
  const std::string white = exif_numbers(data, "Exif.Image.WhitePoint", 2);
  if (rec709_from(chromaticities_in(primaries + white)))
    return {ColorTag::Kind::white, primaries + white};
  if (space == std::to_string(srgb)) return {ColorTag::Kind::srgb};
  return {};
}

// Exiv2 returns its bytes in one way before 0.28, and in another from then on.
template <typename Buffer>
std::string text_of(const Buffer& bytes) {
  if constexpr (std::is_pointer_v<Buffer>)
    return {reinterpret_cast<const char*>(bytes->pData_), static_cast<std::size_t>(bytes->size_)};
  else
    return {reinterpret_cast<const char*>(bytes.c_data()), bytes.size()};
}

// ---- what a tag means

ColorMeaning meaning_of(const std::function<double(double)>& light,
                        const std::array<double, 9>& matrix) {
  return {{light, light, light}, matrix};
}

[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& what) {
  throw Error(file.string() + ": " + what +
              "; convert the picture to sRGB, or give \"read_as\": {\"transfer\": ..., "
              "\"primaries\": ...} beside \"pictures\" in FRAMES.json");
}

// The numbers of H.273 are libav's; those beyond its enumerations are unknown.
template <typename Tag>
Tag h273_tag(char byte, Tag count) {
  const int code = static_cast<unsigned char>(byte);
  return code < count ? static_cast<Tag>(code) : count;
}

std::string h273_name(const char* name) {
  return name ? name : "unknown";
}

double power_of(double signal, double exponent) {
  return std::pow(std::max(signal, 0.0), exponent);
}

// ---- ICC profiles

using Profile = std::shared_ptr<void>;

Profile owned(cmsHPROFILE made) {
  return {made, [](void* profile) {
            if (profile) cmsCloseProfile(profile);
          }};
}

std::string description_of(const Profile& profile) {
  std::array<char, 256> text{};
  cmsGetProfileInfoASCII(profile.get(), cmsInfoDescription, "en", "US", text.data(), text.size());
  return set::printable(text.data());
}

// XYZ of the profile's red, green and blue, in columns, as seen under D50.
std::optional<cv::Matx33d> colorants_of(const Profile& profile) {
  cv::Matx33d columns;
  int column = 0;
  for (const auto tag : {cmsSigRedColorantTag, cmsSigGreenColorantTag, cmsSigBlueColorantTag}) {
    const auto* xyz = static_cast<const cmsCIEXYZ*>(cmsReadTag(profile.get(), tag));
    if (!xyz) return std::nullopt;
    columns(0, column) = xyz->X;
    columns(1, column) = xyz->Y;
    columns(2, column++) = xyz->Z;
  }
  return columns;
}

std::optional<std::function<double(double)>> curve_of(const Profile& profile, cmsTagSignature tag) {
  const auto* curve = static_cast<const cmsToneCurve*>(cmsReadTag(profile.get(), tag));
  if (!curve) return std::nullopt;
  return [profile, curve](double signal) -> double {  // the profile owns the curve
    const float light = cmsEvalToneCurveFloat(curve, static_cast<float>(signal));
    return std::isfinite(light) ? light : 0;
  };
}

// Nothing where the profile has tables in place of curves and a matrix, or lacks one of these.
std::optional<ColorMeaning> meaning_of(const Profile& profile, bool is_of_grey) {
  if (cmsIsCLUT(profile.get(), INTENT_RELATIVE_COLORIMETRIC, LCMS_USED_AS_INPUT))
    return std::nullopt;
  if (is_of_grey) {
    const auto curve = curve_of(profile, cmsSigGrayTRCTag);
    return curve ? std::optional(meaning_of(*curve, unit_matrix)) : std::nullopt;
  }
  ColorMeaning meaning;
  std::size_t c = 0;
  for (const auto tag : {cmsSigRedTRCTag, cmsSigGreenTRCTag, cmsSigBlueTRCTag}) {
    const auto curve = curve_of(profile, tag);
    if (!curve) return std::nullopt;
    meaning.light[c++] = *curve;
  }
  const auto colorants = colorants_of(profile);
  const auto rec709 = colorants_of(owned(cmsCreate_sRGBProfile()));
  if (!colorants || !rec709) return std::nullopt;
  const cv::Matx33d matrix = rec709->inv() * *colorants;
  std::copy_n(matrix.val, meaning.rec709.size(), meaning.rec709.begin());
  return meaning;
}

std::span<std::uint16_t> samples_of(cv::Mat& picture) {
  return {picture.ptr<std::uint16_t>(),
          picture.total() * static_cast<std::size_t>(picture.channels())};
}

}  // namespace

ColorTag color_tag_of(std::string_view content, Exiv2::Image& image) {
  ColorTag png = png_tag(content);
  if (png.kind != ColorTag::Kind::none && png.kind != ColorTag::Kind::icc) return png;
  if (image.iccProfileDefined()) {
    return {ColorTag::Kind::icc, text_of(image.iccProfile())};
  }
  return png.kind == ColorTag::Kind::icc
             ? png
             : exif_tag(image.exifData(), content.starts_with("II") || content.starts_with("MM"));
}

// A transformation by the tables of a profile.
struct StillColors::Tables {
  Tables(const Profile& from) {
    const Profile srgb = owned(cmsCreate_sRGBProfile());
    transform = cmsCreateTransform(from.get(), TYPE_RGB_16, srgb.get(), TYPE_RGB_16,
                                   INTENT_RELATIVE_COLORIMETRIC,
                                   cmsFLAGS_NOCACHE | cmsFLAGS_HIGHRESPRECALC);
  }
  ~Tables() {
    if (transform) cmsDeleteTransform(transform);
  }
  cmsHTRANSFORM transform;
};

StillColors::StillColors(StillColors&&) noexcept = default;
StillColors::~StillColors() = default;

StillColors::StillColors(const ReadAs& read_as) : words_("FRAMES.json") {
  conversion_.emplace(read_as.transfer.value_or(AVCOL_TRC_UNSPECIFIED),
                      read_as.primaries.value_or(AVCOL_PRI_UNSPECIFIED),
                      read_as.range == AVCOL_RANGE_MPEG);
}

StillColors::StillColors(const ColorTag& tag, const std::filesystem::path& file) {
  // Adobe RGB (1998) Color Image Encoding, 4.3.1 and 4.3.4: gamma and primaries.
  constexpr double adobe_gamma = 563.0 / 256;
  constexpr Chromaticities adobe_primaries = {
      {{0.64, 0.33}, {0.21, 0.71}, {0.15, 0.06}, {0.3127, 0.3290}}};
  switch (tag.kind) {
    case ColorTag::Kind::cicp:
      read_cicp(tag.bytes, file);
      return;
    case ColorTag::Kind::icc:
      read_profile(tag.bytes, file);
      return;
    case ColorTag::Kind::gamma:
      read_gamma(tag.bytes, file);
      return;
    case ColorTag::Kind::white:
      read_white(tag.bytes, file);
      return;
    case ColorTag::Kind::adobe:
      words_ = "its EXIF colour space, Adobe RGB";
      conversion_.emplace(meaning_of([](double s) { return power_of(s, adobe_gamma); },
                                     *rec709_from(adobe_primaries)));
      return;
    case ColorTag::Kind::srgb:
    case ColorTag::Kind::none:
      return;
  }
}

void StillColors::read_cicp(const std::string& bytes, const std::filesystem::path& file) {
  const auto primaries = h273_tag(bytes[0], AVCOL_PRI_NB);
  const auto transfer = h273_tag(bytes[1], AVCOL_TRC_NB);
  words_ = fmt::format("its cICP chunk (primaries {}, transfer {})",
                       h273_name(av_color_primaries_name(primaries)),
                       h273_name(av_color_transfer_name(transfer)));
  if (bytes[2] != 0 || !rec709_from(primaries) ||
      (!keeps_signal(transfer) && !light_of(transfer, 0)))
    refuse(file, words_ + " cannot be converted");
  conversion_.emplace(transfer, primaries, bytes[3] == 0);
}

void StillColors::read_gamma(const std::string& bytes, const std::filesystem::path& file) {
  // Programs that do not know sRGB's chunk write this for sRGB's curve.
  constexpr double unit = 100'000, of_srgb = 0.45455, nearly = 5e-5;
  const double gamma = big_endian(bytes, 0) / unit;
  words_ = fmt::format("its gAMA chunk ({:g})", gamma);
  if (!(gamma >= 0.05 && gamma <= 20))
    refuse(file, words_ + " is out of range; allowed: 0.05 to 20");
  std::array<double, 9> matrix = unit_matrix;
  if (bytes.size() > 4) {
    words_ = fmt::format("its gAMA and cHRM chunks ({:g})", gamma);
    Chromaticities colors{};
    for (std::size_t i = 0; i < 8; ++i)  // white is the first
      colors[(i / 2 + 3) % 4][i % 2] = big_endian(bytes, 4 + 4 * i) / unit;
    const auto from = rec709_from(colors);
    if (!from) refuse(file, words_ + " have primaries that span no colours");
    matrix = *from;
  }
  const bool is_srgb = std::abs(gamma - of_srgb) < nearly;
  if (is_srgb) words_ += ", used as the curve of sRGB";
  conversion_.emplace(meaning_of(
      [=](double s) { return is_srgb ? srgb_signal(s) : power_of(s, 1 / gamma); }, matrix));
}

// The curve is sRGB's, as nothing else is said.
void StillColors::read_white(const std::string& text, const std::filesystem::path& file) {
  words_ = "its chromaticities";
  const auto from = rec709_from(chromaticities_in(text));
  if (!from) refuse(file, "its TransferFunction cannot be converted");
  conversion_.emplace(meaning_of(srgb_signal, *from));
}

void StillColors::read_profile(const std::string& bytes, const std::filesystem::path& file) {
  const Profile profile =
      owned(cmsOpenProfileFromMem(bytes.data(), static_cast<cmsUInt32Number>(bytes.size())));
  if (!profile) refuse(file, "its ICC profile is damaged");
  words_ = "its ICC profile \"" + description_of(profile) + '"';
  const cmsColorSpaceSignature space = cmsGetColorSpace(profile.get());
  is_of_grey_ = space == cmsSigGrayData;
  if (!is_of_grey_ && space != cmsSigRgbData)
    refuse(file, words_ + " is neither for RGB nor for grey");
  if (const auto meaning = meaning_of(profile, is_of_grey_)) {
    conversion_.emplace(*meaning);
    return;
  }
  if (!is_of_grey_) tables_ = std::make_unique<Tables>(profile);
  if (!tables_ || !tables_->transform) refuse(file, words_ + " cannot be converted");
}

bool StillColors::changes_anything() const {
  return tables_ || (conversion_ && conversion_->changes_anything());
}

void StillColors::convert(cv::Mat& picture, const std::filesystem::path& file) {
  if (picture.depth() == CV_8U) picture.convertTo(picture, CV_16U, 257);
  const bool is_grey = picture.channels() == 1;
  if (is_grey ? tables_ != nullptr : is_of_grey_)
    refuse(file, words_ + (is_grey ? " is for colours, and the picture is grey"
                                   : " is for grey, and the picture has colours"));
  const auto samples = samples_of(picture);
  if (tables_)
    cmsDoTransform(tables_->transform, samples.data(), samples.data(),
                   static_cast<cmsUInt32Number>(picture.total()));
  else if (!is_grey)
    conversion_->convert(samples);
  else
    for (std::uint16_t& sample : samples) sample = conversion_->gray(sample);
}

double StillColors::clipped_share() const {
  return conversion_ ? conversion_->clipped_share() : 0;
}

}  // namespace previz::exchange
