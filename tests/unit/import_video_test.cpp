// Videos of others: what their tags say of colour and shape, and what is left of damaged ones.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <opencv2/imgproc.hpp>

#include "drivers/error.hpp"
#include "drivers/session/files.hpp"
#include "drivers/session/session.hpp"
#include "tests/support/import_fixture.hpp"

namespace previz::exchange {
namespace import_video_test {

using Rgb = std::array<double, 3>;
using Matrix = std::array<Rgb, 3>;
using Bytes = std::vector<std::uint8_t>;

Rgb operator*(const Matrix& m, const Rgb& v) {
  Rgb product{};
  for (std::size_t row = 0; row < 3; ++row)
    product[row] = m[row][0] * v[0] + m[row][1] * v[1] + m[row][2] * v[2];
  return product;
}

std::unique_ptr<session::StreamReader> open(const Shoot& shoot) {
  session::Session opened = session::open_session(shoot.session());
  return session::open_stream(opened, "observer");
}

// ------------------------------------------------------------------ colours

// From linear Rec. 709: BT.2087 table 2; SMPTE EG 432-1 by way of XYZ; and C. Poynton, Digital
// Video and HD, chapter "Color science for video", for the two of Rec. 601.
Matrix from_rec709(AVColorPrimaries primaries) {
  switch (primaries) {
    case AVCOL_PRI_BT2020:
      return {{{0.6274, 0.3293, 0.0433}, {0.0691, 0.9195, 0.0114}, {0.0164, 0.0880, 0.8956}}};
    case AVCOL_PRI_SMPTE432:
      return {{{0.8225, 0.1775, 0}, {0.0332, 0.9668, 0}, {0.0171, 0.0724, 0.9105}}};
    case AVCOL_PRI_SMPTE170M:
      return {{{1.065379, -0.055401, -0.009978},
               {-0.019633, 1.036363, -0.016731},
               {0.001632, 0.004412, 0.993956}}};
    case AVCOL_PRI_BT470BG:
      return {{{0.957815, 0.042185, 0}, {0, 1, 0}, {0, -0.011938, 1.011938}}};
    default:
      return {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  }
}

double srgb(double light) {
  return light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055;
}

// The signal of a light, as the equations of H.273's table 3 have it. A light of 1 is 1000 cd/m2 of
// PQ, and the most that HLG can say.
double signal_of(AVColorTransferCharacteristic transfer, double light) {
  switch (transfer) {
    case AVCOL_TRC_BT709:
    case AVCOL_TRC_SMPTE170M:
    case AVCOL_TRC_BT2020_10:
      return light < 0.018 ? 4.5 * light : 1.099 * std::pow(light, 0.45) - 0.099;
    case AVCOL_TRC_GAMMA22:
      return std::pow(light, 1 / 2.2);
    case AVCOL_TRC_GAMMA28:
      return std::pow(light, 1 / 2.8);
    case AVCOL_TRC_LINEAR:
      return light;
    case AVCOL_TRC_LOG:
      return light < 0.01 ? 0 : 1 + std::log10(light) / 2;
    case AVCOL_TRC_LOG_SQRT:
      return light < std::sqrt(10.0) / 1000 ? 0 : 1 + std::log10(light) / 2.5;
    case AVCOL_TRC_SMPTE2084: {
      const double power = std::pow(light / 10, 0.1593017578125);
      return std::pow((0.8359375 + 18.8515625 * power) / (1 + 18.6875 * power), 78.84375);
    }
    case AVCOL_TRC_ARIB_STD_B67:
      return light <= 1.0 / 12 ? std::sqrt(3 * light)
                               : 0.17883277 * std::log(12 * light - 0.28466892) + 0.55991073;
    default:
      return srgb(light);
  }
}

// Of these the set's response curve tells the light: the signal comes in as it is.
bool is_kept(AVColorTransferCharacteristic transfer) {
  return transfer == AVCOL_TRC_UNSPECIFIED || transfer == AVCOL_TRC_BT709 ||
         transfer == AVCOL_TRC_SMPTE170M || transfer == AVCOL_TRC_BT2020_10 ||
         transfer == AVCOL_TRC_IEC61966_2_1;
}

double light_of_srgb(double signal) {
  return signal <= 0.04045 ? signal / 12.92 : std::pow((signal + 0.055) / 1.055, 2.4);
}

struct ColorForm {
  const char* name;
  const char* encoder;
  const char* pixel_format;
  int depth;
  bool full;
  AVColorSpace matrix;  // for a picture without tags the one that must be assumed
  AVColorTransferCharacteristic transfer;
  AVColorPrimaries primaries;
  bool tagged = true;
  int chroma_x = 2, chroma_y = 2;
};

std::ostream& operator<<(std::ostream& out, const ColorForm& form) {
  return out << form.name;
}

// Luma's shares of red and blue, H.273 table 4.
std::pair<double, double> luma_shares(AVColorSpace matrix) {
  switch (matrix) {
    case AVCOL_SPC_BT709:
      return {0.2126, 0.0722};
    case AVCOL_SPC_BT2020_NCL:
      return {0.2627, 0.0593};
    case AVCOL_SPC_SMPTE240M:
      return {0.212, 0.087};
    default:
      return {0.299, 0.114};
  }
}

constexpr int side = 64;

void put(Bytes& bytes, double value, int depth) {
  const auto sample = static_cast<unsigned>(std::lround(value));
  bytes.push_back(static_cast<std::uint8_t>(sample & 255));
  if (depth > 8) bytes.push_back(static_cast<std::uint8_t>(sample >> 8));
}

// One plane, whose quadrants are the four values.
void put_plane(Bytes& bytes, const std::array<double, 4>& values, int width, int height,
               int depth) {
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      put(bytes, values[static_cast<std::size_t>(2 * (y >= height / 2) + (x >= width / 2))], depth);
}

// Bright, dark, reddish and bluish, inside of Rec. 709.
constexpr std::array<Rgb, 4> lights = {
    {{0.8, 0.75, 0.7}, {0.03, 0.04, 0.05}, {0.45, 0.2, 0.15}, {0.1, 0.2, 0.4}}};

std::array<Rgb, 4> signals_of(const ColorForm& form) {
  std::array<Rgb, 4> signals{};
  for (std::size_t i = 0; i < 4; ++i) {
    const Rgb light = from_rec709(form.primaries) * lights[i];
    for (std::size_t c = 0; c < 3; ++c) signals[i][c] = signal_of(form.transfer, light[c]);
  }
  return signals;
}

// H.273, 8.3: equations 21 to 27 (limited) and 28 to 32 (full).
Bytes frame_of(const ColorForm& form) {
  const std::array<Rgb, 4> signals = signals_of(form);
  const double top = std::ldexp(1.0, form.depth) - 1, unit = std::ldexp(1.0, form.depth - 8);
  const auto luma = [&](double s) { return form.full ? s * top : (219 * s + 16) * unit; };
  const auto chroma = [&](double s) {
    return form.full ? s * top + 128 * unit : (224 * s + 128) * unit;
  };
  const std::string pixel_format = form.pixel_format;
  std::array<std::array<double, 4>, 3> planes{};
  const auto [red, blue] = luma_shares(form.matrix);
  for (std::size_t i = 0; i < 4; ++i) {
    const auto [r, g, b] = signals[i];
    const double y = red * r + (1 - red - blue) * g + blue * b;
    if (pixel_format.starts_with("gbr")) {
      planes[0][i] = luma(g);
      planes[1][i] = luma(b);
      planes[2][i] = luma(r);
    } else if (pixel_format.starts_with("gray")) {
      planes[0][i] = luma(g);
    } else {
      planes[0][i] = luma(y);
      planes[1][i] = chroma((b - y) / (2 * (1 - blue)));
      planes[2][i] = chroma((r - y) / (2 * (1 - red)));
    }
  }
  Bytes bytes;
  put_plane(bytes, planes[0], side, side, form.depth);
  if (pixel_format.starts_with("gray")) return bytes;
  for (int plane = 1; plane < 3; ++plane)
    put_plane(bytes, planes[static_cast<std::size_t>(plane)], side / form.chroma_x,
              side / form.chroma_y, form.depth);
  return bytes;
}

// Of the signal that is kept, other primaries are converted in the light that sRGB's curve tells.
Rgb kept_signal(const ColorForm& form, const Rgb& signal) {
  if (form.primaries != AVCOL_PRI_BT2020) return signal;
  // BT.2407 annex 2.
  constexpr Matrix from_bt2020 = {
      {{1.6605, -0.5876, -0.0728}, {-0.1246, 1.1329, -0.0083}, {-0.0182, -0.1006, 1.1187}}};
  const Rgb light = from_bt2020 * Rgb{light_of_srgb(signal[0]), light_of_srgb(signal[1]),
                                      light_of_srgb(signal[2])};
  return {srgb(light[0]), srgb(light[1]), srgb(light[2])};
}

class ImportVideoColors : public testing::TestWithParam<ColorForm> {};

// In 255ths of the whole. A planar Y'CbCr frame that a session can hold is kept as it is.
Rgb pixel(const Frame& frame, int x, int y) {
  const std::size_t i = static_cast<std::size_t>(y) * side + static_cast<std::size_t>(x);
  const auto at = [&](std::size_t index, bool deep) {
    return deep ? (frame.bytes[2 * index] + 256 * frame.bytes[2 * index + 1]) / 257.0
                : double(frame.bytes[index]);
  };
  switch (frame.format) {
    case PixelFormat::rgb8:
    case PixelFormat::rgb16: {
      const bool deep = frame.format == PixelFormat::rgb16;
      return {at(3 * i, deep), at(3 * i + 1, deep), at(3 * i + 2, deep)};
    }
    case PixelFormat::gray8:
    case PixelFormat::gray16: {
      const double gray = at(i, frame.format == PixelFormat::gray16);
      return {gray, gray, gray};
    }
    default: {
      const std::size_t c = static_cast<std::size_t>(y) * (side / 2) + std::size_t(x) / 2;
      const double luma = (at(i, false) - 16) / 219, pb = (at(side * side + c, false) - 128) / 224,
                   pr = (at(side * side * 3 / 2 + c, false) - 128) / 224;
      return {255 * (luma + 1.5748 * pr), 255 * (luma - 0.187324 * pb - 0.468124 * pr),
              255 * (luma + 1.8556 * pb)};
    }
  }
}

// Within 2 of 255: a code of 8 bits, limited, is 255/219 of ours wide, of which half is lost, and a
// half of its chroma's up to 1.8556 times as much; what is decoded with other curves has 10 bits.
TEST_P(ImportVideoColors, ComeInAsTheTagsSay) {
  const ColorForm& form = GetParam();
  VideoForm video;
  video.encoder = form.encoder;
  video.pixel_format = form.pixel_format;
  video.width = video.height = side;
  if (video.encoder == "libx264") video.options = {{"qp", "0"}};
  if (video.encoder == "libx265")
    video.options = {{"x265-params", "lossless=1:log-level=none:pools=none"}};
  if (video.encoder == "mjpeg") video.options = {{"qmin", "1"}, {"qmax", "1"}};
  if (form.tagged) {
    video.range = form.full ? AVCOL_RANGE_JPEG : AVCOL_RANGE_MPEG;
    video.matrix = form.matrix;
    video.transfer = form.transfer;
    video.primaries = form.primaries;
  }
  Shoot shoot;
  const std::string file = video.encoder == "libx265" ? "take.mp4" : "take.mkv";
  write_video(shoot.folder() / file, video, {frame_of(form)});
  shoot.json["observer"] = {{"video", file}, {"fps", 25}, {"exposure", 1}};
  const ImportReport report = shoot.import();
  EXPECT_EQ(report.notes.at(0).find("(assumed)") == std::string::npos, form.tagged)
      << report.notes.at(0);
  const FramePtr frame = open(shoot)->read(0);
  for (std::size_t i = 0; i < 4; ++i) {
    const Rgb is = pixel(*frame, i % 2 ? 48 : 16, i / 2 ? 48 : 16);
    const Rgb signal = signals_of(form)[i];
    const bool gray = std::string(form.pixel_format).starts_with("gray");
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t from = gray ? 1 : c;
      const double expected =
          is_kept(form.transfer) ? kept_signal(form, signal)[from] : srgb(lights[i][from]);
      EXPECT_NEAR(is[c], 255 * expected, 2) << "patch " << i << " channel " << c;
    }
  }
}

constexpr auto bt601 = AVCOL_SPC_SMPTE170M, bt709 = AVCOL_SPC_BT709, bt2020 = AVCOL_SPC_BT2020_NCL,
               bt240 = AVCOL_SPC_SMPTE240M, no_matrix = AVCOL_SPC_RGB;
constexpr auto no_trc = AVCOL_TRC_UNSPECIFIED, trc709 = AVCOL_TRC_BT709,
               trc601 = AVCOL_TRC_SMPTE170M, trc_srgb = AVCOL_TRC_IEC61966_2_1,
               trc2020 = AVCOL_TRC_BT2020_10, pq = AVCOL_TRC_SMPTE2084,
               hlg = AVCOL_TRC_ARIB_STD_B67, linear = AVCOL_TRC_LINEAR, g22 = AVCOL_TRC_GAMMA22,
               g28 = AVCOL_TRC_GAMMA28, log100 = AVCOL_TRC_LOG, log316 = AVCOL_TRC_LOG_SQRT;
constexpr auto no_pri = AVCOL_PRI_UNSPECIFIED, pri709 = AVCOL_PRI_BT709, pri2020 = AVCOL_PRI_BT2020,
               p3 = AVCOL_PRI_SMPTE432, pri525 = AVCOL_PRI_SMPTE170M, pri625 = AVCOL_PRI_BT470BG;

INSTANTIATE_TEST_SUITE_P(
    Forms, ImportVideoColors,
    testing::Values(
        ColorForm{"untagged", "ffv1", "yuv420p", 8, false, bt601, no_trc, no_pri, false},
        ColorForm{"bt601", "ffv1", "yuv420p", 8, false, bt601, trc601, pri709},
        ColorForm{"bt601_full", "ffv1", "yuv420p", 8, true, bt601, trc601, pri709},
        ColorForm{"bt709", "ffv1", "yuv420p", 8, false, bt709, trc709, pri709},
        ColorForm{"bt709_full", "ffv1", "yuv420p", 8, true, bt709, trc709, pri709},
        ColorForm{"bt709_422", "ffv1", "yuv422p", 8, false, bt709, trc709, pri709, true, 2, 1},
        ColorForm{"bt709_422_full", "ffv1", "yuv422p", 8, true, bt709, trc709, pri709, true, 2, 1},
        ColorForm{"bt709_444_12", "ffv1", "yuv444p12le", 12, false, bt709, trc709, pri709, true, 1,
                  1},
        ColorForm{"bt709_10", "ffv1", "yuv420p10le", 10, false, bt709, trc709, pri709},
        ColorForm{"bt709_10_full", "ffv1", "yuv420p10le", 10, true, bt709, trc709, pri709},
        ColorForm{"srgb", "ffv1", "yuv444p", 8, true, bt601, trc_srgb, pri709, true, 1, 1},
        ColorForm{"smpte240m", "ffv1", "yuv420p", 8, false, bt240, trc709, pri709},
        ColorForm{"bt2020", "ffv1", "yuv420p10le", 10, false, bt2020, trc2020, pri2020},
        ColorForm{"pq_2020", "ffv1", "yuv420p10le", 10, false, bt2020, pq, pri2020},
        ColorForm{"pq_2020_full", "ffv1", "yuv444p12le", 12, true, bt2020, pq, pri2020, true, 1, 1},
        ColorForm{"hlg_2020", "ffv1", "yuv420p10le", 10, false, bt2020, hlg, pri2020},
        ColorForm{"hlg_709_422", "ffv1", "yuv422p10le", 10, false, bt709, hlg, pri709, true, 2, 1},
        ColorForm{"hlg_p3_full", "ffv1", "yuv420p10le", 10, true, bt709, hlg, p3},
        ColorForm{"linear_16", "ffv1", "gbrp16le", 16, true, no_matrix, linear, pri709, true, 1, 1},
        ColorForm{"linear_p3", "ffv1", "gbrp16le", 16, true, no_matrix, linear, p3, true, 1, 1},
        ColorForm{"gamma22", "ffv1", "yuv420p10le", 10, false, bt709, g22, pri709},
        ColorForm{"gamma28", "ffv1", "yuv420p10le", 10, false, bt709, g28, pri709},
        ColorForm{"log100", "ffv1", "yuv444p12le", 12, false, bt709, log100, pri709, true, 1, 1},
        ColorForm{"log316", "ffv1", "yuv444p12le", 12, false, bt709, log316, pri709, true, 1, 1},
        ColorForm{"gray_limited", "ffv1", "gray", 8, false, bt709, trc709, pri709},
        ColorForm{"gray_full", "ffv1", "gray", 8, true, bt709, trc709, pri709},
        ColorForm{"gray_10_limited", "ffv1", "gray10le", 10, false, bt709, trc709, pri709},
        ColorForm{"gray_pq", "ffv1", "gray10le", 10, false, bt709, pq, pri709},
        ColorForm{"rgb_limited", "ffv1", "gbrp10le", 10, false, no_matrix, trc_srgb, pri709, true,
                  1, 1},
        ColorForm{"h264", "libx264", "yuv420p", 8, false, bt709, trc709, pri709},
        ColorForm{"h264_full", "libx264", "yuvj420p", 8, true, bt709, trc709, pri709},
        ColorForm{"h264_10_hlg", "libx264", "yuv420p10le", 10, false, bt2020, hlg, pri2020},
        ColorForm{"hevc_10_pq", "libx265", "yuv420p10le", 10, false, bt2020, pq, pri2020},
        ColorForm{"hevc_10_hlg", "libx265", "yuv420p10le", 10, false, bt2020, hlg, pri2020}),
    [](const auto& form) { return std::string(form.param.name); });

// Rec. 601's and P3's primaries with a signal of 709: light is taken by sRGB's curve, which the
// response curve of the set then has.
TEST(ImportVideo, PrimariesOfSmallDifferenceAreConvertedToo) {
  for (const AVColorPrimaries primaries : {pri525, pri625, p3}) {
    ColorForm form{"", "ffv1", "gbrp16le", 16, true, no_matrix, trc_srgb, primaries, true, 1, 1};
    VideoForm video;
    video.pixel_format = form.pixel_format;
    video.width = video.height = side;
    video.matrix = no_matrix;
    video.range = AVCOL_RANGE_JPEG;
    video.transfer = trc_srgb;
    video.primaries = primaries;
    Shoot shoot;
    write_video(shoot.folder() / "take.mkv", video, {frame_of(form)});
    shoot.json["observer"] = {{"video", "take.mkv"}, {"fps", 25}, {"exposure", 1}};
    ASSERT_EQ(shoot.error(), "");
    const FramePtr frame = open(shoot)->read(0);
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t c = 0; c < 3; ++c)
        // The published matrices have four digits.
        EXPECT_NEAR(pixel(*frame, i % 2 ? 48 : 16, i / 2 ? 48 : 16)[c], 255 * srgb(lights[i][c]),
                    0.2)
            << primaries;
  }
}

// -------------------------------------------------------------------- shape

// Its quadrants are red, green, blue and white.
Bytes marked_picture(int width, int height) {
  constexpr std::array<std::array<std::uint8_t, 3>, 4> colors = {
      {{200, 0, 0}, {0, 200, 0}, {0, 0, 200}, {200, 200, 200}}};
  Bytes bytes;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (const std::uint8_t sample :
           colors[static_cast<std::size_t>(2 * (2 * y >= height) + (2 * x >= width))])
        bytes.push_back(sample);
  return bytes;
}

int quadrant_at(const Frame& frame, int x, int y) {
  const std::uint8_t* rgb =
      frame.bytes.data() +
      3 * (static_cast<std::size_t>(y) * std::size_t(frame.width) + std::size_t(x));
  return rgb[0] > 100 ? (rgb[1] > 100 ? 3 : 0) : rgb[1] > 100 ? 1 : 2;
}

VideoForm marked_form() {
  VideoForm form;
  form.encoder = "png";
  form.width = 48;
  return form;
}

// All eight, by the definition in libavutil/display.h: a point (p, q) of the stored picture is
// shown at (a p + c q, b p + d q), up to a shift; the rows of the matrix begin with (a, b) and (c,
// d).
TEST(ImportVideo, IsTurnedAsItIsToBeShown) {
  for (const auto& [a, b, c, d] :
       {std::array{1, 0, 0, 1}, std::array{-1, 0, 0, -1}, std::array{0, 1, -1, 0},
        std::array{0, -1, 1, 0}, std::array{-1, 0, 0, 1}, std::array{1, 0, 0, -1},
        std::array{0, 1, 1, 0}, std::array{0, -1, -1, 0}}) {
    VideoForm form = marked_form();
    const int one = 1 << 16;
    form.display_matrix = {a * one, b * one, 0, c * one, d * one, 0, 0, 0, 1 << 30};
    Shoot shoot;
    write_video(shoot.folder() / "take.mov", form, {marked_picture(48, 16)});
    shoot.json["observer"] = {{"video", "take.mov"}, {"fps", 25}, {"exposure", 1}};
    const ImportReport report = shoot.import();
    const bool upright = a == 1 && d == 1;
    EXPECT_EQ(report.notes.size(), upright ? 1u : 2u);
    const FramePtr frame = open(shoot)->read(0);
    ASSERT_EQ(frame->width, a == 0 ? 16 : 48);
    ASSERT_EQ(frame->height, a == 0 ? 48 : 16);
    for (int stored = 0; stored < 4; ++stored) {
      const int p = stored % 2 ? 12 : -12, q = stored / 2 ? 4 : -4;  // from the centre
      EXPECT_EQ(
          quadrant_at(*frame, frame->width / 2 + a * p + c * q, frame->height / 2 + b * p + d * q),
          stored)
          << a << b << c << d;
    }
  }
}

TEST(ImportVideo, AnAngleThatIsNoQuarterTurnIsRefused) {
  VideoForm form = marked_form();
  form.display_matrix = {46341, 46341, 0, -46341, 46341, 0, 0, 0, 1 << 30};
  Shoot shoot;
  write_video(shoot.folder() / "take.mov", form, {marked_picture(48, 16)});
  shoot.json["observer"] = {{"video", "take.mov"}, {"fps", 25}, {"exposure", 1}};
  EXPECT_NE(shoot.error().find("\"rotation_deg\": 0"), std::string::npos) << shoot.error();
  shoot.json["observer"]["read_as"] = {{"rotation_deg", 0}};
  shoot.json["observer"]["read_as"] = {{"rotation_deg", 45}};
  EXPECT_NE(shoot.error().find("must be 0, 90, 180 or 270"), std::string::npos);
  shoot.json["observer"]["read_as"] = {{"rotation_deg", 0}};
  EXPECT_EQ(shoot.error(), "");
  EXPECT_EQ(open(shoot)->read(0)->width, 48);
}

TEST(ImportVideo, PixelsBecomeSquare) {
  struct Case {
    AVRational aspect;
    int width, height;
  };
  for (const Case& shape : {Case{{1, 1}, 48, 16}, Case{{2, 1}, 96, 16}, Case{{4, 3}, 64, 16},
                            Case{{1, 2}, 48, 32}, Case{{0, 1}, 48, 16}}) {
    VideoForm form = marked_form();
    form.pixel_aspect = shape.aspect;
    Shoot shoot;
    write_video(shoot.folder() / "take.mov", form, {marked_picture(48, 16)});
    shoot.json["observer"] = {{"video", "take.mov"}, {"fps", 25}, {"exposure", 1}};
    ASSERT_EQ(shoot.error(), "");
    const FramePtr frame = open(shoot)->read(0);
    ASSERT_EQ(frame->width, shape.width);
    ASSERT_EQ(frame->height, shape.height);
    for (int i = 0; i < 4; ++i)
      EXPECT_EQ(quadrant_at(*frame, frame->width * (i % 2 ? 3 : 1) / 4,
                            frame->height * (i / 2 ? 3 : 1) / 4),
                i);
    // Two more quadrants' edges: nothing is shifted by making the pixels square.
    EXPECT_EQ(quadrant_at(*frame, frame->width / 2 - 2, 1), 0);
    EXPECT_EQ(quadrant_at(*frame, frame->width / 2 + 1, 1), 1);
  }
}

// A JPEG's APP1 segment of EXIF data with nothing but the orientation (Exif 2.32, 4.6.2).
std::string exif_segment(int orientation) {
  const std::string tiff("II*\0\10\0\0\0\1\0\x12\1\3\0\1\0\0\0", 18);
  return std::string("\xff\xe1\0\x22", 4) + std::string("Exif\0\0", 6) + tiff +
         static_cast<char>(orientation) + std::string(7, '\0');
}

// Exif 2.32, 4.6.4: of the stored picture's quadrants red, green, blue and white, which is seen at
// the top left and which at the top right.
TEST(ImportPictures, AreTurnedAsEXIFSays) {
  constexpr std::array<std::array<int, 2>, 8> top = {
      {{0, 1}, {1, 0}, {3, 2}, {2, 3}, {0, 2}, {2, 0}, {3, 1}, {1, 3}}};
  for (int orientation = 1; orientation <= 8; ++orientation) {
    Shoot shoot;
    const Bytes marked = marked_picture(64, 32);
    cv::Mat rgb(32, 64, CV_8UC3, const_cast<std::uint8_t*>(marked.data())), bgr;
    cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
    const std::filesystem::path file = shoot.folder() / "photo.jpg";
    write_picture(file, bgr);
    std::ifstream in(file, std::ios::binary);
    std::string bytes(std::istreambuf_iterator<char>(in), {});
    session::write_content(file, bytes.insert(2, exif_segment(orientation)));
    shoot.json["observer"] = {{"pictures", {"photo.jpg"}}, {"fps", 25}, {"exposure", 1}};
    const ImportReport report = shoot.import();
    EXPECT_EQ(report.notes.empty(), orientation == 1);
    const FramePtr frame = open(shoot)->read(0);
    EXPECT_EQ(frame->width, orientation > 4 ? 32 : 64);
    EXPECT_EQ(quadrant_at(*frame, 8, 8), top[static_cast<std::size_t>(orientation - 1)][0]);
    EXPECT_EQ(quadrant_at(*frame, frame->width - 8, 8),
              top[static_cast<std::size_t>(orientation - 1)][1])
        << orientation;
  }
}

// ------------------------------------------------------------ what is refused

TEST(ImportVideo, WhatIsNotConvertedIsRefusedWithARemedy) {
  struct Case {
    std::function<void(VideoForm&)> set;
    const char* named;
    const char* remedy;
    Json read_as;
  };
  for (const Case& unknown : {Case{[](VideoForm& f) { f.matrix = AVCOL_SPC_YCGCO; },
                                   "matrix ycgco",
                                   "zscale=matrix=709",
                                   {{"matrix", "bt709"}}},
                              Case{[](VideoForm& f) { f.matrix = AVCOL_SPC_BT2020_CL; },
                                   "matrix bt2020c",
                                   "zscale=matrix=709",
                                   {{"matrix", "bt2020"}}}}) {
    VideoForm form;
    form.pixel_format = "yuv420p";
    unknown.set(form);
    Shoot shoot;
    write_video(shoot.folder() / "take.mkv", form, {Bytes(32 * 16 * 3 / 2, 100)});
    shoot.json["observer"] = {{"video", "take.mkv"}, {"fps", 25}, {"exposure", 1}};
    EXPECT_NE(shoot.error().find(unknown.named), std::string::npos) << shoot.error();
    EXPECT_NE(shoot.error().find(unknown.remedy), std::string::npos) << shoot.error();
    EXPECT_NE(shoot.error().find("read_as"), std::string::npos) << shoot.error();
    shoot.json["observer"]["read_as"] = unknown.read_as;
    EXPECT_EQ(shoot.error(), "");
  }
}

// A frame of VideoForm's size and pixel format.
Bytes noise() {
  return frame_bytes_of(noise_picture(1, CV_8UC3, 32, 16));
}

// Cameras name their curves in words.
TEST(ImportVideo, ACamerasLogarithmicCurveIsRefused) {
  VideoForm form;
  form.encoder = "png";
  form.metadata = {{"GAMMA", "S-Log3"}};
  Shoot shoot;
  write_video(shoot.folder() / "take.mkv", form, {noise()});
  shoot.json["observer"] = {{"video", "take.mkv"}, {"fps", 25}, {"exposure", 1}};
  EXPECT_NE(shoot.error().find("logarithmic curve: its GAMMA is \"S-Log3\""), std::string::npos)
      << shoot.error();
  shoot.json["observer"]["read_as"] = {{"transfer", "as recorded"}};
  const ImportReport report = shoot.import();
  EXPECT_EQ(open(shoot)->read(0)->bytes, noise());
  EXPECT_NE(report.notes.at(0).find("as recorded"), std::string::npos);

  form.metadata = {{"comment", "graded from S-Log3"}};  // people's words
  Shoot commented;
  write_video(commented.folder() / "take.mkv", form, {noise()});
  commented.json["observer"] = {{"video", "take.mkv"}, {"fps", 25}, {"exposure", 1}};
  EXPECT_EQ(commented.error(), "");
}

TEST(ImportVideo, ReadAsIsCheckedMemberByMember) {
  Shoot shoot;
  VideoForm form;
  form.encoder = "png";
  write_video(shoot.folder() / "take.mkv", form, {noise()});
  const auto error_of = [&](const Json& read_as) {
    shoot.json["observer"] = {
        {"video", "take.mkv"}, {"fps", 25}, {"exposure", 1}, {"read_as", read_as}};
    return shoot.error();
  };
  const auto has = [](const std::string& text, const char* part) {
    return text.find(part) != std::string::npos;
  };
  EXPECT_PRED2(has, error_of({{"range", "tv"}}), "allowed: \"full\", \"limited\"");
  EXPECT_PRED2(has, error_of({{"transfer", "slog3"}}), "\"as recorded\", \"srgb\"");
  EXPECT_PRED2(has, error_of({{"pixel_aspect", {1, 0}}}), "pixel_aspect");
  EXPECT_PRED2(has, error_of({{"pixel_aspect", {1}}}), "two numbers");
  EXPECT_PRED2(has, error_of({{"gamma", 2.2}}), "gamma");
  shoot.json["observer"] = {
      {"pictures", "observer/%04d.png"}, {"fps", 25}, {"exposure", 1}, {"read_as", Json::object()}};
  EXPECT_PRED2(has, shoot.error(), "stands for the tags of a video");
  EXPECT_EQ(error_of({{"range", "full"}, {"primaries", "p3-d65"}, {"pixel_aspect", {1, 1}}}), "");
}

// ------------------------------------------------------------ lost frames

// A texture that moves, so that every frame differs from every other one and refers to others.
std::vector<Bytes> moving_texture(int count, int width, int height) {
  std::vector<Bytes> frames;
  for (int i = 0; i < count; ++i) {
    Bytes bytes;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        bytes.push_back(static_cast<std::uint8_t>(
            128 + 60 * std::sin((x + 3 * i) * 0.3) * std::cos((y + 2 * i) * 0.25) +
            30 * std::sin((x - y + 5 * i) * 0.11)));
    bytes.resize(static_cast<std::size_t>(width * height * 3 / 2), 128);
    frames.push_back(std::move(bytes));
  }
  return frames;
}

struct Timed {
  std::map<std::int64_t, Bytes> frames;  // by their times, in nanoseconds
  std::vector<std::string> notes;
};

Timed import_video(const Shoot& shoot) {
  Timed timed;
  timed.notes = shoot.import().notes;
  const auto stream = open(shoot);
  for (std::size_t i = 0; i < stream->records().size(); ++i) {
    const FramePtr frame = stream->read(i);
    timed.frames[frame->timestamp_ns] = frame->bytes;
  }
  return timed;
}

struct Damage {
  const char* name;
  const char* encoder;
  const char* file;
  std::map<std::string, std::string> options;
  std::size_t at_least;  // so many frames come in
};

std::ostream& operator<<(std::ostream& out, const Damage& damage) {
  return out << damage.name;
}

class ImportVideoWithAHole : public testing::TestWithParam<Damage> {};
class ImportTruncatedVideo : public testing::TestWithParam<Damage> {};

constexpr int texture_frames = 48;

using Spoil = std::function<bool(AVPacket&, int)>;

void film(Shoot& shoot, const Damage& damage, Spoil spoil) {
  VideoForm form;
  form.encoder = damage.encoder;
  form.options = damage.options;
  form.pixel_format = std::string(damage.encoder) == "mjpeg" ? "yuvj420p" : "yuv420p";
  form.width = 160;
  form.height = 96;
  form.spoil = std::move(spoil);
  write_video(shoot.folder() / damage.file, form, moving_texture(texture_frames, 160, 96));
  shoot.json["observer"] = {{"video", damage.file}, {"exposure", 1}};
}

Timed import_video(const Damage& damage, Spoil spoil) {
  Shoot shoot;
  film(shoot, damage, std::move(spoil));
  return import_video(shoot);
}

void expect_same_frames(const Timed& damaged, const Timed& whole) {
  for (const auto& [time, bytes] : damaged.frames) {
    const auto found = whole.frames.find(time);
    ASSERT_NE(found, whole.frames.end()) << "a frame at " << time << " is not in the whole video";
    EXPECT_TRUE(bytes == found->second) << "the frame at " << time << " is another picture";
  }
}

// As a bad sector and a full disk leave a packet: half of it nought, or its second half gone. (Of
// bytes that are merely others no decoder can tell: most of them say something.)
void zero_half(AVPacket& packet) {
  std::fill(packet.data + packet.size / 4, packet.data + packet.size * 3 / 4, std::uint8_t{0});
}
void cut_half(AVPacket& packet) {
  av_shrink_packet(&packet, packet.size / 2);
}

void expect_lost_frames_only(const Damage& damage, void (*harm)(AVPacket&)) {
  const Timed whole = import_video(damage, nullptr);
  ASSERT_EQ(whole.frames.size(), std::size_t{texture_frames});
  const Timed damaged = import_video(damage, [&](AVPacket& packet, int number) {
    if (number == 14) harm(packet);
    return true;
  });
  expect_same_frames(damaged, whole);
  EXPECT_LT(damaged.frames.size(), whole.frames.size());
  EXPECT_GE(damaged.frames.size(), damage.at_least);
  const std::string lost = std::to_string(whole.frames.size() - damaged.frames.size());
  EXPECT_TRUE(std::ranges::any_of(damaged.notes, [&](const std::string& note) {
    return note.find(": " + lost + (lost == "1" ? " frame is lost" : " frames are lost")) !=
           std::string::npos;
  }));
}

TEST_P(ImportVideoWithAHole, NoFrameThatRefersToALostOneComesIn) {
  expect_lost_frames_only(GetParam(), zero_half);
}

TEST_P(ImportTruncatedVideo, NoFrameThatRefersToALostOneComesIn) {
  expect_lost_frames_only(GetParam(), cut_half);
}

// Of each group of 12 all may be lost, and the frames before the next key frame in time.
constexpr std::size_t all_but_a_group = texture_frames - 15;
const std::map<std::string, std::string> groups = {{"g", "12"}, {"bf", "2"}};
const Damage mjpeg{"mjpeg", "mjpeg", "take.avi", {}, texture_frames - 1};
const Damage h264{"h264", "libx264", "take.mp4", groups, all_but_a_group};
const Damage hevc{"hevc",
                  "libx265",
                  "take.mkv",
                  {{"g", "12"}, {"x265-params", "log-level=none:pools=none:bframes=2"}},
                  all_but_a_group};
const Damage mpeg4{"mpeg4", "mpeg4", "take.mp4", groups, all_but_a_group};
const Damage mpeg2{"mpeg2", "mpeg2video", "take.mkv", groups, all_but_a_group};

std::string name_of(const testing::TestParamInfo<Damage>& damage) {
  return damage.param.name;
}
// Nought bytes mean something in MJPEG, and libav's decoder of HEVC takes what ends early for
// whole.
INSTANTIATE_TEST_SUITE_P(Codecs, ImportVideoWithAHole, testing::Values(h264, hevc, mpeg4, mpeg2),
                         name_of);
INSTANTIATE_TEST_SUITE_P(Codecs, ImportTruncatedVideo, testing::Values(mjpeg, h264, mpeg4, mpeg2),
                         name_of);

// Where in the second half of a transport stream a packet begins that goes on with a picture
// (ISO/IEC 13818-1, 2.4.3.2): the payload begins no unit, and it belongs to libav's first stream.
std::size_t continuing_packet(const std::string& stream) {
  for (std::size_t i = stream.size() / 188 / 2 * 188; i < stream.size(); i += 188)
    if ((stream[i + 1] & 0x5f) == 0x01 && stream[i + 2] == 0x00) return i;
  throw Error("no picture fills more than one packet");
}

// As a receiver of a stream has it: one of its packets of 188 bytes never came.
TEST(ImportVideo, ATransportStreamThatLostPacketsComesInWithoutTheirFrames) {
  for (const char* encoder : {"libx264", "libx265"}) {
    Damage stream{"ts", encoder, "take.ts", {{"g", "12"}}, 0};
    if (std::string(encoder) == "libx265")
      stream.options["x265-params"] = "log-level=none:pools=none";
    Shoot shoot;
    film(shoot, stream, nullptr);
    const Timed whole = import_video(shoot);
    ASSERT_EQ(whole.frames.size(), std::size_t{texture_frames});
    std::filesystem::remove_all(shoot.session());
    std::ifstream in(shoot.folder() / "take.ts", std::ios::binary);
    std::string bytes(std::istreambuf_iterator<char>(in), {});
    bytes.erase(continuing_packet(bytes), 188);
    session::write_content(shoot.folder() / "take.ts", bytes);
    const Timed damaged = import_video(shoot);
    EXPECT_LT(damaged.frames.size(), whole.frames.size());
    EXPECT_GE(damaged.frames.size(), std::size_t{texture_frames - 16});
    expect_same_frames(damaged, whole);
  }
}

// What was cut away before an open group's key frame is lost at the beginning; the numbers and
// times of the others count from what is in the file.
TEST(ImportVideo, ACutAtAnOpenGroupOfPicturesComesIn) {
  const Damage open_group{"",
                          "libx264",
                          "take.mkv",
                          {{"g", "12"}, {"bf", "2"}, {"x264-params", "open-gop=1:scenecut=0"}},
                          0};
  const Timed whole = import_video(open_group, nullptr);
  ASSERT_EQ(whole.frames.size(), std::size_t{texture_frames});
  int first = 0;
  const Timed cut = import_video(open_group, [&](AVPacket& packet, int number) {
    if (number > 0 && packet.flags & AV_PKT_FLAG_KEY && first == 0) first = number;
    return first > 0;
  });
  // All but those between two of the frames that the key frame is one of: at most the two B-frames.
  const auto left = static_cast<std::size_t>(texture_frames - first);
  EXPECT_GE(cut.frames.size(), left - 2);
  EXPECT_LT(cut.frames.size(), left + 1);
  // The frames are the last ones of the whole.
  auto from_end = whole.frames.rbegin();
  for (auto frame = cut.frames.rbegin(); frame != cut.frames.rend(); ++frame, ++from_end)
    EXPECT_TRUE(frame->second == from_end->second) << "the frame at " << frame->first;
}

// A phone's clip that lost one frame while it was filmed, with a track of timecode.
TEST(ImportVideo, TheRateIsTheNominalOneAndTheTimecodeTheClips) {
  VideoForm form = marked_form();
  form.fps = 30;
  form.metadata = {{"timecode", "10:59:59:20"}};
  for (std::int64_t i = 0; i < 60; ++i)
    if (i != 20) form.times.push_back(i);
  Shoot shoot;
  write_video(shoot.folder() / "take.mov", form,
              std::vector<Bytes>(59, marked_picture(form.width, form.height)));
  shoot.json["observer"] = {{"video", "take.mov"}, {"exposure", 1}};
  const ImportReport report = shoot.import();
  EXPECT_TRUE(std::ranges::any_of(report.notes, [](const std::string& note) {
    return note == "observer: 30 frames a second; 1 frame is missing, after frame 19";
  })) << report.notes.back();
  const session::Session opened = session::open_session(shoot.session());
  EXPECT_EQ(opened.info.timecode, (session::Timecode{"10:59:59:20", 30}));
}

// The timecode of the file is that of its first frame, which was lost.
TEST(ImportVideo, TheTimecodeIsThatOfTheFirstFrameThatCameIn) {
  VideoForm form = marked_form();
  form.encoder = "mjpeg";
  form.pixel_format = "yuvj420p";
  form.metadata = {{"timecode", "10:59:59:24"}};
  form.spoil = [](AVPacket& packet, int number) {
    if (number == 0) std::fill_n(packet.data, packet.size, std::uint8_t{0});
    return true;
  };
  Shoot shoot;
  write_video(shoot.folder() / "take.mov", form,
              std::vector<Bytes>(10, Bytes(48 * 16 * 3 / 2, 90)));
  shoot.json["observer"] = {{"video", "take.mov"}, {"exposure", 1}};
  ASSERT_EQ(shoot.error(), "");
  const session::Session opened = session::open_session(shoot.session());
  EXPECT_EQ(opened.info.timecode, (session::Timecode{"11:00:00:00", 25}));
}

// A pose belongs to its frame, not to the one that takes its place.
TEST(ImportVideo, PosesOfLostFramesAreLeftOut) {
  Shoot shoot;
  film(shoot, mjpeg, [](AVPacket& packet, int number) {
    if (number == 1) std::fill_n(packet.data, packet.size, std::uint8_t{0});
    return true;
  });
  for (const int frame : {0, 1, 2})
    shoot.json["track"].push_back(
        {{"frame", frame},
         {"world_from_camera", {{1, 0, 0, frame}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}}});
  const ImportReport report = shoot.import();
  EXPECT_EQ(report.observer_frames, std::uint64_t{texture_frames - 1});
  EXPECT_EQ(report.poses, 2u);
  EXPECT_NE(report.notes.back().find("1 pose belongs to a lost frame"), std::string::npos);
  const auto stream = open(shoot);
  EXPECT_EQ(stream->read(1)->sequence, 2u);
  EXPECT_EQ(stream->read(1)->timestamp_ns, 80'000'000);
}

}  // namespace import_video_test
}  // namespace previz::exchange
