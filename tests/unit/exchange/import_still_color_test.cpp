// Stills that say what their colours mean, or are not what they seem.
#include <lcms2.h>
#include <libdeflate.h>
#include <tiffio.h>

#include <exiv2/exiv2.hpp>
#include <opencv2/imgcodecs.hpp>

#include "daemon/core/session/files.hpp"
#include "daemon/tools/exchange/footage.hpp"
#include "daemon/tools/exchange/video_color.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/import_fixture.hpp"

namespace previz::exchange::import_still_color_test {

using Codes = std::array<std::array<int, 3>, 8>;
constexpr Codes codes = {{{170, 70, 60},
                          {70, 140, 80},
                          {60, 90, 180},
                          {128, 128, 128},
                          {200, 170, 70},
                          {235, 235, 235},
                          {40, 40, 40},
                          {100, 45, 120}}};
constexpr int patch = 16;  // pixels: blocks of a JPEG with chroma at half the size

// 4 x 2 patches of the codes, in OpenCV's order.
cv::Mat patches(int type = CV_8UC3) {
  cv::Mat picture(2 * patch, 4 * patch, CV_8UC3);
  for (int i = 0; i < 8; ++i)
    picture(cv::Rect(i % 4 * patch, i / 4 * patch, patch, patch))
        .setTo(cv::Scalar(codes[i][2], codes[i][1], codes[i][0]));
  if (type == CV_16UC3) picture.convertTo(picture, type, 257);
  return picture;
}

double encoded(double light) {
  const double in = std::clamp(light, 0.0, 1.0);
  return 255 * (in <= 0.0031308 ? 12.92 * in : 1.055 * std::pow(in, 1 / 2.4) - 0.055);
}

using Curve = std::function<double(double)>;
using Matrix = std::array<double, 9>;
constexpr Matrix unit = {1, 0, 0, 0, 1, 0, 0, 0, 1};
// To linear sRGB, by Lindbloom's "RGB/XYZ Matrices" (Adobe RGB) and CSS Color 4, 17 (Display P3).
constexpr Matrix from_adobe = {1.3982833, -0.3982833, 0, 0, 1, 0, 0, -0.0429382, 1.0429382};
constexpr Matrix from_p3 = {1.2249402, -0.2249402, 0,          -0.0420570, 1.0420570,
                            0,         -0.0196376, -0.0786361, 1.0982736};
// ROMM RGB to XYZ of D50 (ANSI/I3A IT10.7666), and from there to sRGB (Lindbloom, Bradford).
constexpr Matrix from_prophoto = {2.0343671,  -0.7275845, -0.3067826, -0.2288258, 1.2317301,
                                  -0.0029042, -0.0085649, -0.1532726, 1.1618374};

std::array<double, 3> meant(const std::array<int, 3>& code, const Curve& curve, const Matrix& m) {
  std::array<double, 3> light{}, result{};
  for (int c = 0; c < 3; ++c) light[c] = curve(code[c] / 255.0);
  for (int c = 0; c < 3; ++c)
    result[c] = encoded(m[3 * c] * light[0] + m[3 * c + 1] * light[1] + m[3 * c + 2] * light[2]);
  return result;
}

// Within half a code, and a quarter for the profiles' own rounding: their numbers have 16 bits
// behind the point, and these matrices seven digits.
void expect_meaning(Shoot& shoot, const std::string& name, const Curve& curve, const Matrix& matrix,
                    const std::string& note, double within = 0.75) {
  shoot.json["observer"]["pictures"] = {name};
  const ImportReport report = shoot.import();
  EXPECT_THAT(report.notes, Contains(HasSubstr(note))) << name;
  const FramePtr frame = shoot.open()->read(0);
  ASSERT_EQ(frame->format, PixelFormat::rgb16) << name;
  const auto* samples = reinterpret_cast<const std::uint16_t*>(frame->bytes.data());
  for (int i = 0; i < 8; ++i) {
    const int x = i % 4 * patch + patch / 2, y = i / 4 * patch + patch / 2;
    const auto right = meant(codes[i], curve, matrix);
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(samples[3 * (y * frame->width + x) + c] / 257.0, right[c], within)
          << name << " patch " << i << " channel " << c;
  }
}

// ---- writing tags

struct Close {
  void operator()(void* profile) const { cmsCloseProfile(profile); }
};

std::string profile_bytes(cmsHPROFILE made) {
  const std::unique_ptr<void, Close> profile(made);
  cmsUInt32Number size = 0;
  cmsSaveProfileToMem(profile.get(), nullptr, &size);
  std::string bytes(size, '\0');
  cmsSaveProfileToMem(profile.get(), bytes.data(), &size);
  return bytes;
}

std::string rgb_profile(const cmsCIExyY& white, const cmsCIExyYTRIPLE& primaries, double gamma) {
  cmsToneCurve* curve = cmsBuildGamma(nullptr, gamma);
  std::array<cmsToneCurve*, 3> curves = {curve, curve, curve};
  std::string bytes = profile_bytes(cmsCreateRGBProfile(&white, &primaries, curves.data()));
  cmsFreeToneCurve(curve);
  return bytes;
}

constexpr cmsCIExyY d65 = {0.3127, 0.3290, 1}, d50 = {0.3457, 0.3585, 1};
std::string adobe_profile() {
  return rgb_profile(d65, {{0.64, 0.33, 1}, {0.21, 0.71, 1}, {0.15, 0.06, 1}}, 563.0 / 256);
}

std::string big_endian(std::uint32_t value) {
  return {static_cast<char>(value >> 24), static_cast<char>(value >> 16),
          static_cast<char>(value >> 8), static_cast<char>(value)};
}

std::string chunk(const std::string& name, const std::string& data) {
  const std::string body = name + data;
  return big_endian(static_cast<std::uint32_t>(data.size())) + body +
         big_endian(libdeflate_crc32(0, body.data(), body.size()));
}

std::string iccp(const std::string& profile) {
  const std::unique_ptr<libdeflate_compressor, decltype(&libdeflate_free_compressor)> compressor(
      libdeflate_alloc_compressor(6), libdeflate_free_compressor);
  std::string packed(libdeflate_zlib_compress_bound(compressor.get(), profile.size()), '\0');
  packed.resize(libdeflate_zlib_compress(compressor.get(), profile.data(), profile.size(),
                                         packed.data(), packed.size()));
  return chunk("iCCP", std::string("a\0\0", 3) + packed);
}

std::string gama(double gamma) {
  return chunk("gAMA", big_endian(static_cast<std::uint32_t>(std::lround(gamma * 100'000))));
}

// White, red, green and blue.
std::string chrm(const std::array<double, 8>& xy) {
  std::string data;
  for (const double value : xy)
    data += big_endian(static_cast<std::uint32_t>(std::lround(value * 100'000)));
  return chunk("cHRM", data);
}

// Puts bytes behind the header of a PNG or the first marker of a JPEG.
void insert(const std::filesystem::path& file, const std::string& bytes) {
  std::string content = test::content_of(file);
  content.insert(content.starts_with("\xff\xd8") ? 2 : 33, bytes);
  session::write_content(file, content);
}

std::string app2(const std::string& profile) {
  const std::string body = std::string("ICC_PROFILE\0\1\1", 14) + profile;
  const auto length = static_cast<std::uint32_t>(body.size() + 2);
  return "\xff\xe2" + big_endian(length).substr(2) + body;
}

struct TiffForm {
  bool planes = false, tiles = false;
  std::uint16_t packing = COMPRESSION_NONE, colors = PHOTOMETRIC_RGB;
  std::uint32_t subfile = 0;
  std::string profile{};
  const char* mode = "wl";  // or "wb": the order of the bytes
  std::uint16_t format = SAMPLEFORMAT_UINT, turned = ORIENTATION_TOPLEFT;
  std::vector<float> primaries{};  // and white
};

// A TIFF of 16 bits, of red, green and blue, or with more channels.
void write_tiff(const std::filesystem::path& file, const cv::Mat& rgb, const TiffForm& form) {
  const std::unique_ptr<TIFF, decltype(&TIFFClose)> tiff(TIFFOpen(file.c_str(), form.mode),
                                                         TIFFClose);
  const int channels = rgb.channels();
  TIFFSetField(tiff.get(), TIFFTAG_IMAGEWIDTH, rgb.cols);
  TIFFSetField(tiff.get(), TIFFTAG_IMAGELENGTH, rgb.rows);
  TIFFSetField(tiff.get(), TIFFTAG_BITSPERSAMPLE, 16);
  TIFFSetField(tiff.get(), TIFFTAG_SAMPLESPERPIXEL, channels);
  TIFFSetField(tiff.get(), TIFFTAG_PHOTOMETRIC, form.colors);
  TIFFSetField(tiff.get(), TIFFTAG_COMPRESSION, form.packing);
  TIFFSetField(tiff.get(), TIFFTAG_PLANARCONFIG,
               form.planes ? PLANARCONFIG_SEPARATE : PLANARCONFIG_CONTIG);
  if (form.packing == COMPRESSION_LZW) TIFFSetField(tiff.get(), TIFFTAG_PREDICTOR, 2);
  if (form.format != SAMPLEFORMAT_UINT) TIFFSetField(tiff.get(), TIFFTAG_SAMPLEFORMAT, form.format);
  TIFFSetField(tiff.get(), TIFFTAG_ORIENTATION, form.turned);
  if (!form.primaries.empty()) {
    TIFFSetField(tiff.get(), TIFFTAG_PRIMARYCHROMATICITIES, form.primaries.data());
    TIFFSetField(tiff.get(), TIFFTAG_WHITEPOINT, form.primaries.data() + 6);
  }
  if (form.subfile != 0) TIFFSetField(tiff.get(), TIFFTAG_SUBFILETYPE, form.subfile);
  if (channels == 4) {
    const std::array<std::uint16_t, 1> alpha = {EXTRASAMPLE_UNASSALPHA};
    TIFFSetField(tiff.get(), TIFFTAG_EXTRASAMPLES, 1, alpha.data());
  }
  if (!form.profile.empty())
    TIFFSetField(tiff.get(), TIFFTAG_ICCPROFILE, form.profile.size(), form.profile.data());
  constexpr int side = 32;
  if (form.tiles) {
    TIFFSetField(tiff.get(), TIFFTAG_TILEWIDTH, side);
    TIFFSetField(tiff.get(), TIFFTAG_TILELENGTH, side);
  } else {
    TIFFSetField(tiff.get(), TIFFTAG_ROWSPERSTRIP, 7);
  }
  std::vector<cv::Mat> planes;
  if (form.planes)
    cv::split(rgb, planes);
  else
    planes = {rgb};
  for (std::size_t p = 0; p < planes.size(); ++p)
    if (form.tiles) {
      for (int y = 0; y < rgb.rows; y += side)
        for (int x = 0; x < rgb.cols; x += side) {
          cv::Mat tile = cv::Mat::zeros(side, side, planes[p].type());
          const cv::Rect place(x, y, std::min(side, rgb.cols - x), std::min(side, rgb.rows - y));
          planes[p](place).copyTo(tile({{}, place.size()}));
          TIFFWriteTile(tiff.get(), tile.data, x, y, 0, static_cast<std::uint16_t>(p));
        }
    } else {
      for (int y = 0; y < rgb.rows; ++y)
        TIFFWriteScanline(tiff.get(), planes[p].row(y).clone().data, y,
                          static_cast<std::uint16_t>(p));
    }
}

cv::Mat in_rgb(const cv::Mat& bgr) {
  cv::Mat rgb(bgr.size(), bgr.type());
  const std::array from_to = {0, 2, 1, 1, 2, 0};
  cv::mixChannels({bgr}, {rgb}, from_to.data(), 3);
  return rgb;
}

// ---- colours

TEST(ImportStills, OfIccProfilesAreConverted) {
  Shoot shoot;
  const auto gamma = [](double exponent) {
    return [exponent](double s) { return std::pow(s, exponent); };
  };
  const std::string adobe = adobe_profile();
  const std::string prophoto =
      rgb_profile(d50, {{0.7347, 0.2653, 1}, {0.1596, 0.8404, 1}, {0.0366, 0.0001, 1}}, 1.8);
  const std::string linear =
      rgb_profile(d65, {{0.64, 0.33, 1}, {0.30, 0.60, 1}, {0.15, 0.06, 1}}, 1);

  write_picture(shoot.folder() / "adobe.png", patches());
  insert(shoot.folder() / "adobe.png", iccp(adobe));
  expect_meaning(shoot, "adobe.png", gamma(563.0 / 256), from_adobe,
                 "ICC profile \"RGB built-in\"");

  write_tiff(shoot.folder() / "adobe.tif", in_rgb(patches(CV_16UC3)), {.profile = adobe});
  expect_meaning(shoot, "adobe.tif", gamma(563.0 / 256), from_adobe, "ICC profile");

  cv::imwrite(shoot.folder() / "adobe.jpg", patches(), {cv::IMWRITE_JPEG_QUALITY, 100});
  insert(shoot.folder() / "adobe.jpg", app2(adobe));
  // A code is off by 1 and its chroma by 1.8; the matrix more than doubles that in blue.
  expect_meaning(shoot, "adobe.jpg", gamma(563.0 / 256), from_adobe, "ICC profile", 6);

  write_picture(shoot.folder() / "prophoto.png", patches(CV_16UC3));
  insert(shoot.folder() / "prophoto.png", iccp(prophoto));
  expect_meaning(shoot, "prophoto.png", gamma(1.8), from_prophoto, "ICC profile");

  write_picture(shoot.folder() / "linear.png", patches());
  insert(shoot.folder() / "linear.png", iccp(linear));
  expect_meaning(shoot, "linear.png", gamma(1), unit, "ICC profile");
}

// A profile may have tables in place of curves and a matrix. This one exchanges nothing but goes
// through L*a*b*: half a code of rounding, and a code of its grid of 49 points a side.
TEST(ImportStills, OfIccProfilesWithTablesAreConverted) {
  Shoot shoot;
  const std::unique_ptr<void, Close> adobe(cmsOpenProfileFromMem(
      adobe_profile().data(), static_cast<cmsUInt32Number>(adobe_profile().size())));
  const std::unique_ptr<void, Close> lab(cmsCreateLab4Profile(nullptr));
  const cmsHTRANSFORM transform =
      cmsCreateTransform(adobe.get(), TYPE_RGB_DBL, lab.get(), TYPE_Lab_DBL,
                         INTENT_RELATIVE_COLORIMETRIC, cmsFLAGS_NOCACHE);
  const std::string bytes = profile_bytes(cmsTransform2DeviceLink(
      transform, 4.3, cmsFLAGS_FORCE_CLUT | cmsFLAGS_HIGHRESPRECALC | cmsFLAGS_GUESSDEVICECLASS));
  cmsDeleteTransform(transform);
  write_picture(shoot.folder() / "tables.png", patches(CV_16UC3));
  insert(shoot.folder() / "tables.png", iccp(bytes));
  expect_meaning(
      shoot, "tables.png", [](double s) { return std::pow(s, 563.0 / 256); }, from_adobe,
      "ICC profile", 1.5);
}

TEST(ImportStills, OfPngsOwnChunksAreConverted) {
  Shoot shoot;
  struct Case {
    std::string name, chunks;
    Curve curve;
    Matrix matrix;
    std::string note;
  };
  const auto hlg = [](double s) {
    return s <= 0.5 ? s * s / 3 : (std::exp((s - 0.55991073) / 0.17883277) + 0.28466892) / 12;
  };
  // BT.2087, 4: the inverse of BT.2020's primaries in BT.709's.
  const Matrix from_2020 = {1.6604910,  -0.5876411, -0.0728499, -0.1245505, 1.1328999,
                            -0.0083494, -0.0181508, -0.1005789, 1.1187297};
  const auto srgb = [](double s) { return srgb_signal(s); };
  const std::array<double, 8> p3 = {0.3127, 0.3290, 0.680, 0.320, 0.265, 0.690, 0.150, 0.060};
  const std::array<double, 8> rec709 = {0.3127, 0.3290, 0.64, 0.33, 0.30, 0.60, 0.15, 0.06};
  const std::vector<Case> cases = {
      {"linear.png", gama(1), [](double s) { return s; }, unit, "gAMA"},
      {"mac.png", gama(0.55556), [](double s) { return std::pow(s, 1 / 0.55556); }, unit, "gAMA"},
      {"p3.png", gama(0.45455) + chrm(p3), srgb, from_p3, "gAMA and cHRM"},
      {"p3_alone.png", chrm(p3), srgb, from_p3, "cHRM"},
      {"linear709.png", chrm(rec709) + gama(1), [](double s) { return s; }, unit, "gAMA and cHRM"},
      {"hlg.png", chunk("cICP", std::string("\x09\x12\x00\x01", 4)), hlg, from_2020, "cICP"},
      {"cicp_p3.png", chunk("cICP", std::string("\x0c\x0d\x00\x01", 4)) + gama(1), srgb, from_p3,
       "cICP"},
  };
  for (const Case& one : cases) {
    write_picture(shoot.folder() / one.name, patches());
    insert(shoot.folder() / one.name, one.chunks);
    expect_meaning(shoot, one.name, one.curve, one.matrix, one.note);
  }
}

// DCF's option file, and how some cameras write it without a profile.
TEST(ImportStills, OfExifsAdobeRgbAreConverted) {
  Shoot shoot;
  for (const auto& [space, index] :
       {std::pair<std::uint16_t, const char*>{0xffff, "R03"}, {2, "R98"}}) {
    const std::string name = shoot.folder() / "exif.jpg";
    cv::imwrite(name, patches(), {cv::IMWRITE_JPEG_QUALITY, 100});
    const auto image = Exiv2::ImageFactory::open(name);
    Exiv2::ExifData data;
    data["Exif.Photo.ColorSpace"] = space;
    data["Exif.Iop.InteroperabilityIndex"] = std::string(index);
    image->setExifData(data);
    image->writeMetadata();
    expect_meaning(
        shoot, "exif.jpg", [](double s) { return std::pow(s, 563.0 / 256); }, from_adobe,
        "EXIF colour space, Adobe RGB", 6);
  }
}

// TIFF 6.0, section 20. Those that nothing can be seen by are not believed.
TEST(ImportStills, OfTiffsChromaticitiesAreConverted) {
  Shoot shoot;
  write_tiff(shoot.folder() / "p3.tif", in_rgb(patches(CV_16UC3)),
             {.primaries = {0.680f, 0.320f, 0.265f, 0.690f, 0.150f, 0.060f, 0.3127f, 0.3290f}});
  expect_meaning(
      shoot, "p3.tif", [](double s) { return srgb_signal(s); }, from_p3, "its chromaticities");
  const cv::Mat picture = noise_picture(5, CV_16UC3, 20, 10);
  for (const std::vector<float>& primaries :
       {std::vector<float>{0, 0, 1e-40f, 0, 0, 1e-40f, 0.3127f, 0.3290f},
        std::vector<float>(8, 0)}) {
    write_tiff(shoot.folder() / "a.tif", in_rgb(picture), {.primaries = primaries});
    shoot.json["observer"]["pictures"] = {"a.tif"};
    EXPECT_EQ(shoot.first_frame()->bytes, frame_bytes_of(picture));
  }
}

TEST(ImportStills, OfSrgbKeepTheirBits) {
  Shoot shoot("a.png");
  const std::array<double, 8> rec709 = {0.3127, 0.3290, 0.64, 0.33, 0.30, 0.60, 0.15, 0.06};
  for (const std::string& chunks :
       {std::string(), chunk("sRGB", std::string(1, '\0')) + gama(0.45455) + chrm(rec709),
        iccp(profile_bytes(cmsCreate_sRGBProfile())), gama(0.45455) + chrm(rec709),
        chunk("cICP", std::string("\x01\x0d\x00\x01", 4))}) {
    write_picture(shoot.folder() / "a.png", noise_picture(3, CV_8UC3, 20, 10));
    insert(shoot.folder() / "a.png", chunks);
    EXPECT_EQ(shoot.first_frame()->bytes, frame_bytes_of(noise_picture(3, CV_8UC3, 20, 10)));
  }
}

TEST(ImportStills, OfGreyHaveTheirCurve) {
  Shoot shoot("a.png");
  cmsToneCurve* curve = cmsBuildGamma(nullptr, 1);
  const std::string bytes = profile_bytes(cmsCreateGrayProfile(cmsD50_xyY(), curve));
  cmsFreeToneCurve(curve);
  write_picture(shoot.folder() / "a.png", cv::Mat(8, 8, CV_8UC1, cv::Scalar(60)));
  insert(shoot.folder() / "a.png", iccp(bytes));
  const FramePtr frame = shoot.first_frame();
  ASSERT_EQ(frame->format, PixelFormat::gray16);
  EXPECT_NEAR(reinterpret_cast<const std::uint16_t*>(frame->bytes.data())[0] / 257.0,
              encoded(60 / 255.0), 0.51);
}

TEST(ImportStills, WithColoursThatCannotBeConvertedAreRefusedByName) {
  Shoot shoot("a.png");
  const auto refusal = [&](const std::string& chunks) {
    write_picture(shoot.folder() / "a.png", patches());
    insert(shoot.folder() / "a.png", chunks);
    return shoot.error();
  };
  EXPECT_THAT(refusal(iccp(profile_bytes(cmsCreateLab4Profile(nullptr)))),
              HasSubstr("is neither for RGB nor for grey; convert the picture to sRGB"));
  EXPECT_THAT(refusal(iccp("nonsense")), HasSubstr("its ICC profile is damaged"));
  EXPECT_THAT(refusal(chunk("iCCP", std::string("a\0\0not packed", 13))),
              HasSubstr("its ICC profile is damaged"));
  EXPECT_THAT(refusal(chunk("cICP", std::string("\x09\x12\x09\x01", 4))),
              HasSubstr("its cICP chunk"));
  EXPECT_THAT(refusal(chunk("cICP", std::string("\xf0\x0d\x00\x01", 4))),
              HasSubstr("primaries unknown"));
  EXPECT_THAT(refusal(gama(1) + chrm({0.3, 0, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1})),
              HasSubstr("primaries that span no colours"));
}

// What FRAMES.json says takes the place of the tags.
TEST(ImportStills, AreReadAsFramesJsonSays) {
  Shoot shoot;
  write_picture(shoot.folder() / "a.png", patches());
  insert(shoot.folder() / "a.png", gama(0.55556));
  shoot.json["observer"]["read_as"] = {{"transfer", "linear"}};
  expect_meaning(
      shoot, "a.png", [](double s) { return s; }, unit, "FRAMES.json");
  shoot.json["observer"]["read_as"] = {{"transfer", "as recorded"}};
  EXPECT_EQ(shoot.first_frame()->bytes, frame_bytes_of(patches()));
  shoot.json["observer"]["read_as"] = {{"transfer", "linear"}};
  insert(shoot.folder() / "a.png", chunk("cICP", std::string("\x0c\x0d\x00\x01", 4)));
  EXPECT_THAT(shoot.error(), AllOf(HasSubstr("a.png: names its colours by its cICP chunk"),
                                   HasSubstr("give both \"transfer\" and \"primaries\"")));
  shoot.json["observer"]["read_as"] = {{"transfer", "linear"}, {"primaries", "bt709"}};
  expect_meaning(
      shoot, "a.png", [](double s) { return s; }, unit, "FRAMES.json");
  shoot.json["observer"]["read_as"] = {{"matrix", "bt709"}};
  EXPECT_THAT(shoot.error(), HasSubstr("observer.read_as has a matrix"));
}

// 16 of 255 is black and 235 is white, of greys too.
TEST(ImportStills, OfLimitedRangeAreReadAsFramesJsonSays) {
  Shoot shoot("a.png");
  shoot.json["observer"]["read_as"] = {{"range", "limited"}};
  for (const int type : {CV_8UC1, CV_8UC3})
    for (const auto& [code, sample] : {std::pair{16, 0}, {235, 65535}}) {
      write_picture(shoot.folder() / "a.png", cv::Mat(8, 8, type, cv::Scalar::all(code)));
      const FramePtr frame = shoot.first_frame();
      EXPECT_EQ(reinterpret_cast<const std::uint16_t*>(frame->bytes.data())[0], sample) << type;
    }
}

// OpenCV turns a TIFF itself, which what is said must replace.
TEST(ImportStills, AreTurnedAsFramesJsonSays) {
  Shoot shoot("a.tif");
  const cv::Mat picture = noise_picture(5, CV_16UC3, 20, 10);
  write_tiff(shoot.folder() / "a.tif", in_rgb(picture), {.turned = ORIENTATION_RIGHTTOP});
  EXPECT_EQ(shoot.first_frame()->width, 10);
  shoot.json["observer"]["read_as"] = {{"rotation_deg", 0}};
  EXPECT_EQ(shoot.first_frame()->bytes, frame_bytes_of(picture));
}

// ---- other kinds

TEST(ImportStills, TiffOf16BitsWithPlanesIsRight) {
  Shoot shoot("a.tif");
  const cv::Mat picture = noise_picture(5, CV_16UC3, 45, 37);
  for (const TiffForm& form :
       {TiffForm{.planes = true}, TiffForm{.planes = true, .packing = COMPRESSION_LZW},
        TiffForm{.planes = true, .packing = COMPRESSION_ADOBE_DEFLATE, .mode = "wb"},
        TiffForm{.planes = true, .tiles = true}, TiffForm{.tiles = true}, TiffForm{}}) {
    write_tiff(shoot.folder() / "a.tif", in_rgb(picture), form);
    EXPECT_EQ(shoot.first_frame()->bytes, frame_bytes_of(picture));
  }
  cv::Mat opaque(picture.size(), CV_16UC4, cv::Scalar::all(65535));
  const std::array from_to = {0, 0, 1, 1, 2, 2};
  cv::mixChannels({in_rgb(picture)}, {opaque}, from_to.data(), 3);
  write_tiff(shoot.folder() / "a.tif", opaque, {.planes = true});
  EXPECT_EQ(shoot.first_frame()->bytes, frame_bytes_of(picture));
}

TEST(ImportStills, TiffOfOtherSamplesIsRefused) {
  Shoot shoot("a.tif");
  const cv::Mat picture = noise_picture(5, CV_16UC3, 20, 10);
  for (const bool planes : {false, true}) {
    write_tiff(shoot.folder() / "a.tif", picture,
               {.planes = planes, .format = SAMPLEFORMAT_IEEEFP});
    EXPECT_THAT(shoot.error(), HasSubstr("has samples that are no whole numbers"));
    write_tiff(shoot.folder() / "a.tif", picture, {.planes = planes, .colors = PHOTOMETRIC_YCBCR});
    EXPECT_THAT(shoot.error(), HasSubstr("is neither RGB nor grey with black as 0"));
  }
}

TEST(ImportStills, ARawPhotographIsNeverItsThumbnail) {
  Shoot shoot("a.tif");
  const cv::Mat thumbnail = in_rgb(noise_picture(1, CV_16UC3, 32, 24));
  write_tiff(shoot.folder() / "a.tif", thumbnail, {.subfile = FILETYPE_REDUCEDIMAGE});
  EXPECT_THAT(shoot.error(), HasSubstr("a.tif: has a thumbnail as its first picture"));
  write_tiff(shoot.folder() / "mosaic.tif", noise_picture(1, CV_16UC1, 32, 24),
             {.colors = PHOTOMETRIC_CFA});
  shoot.json["observer"]["pictures"] = {"mosaic.tif"};
  EXPECT_THAT(shoot.error(), HasSubstr("mosaic.tif: is a raw photograph; develop it"));
  for (const char* name : {"a.NEF", "a.arw", "a.dng", "a.cr2", "a.pef"}) {
    write_tiff(shoot.folder() / name, thumbnail, {});
    shoot.json["observer"]["pictures"] = {name};
    EXPECT_THAT(shoot.error(), HasSubstr("is a raw photograph; develop it")) << name;
  }
}

TEST(ImportStills, OfOtherFormatsAreRefusedWithTheWay) {
  Shoot shoot("a");
  using namespace std::string_literals;
  for (const auto& [bytes, words] : std::vector<std::pair<std::string, std::string>>{
           {"\0\0\0\x18"s + "ftypheic", "is a HEIC picture; convert it (heif-convert"},
           {"\0\0\0\x18"s + "ftypavif", "is an AVIF picture"},
           {"\0\0\0\x18"s + "ftypcrx ", "is a raw photograph"},
           {"\0\0\0\x18"s + "ftypqt  ", "is a video; give it as \"video\""},
           {"FUJIFILMCCD-RAW 0201", "is a raw photograph"},
           {"8BPS\0\1"s, "is a Photoshop document"},
           {"MM\0+\0\x08"s, "is a BigTIFF"},
           {"GIF89a", "allowed: PNG, JPEG, TIFF"}}) {
    session::write_content(shoot.folder() / "a", bytes + std::string(64, '\0'));
    EXPECT_THAT(shoot.error(), HasSubstr(words));
  }
}

TEST(ImportStills, WebpIsReadAsPng) {
  Shoot shoot("a.webp");
  const cv::Mat picture = noise_picture(2, CV_8UC3, 33, 17);
  cv::imwrite(shoot.folder() / "a.webp", picture, {cv::IMWRITE_WEBP_QUALITY, 101});  // lossless
  EXPECT_EQ(shoot.first_frame()->bytes, frame_bytes_of(picture));
}

// OpenEXR holds light; 1 is white, and what is above it is counted.
TEST(ImportStills, OpenExrIsLight) {
  Shoot shoot("a.exr");
  setenv("OPENCV_IO_ENABLE_OPENEXR", "1", 1);
  cv::Mat light(8, 8, CV_32FC3, cv::Scalar(0.02, 0.18, 0.5));
  light.at<cv::Vec3f>(0, 0) = {0, 1, 4};
  ASSERT_TRUE(cv::imwrite(shoot.folder() / "a.exr", light));
  const ImportReport report = shoot.import();
  EXPECT_THAT(report.notes, Contains(HasSubstr("holds linear light")));
  // 1 of 192 samples.
  EXPECT_THAT(report.notes, Contains(HasSubstr("0.52 % of its samples are outside")));
  const FramePtr frame = shoot.open()->read(0);
  ASSERT_EQ(frame->format, PixelFormat::rgb16);
  const auto* samples = reinterpret_cast<const std::uint16_t*>(frame->bytes.data());
  EXPECT_EQ(samples[0], 65535);
  EXPECT_EQ(samples[2], 0);
  for (const auto& [c, value] : {std::pair{0, 0.5}, {1, 0.18}, {2, 0.02}})
    EXPECT_NEAR(samples[3 + c] / 257.0, encoded(value), 0.01);  // a step of 16 bits is 1/257

  shoot.json["observer"]["read_as"] = {{"primaries", "p3-d65"}};
  const FramePtr wide = shoot.first_frame();
  const auto* converted = reinterpret_cast<const std::uint16_t*>(wide->bytes.data());
  EXPECT_NEAR(converted[3] / 257.0, encoded(from_p3[0] * 0.5 + from_p3[1] * 0.18), 0.01);
  shoot.json["observer"]["read_as"] = {{"transfer", "srgb"}};
  EXPECT_THAT(shoot.error(), HasSubstr("read_as can name its primaries only"));
}

}  // namespace previz::exchange::import_still_color_test
