// Videos of others: what their tags say of colour.
#include "tests/support/import_fixture.hpp"

namespace previz::exchange::import_video_color_test {

using Rgb = std::array<double, 3>;
using Matrix = std::array<Rgb, 3>;

Rgb operator*(const Matrix& m, const Rgb& v) {
  Rgb product{};
  for (std::size_t row = 0; row < 3; ++row)
    product[row] = m[row][0] * v[0] + m[row][1] * v[1] + m[row][2] * v[2];
  return product;
}

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

// Returns whether a signal comes in as it is, because the set's response curve tells its light.
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

// Returns a signal that is kept; other primaries are converted in the light that sRGB's curve
// tells.
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

// Returns a pixel in 255ths of the whole. A planar Y'CbCr frame that a session can hold is kept as
// it is.
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

VideoForm video_of(const ColorForm& form) {
  VideoForm video = {
      .pixel_format = form.pixel_format, .width = side, .height = side, .encoder = form.encoder};
  if (video.encoder == "libx264") video.options = {{"qp", "0"}};
  if (video.encoder == "libx265")
    video.options = {{"x265-params", "lossless=1:log-level=none:pools=none:bframes=0"}};
  if (form.tagged) {
    video.range = form.full ? AVCOL_RANGE_JPEG : AVCOL_RANGE_MPEG;
    video.matrix = form.matrix;
    video.transfer = form.transfer;
    video.primaries = form.primaries;
  }
  return video;
}

// Within 2 of 255: a code of 8 bits, limited, is 255/219 of ours wide, of which half is lost, and a
// half of its chroma's up to 1.8556 times as much; what is decoded with other curves has 10 bits.
TEST_P(ImportVideoColors, ComeInAsTheTagsSay) {
  const ColorForm& form = GetParam();
  Shoot shoot;
  const bool is_hevc = form.encoder == std::string("libx265");
  shoot.film(is_hevc ? "take.mp4" : "take.mkv", video_of(form), {frame_of(form)});
  const ImportReport report = shoot.import();
  EXPECT_EQ(report.notes.at(0).find("(assumed)") == std::string::npos, form.tagged)
      << report.notes.at(0);
  const FramePtr frame = shoot.open()->read(0);
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

const ColorForm color_forms[] = {
    {"untagged", "ffv1", "yuv420p", 8, false, bt601, no_trc, no_pri, false},
    {"bt601", "ffv1", "yuv420p", 8, false, bt601, trc601, pri709},
    {"bt601_full", "ffv1", "yuv420p", 8, true, bt601, trc601, pri709},
    {"bt709", "ffv1", "yuv420p", 8, false, bt709, trc709, pri709},
    {"bt709_full", "ffv1", "yuv420p", 8, true, bt709, trc709, pri709},
    {"bt709_422", "ffv1", "yuv422p", 8, false, bt709, trc709, pri709, true, 2, 1},
    {"bt709_422_full", "ffv1", "yuv422p", 8, true, bt709, trc709, pri709, true, 2, 1},
    {"bt709_444_12", "ffv1", "yuv444p12le", 12, false, bt709, trc709, pri709, true, 1, 1},
    {"bt709_10", "ffv1", "yuv420p10le", 10, false, bt709, trc709, pri709},
    {"bt709_10_full", "ffv1", "yuv420p10le", 10, true, bt709, trc709, pri709},
    {"srgb", "ffv1", "yuv444p", 8, true, bt601, trc_srgb, pri709, true, 1, 1},
    {"smpte240m", "ffv1", "yuv420p", 8, false, bt240, trc709, pri709},
    {"bt2020", "ffv1", "yuv420p10le", 10, false, bt2020, trc2020, pri2020},
    {"pq_2020", "ffv1", "yuv420p10le", 10, false, bt2020, pq, pri2020},
    {"pq_2020_full", "ffv1", "yuv444p12le", 12, true, bt2020, pq, pri2020, true, 1, 1},
    {"hlg_2020", "ffv1", "yuv420p10le", 10, false, bt2020, hlg, pri2020},
    {"hlg_709_422", "ffv1", "yuv422p10le", 10, false, bt709, hlg, pri709, true, 2, 1},
    {"hlg_p3_full", "ffv1", "yuv420p10le", 10, true, bt709, hlg, p3},
    {"linear_16", "ffv1", "gbrp16le", 16, true, no_matrix, linear, pri709, true, 1, 1},
    {"linear_p3", "ffv1", "gbrp16le", 16, true, no_matrix, linear, p3, true, 1, 1},
    {"gamma22", "ffv1", "yuv420p10le", 10, false, bt709, g22, pri709},
    {"gamma28", "ffv1", "yuv420p10le", 10, false, bt709, g28, pri709},
    {"log100", "ffv1", "yuv444p12le", 12, false, bt709, log100, pri709, true, 1, 1},
    {"log316", "ffv1", "yuv444p12le", 12, false, bt709, log316, pri709, true, 1, 1},
    {"gray_limited", "ffv1", "gray", 8, false, bt709, trc709, pri709},
    {"gray_full", "ffv1", "gray", 8, true, bt709, trc709, pri709},
    {"gray_10_limited", "ffv1", "gray10le", 10, false, bt709, trc709, pri709},
    {"gray_pq", "ffv1", "gray10le", 10, false, bt709, pq, pri709},
    {"rgb_limited", "ffv1", "gbrp10le", 10, false, no_matrix, trc_srgb, pri709, true, 1, 1},
    {"h264", "libx264", "yuv420p", 8, false, bt709, trc709, pri709},
    {"h264_full", "libx264", "yuvj420p", 8, true, bt709, trc709, pri709},
    {"h264_10_hlg", "libx264", "yuv420p10le", 10, false, bt2020, hlg, pri2020},
    {"hevc_10_pq", "libx265", "yuv420p10le", 10, false, bt2020, pq, pri2020},
    {"hevc_10_hlg", "libx265", "yuv420p10le", 10, false, bt2020, hlg, pri2020},
};
INSTANTIATE_TEST_SUITE_P(Forms, ImportVideoColors, testing::ValuesIn(color_forms),
                         [](const auto& form) { return std::string(form.param.name); });

// Rec. 601's and P3's primaries with a signal of 709: light is taken by sRGB's curve, which the
// response curve of the set then has.
TEST(ImportVideo, PrimariesOfSmallDifferenceAreConvertedToo) {
  for (const AVColorPrimaries primaries : {pri525, pri625, p3}) {
    const ColorForm form{"",       "ffv1",    "gbrp16le", 16, true, no_matrix,
                         trc_srgb, primaries, true,       1,  1};
    Shoot shoot;
    shoot.film("take.mkv", video_of(form), {frame_of(form)});
    const FramePtr frame = shoot.first_frame();
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t c = 0; c < 3; ++c)
        // The published matrices have four digits.
        EXPECT_NEAR(pixel(*frame, i % 2 ? 48 : 16, i / 2 ? 48 : 16)[c], 255 * srgb(lights[i][c]),
                    0.2)
            << primaries;
  }
}

// ------------------------------------------------------------ what only the container says

struct Wrapped {
  const char *name, *encoder, *pixel_format, *file;
  std::map<std::string, std::string> options{};
};

std::ostream& operator<<(std::ostream& out, const Wrapped& wrapped) {
  return out << wrapped.name;
}

// A frame of one colour, limited range of that depth.
Bytes flat_frame(const std::string& pixel_format, int width, int height,
                 const std::array<double, 3>& samples) {
  const int depth = pixel_format.ends_with("10le") ? 10 : 8;
  const int chroma_y = pixel_format.starts_with("yuv422") ? 1 : 2;
  Bytes bytes;
  for (std::size_t plane = 0; plane < 3; ++plane) {
    const double sample = samples[plane];
    const int columns = plane ? width / 2 : width, rows = plane ? height / chroma_y : height;
    put_plane(bytes, {sample, sample, sample, sample}, columns, rows, depth);
  }
  return bytes;
}

// Red by H.273's equations in the matrix that is said.
Bytes red_frame(const Wrapped& wrapped, AVColorSpace matrix, int width, int height) {
  const std::string pixel_format = wrapped.pixel_format;
  const auto [red, blue] = luma_shares(matrix);
  const double r = 0.8, g = 0.2, b = 0.1, y = red * r + (1 - red - blue) * g + blue * b;
  const double unit = pixel_format.ends_with("10le") ? 4 : 1;
  const bool full = pixel_format.starts_with("yuvj");
  const double pb = (b - y) / (2 * (1 - blue)), pr = (r - y) / (2 * (1 - red));
  return flat_frame(
      pixel_format, width, height,
      {full ? 255 * y : (219 * y + 16) * unit, full ? 255 * pb + 128 : (224 * pb + 128) * unit,
       full ? 255 * pr + 128 : (224 * pr + 128) * unit});
}

class ImportVideoContainerColors : public testing::TestWithParam<Wrapped> {};

// The encoder is told nothing; what would be assumed by the number of lines is the other matrix.
TEST_P(ImportVideoContainerColors, CountWhereTheFramesSayNothing) {
  const Wrapped& wrapped = GetParam();
  for (const auto& [matrix, height] : {std::pair{bt709, 144}, std::pair{bt601, 720}}) {
    VideoForm form = {.pixel_format = wrapped.pixel_format,
                      .width = 256,
                      .height = height,
                      .encoder = wrapped.encoder,
                      .options = wrapped.options};
    form.container = [matrix = matrix](AVCodecParameters& said) {
      said.color_space = matrix;
      said.color_trc = trc709;
      said.color_primaries = pri709;
    };
    Shoot shoot;
    shoot.film(wrapped.file, form, {red_frame(wrapped, matrix, 256, height)});
    const ImportReport report = shoot.import();
    EXPECT_THAT(report.notes.at(0),
                AllOf(HasSubstr(matrix == bt709 ? "matrix bt709" : "matrix smpte170m"),
                      Not(HasSubstr("primaries bt709 (assumed)")), Not(HasSubstr("no transfer"))));
    const FramePtr frame = shoot.open()->read(0);
    ASSERT_TRUE(frame->format == PixelFormat::rgb8 || frame->format == PixelFormat::rgb16 ||
                frame->format == PixelFormat::yuv422p8);
    if (frame->format == PixelFormat::yuv422p8) continue;  // is BT.709
    const bool deep = frame->format == PixelFormat::rgb16;
    constexpr Rgb expected = {0.8, 0.2, 0.1};
    for (std::size_t c = 0; c < 3; ++c)
      EXPECT_NEAR(deep ? (frame->bytes[2 * c] + 256 * frame->bytes[2 * c + 1]) / 257.0
                       : double(frame->bytes[c]),
                  255 * expected[c], 3)
          << "channel " << c << " of " << height << " lines";
  }
}

const Wrapped wrappings[] = {
    {"prores_mov", "prores_ks", "yuv422p10le", "take.mov"},
    {"prores_mkv", "prores_ks", "yuv422p10le", "take.mkv"},
    {"prores_old_mov", "prores", "yuv422p10le", "take.mov"},
    {"ffv1_mkv", "ffv1", "yuv420p", "take.mkv"},
    {"mjpeg_mov", "mjpeg", "yuvj420p", "take.mov", {{"qmin", "2"}, {"qmax", "2"}}},
    {"v210_mov", "v210", "yuv422p10le", "take.mov"},
    {"cfhd_mov", "cfhd", "yuv422p10le", "take.mov"},
    {"h264_mov", "libx264", "yuv420p", "take.mov", {{"qp", "0"}}},
    {"hevc_mov",
     "libx265",
     "yuv420p",
     "take.mov",
     {{"x265-params", "lossless=1:log-level=none:pools=none:bframes=0"}}},
    {"vp8_mkv", "libvpx", "yuv420p", "take.mkv", {{"crf", "4"}}},
    {"vp9_mkv", "libvpx-vp9", "yuv420p", "take.mkv", {{"lossless", "1"}}},
    {"mpeg2_mkv", "mpeg2video", "yuv420p", "take.mkv"},
    {"mpeg4_mov", "mpeg4", "yuv420p", "take.mov"},
    {"dnxhr_mov", "dnxhd", "yuv422p", "take.mov", {{"profile", "dnxhr_hq"}}}};
INSTANTIATE_TEST_SUITE_P(Codecs, ImportVideoContainerColors, testing::ValuesIn(wrappings),
                         [](const auto& wrapped) { return std::string(wrapped.param.name); });

TEST(ImportVideo, ColoursOfTheContainerAreNamedAsSuch) {
  const Wrapped prores = wrappings[0];
  VideoForm form = {.pixel_format = prores.pixel_format, .encoder = prores.encoder};
  form.container = [](AVCodecParameters& said) {
    said.color_space = bt709;
    said.color_trc = trc709;
    said.color_primaries = pri709;
  };
  Shoot shoot;
  shoot.film("take.mov", form, {red_frame(prores, bt709, 32, 16)});
  // Decoders of FFmpeg 7 put the container's colours into frames that have none of their own.
  const std::string source = LIBAVCODEC_VERSION_MAJOR < 61 ? " (from the container)" : "";
  EXPECT_THAT(
      shoot.import().notes.at(0),
      AllOf(HasSubstr("matrix bt709" + source), HasSubstr("transfer bt709" + source),
            HasSubstr("primaries bt709" + source), Not(HasSubstr("primaries bt709 (assumed)"))));
}

TEST(ImportVideo, FramesThatDisagreeWithTheContainerCountAndItIsSaid) {
  VideoForm form = {.pixel_format = "yuv420p", .encoder = "libx264"};
  form.matrix = bt709;
  form.transfer = trc709;
  form.primaries = pri709;
  form.container = [](AVCodecParameters& said) { said.color_space = bt601; };
  Shoot shoot;
  shoot.film("take.mov", form, {red_frame({"", "", "yuv420p", ""}, bt709, 32, 16)});
  EXPECT_THAT(shoot.import().notes.at(0),
              HasSubstr("matrix bt709 (from the frames; the container says smpte170m)"));
}

// ------------------------------------------------------------ RGB that goes to 16 bits

// White and black are all bits of a sample, by any way that RGB of 8 to 16 bits lies in memory.
TEST(ImportVideo, WhiteStaysWhiteWhereRGBBecomesDeeper) {
  struct Form {
    const char *pixel_format, *encoder, *file;
    std::size_t bytes_per_pixel;
    std::uint16_t most = 255;
  };
  for (const Form& rgb :
       {Form{"rgb24", "png", "take.mkv", 3}, Form{"rgba", "png", "take.mkv", 4},
        Form{"bgr0", "ffv1", "take.mkv", 4}, Form{"bgra", "ffv1", "take.mkv", 4},
        Form{"gbrp", "utvideo", "take.mkv", 3}, Form{"bgr24", "rawvideo", "take.nut", 3},
        Form{"0rgb", "rawvideo", "take.nut", 4}, Form{"argb", "qtrle", "take.mov", 4},
        Form{"gbrp10le", "ffv1", "take.mkv", 6, 1023},
        Form{"gbrp12le", "ffv1", "take.mkv", 6, 4095},
        Form{"gbrp10le", "r210", "take.mov", 6, 1023},
        Form{"gbrp14le", "ffv1", "take.mkv", 6, 16383},
        Form{"rgb48be", "png", "take.mkv", 6, 65535}}) {
    for (const AVColorPrimaries primaries : {p3, pri2020}) {
      Bytes white(32 * 16 * rgb.bytes_per_pixel, 255);
      if (rgb.most > 255)
        for (std::size_t i = 0; i < white.size(); i += 2)
          white[i + 1] = static_cast<std::uint8_t>(rgb.most >> 8);
      VideoForm form = {.pixel_format = rgb.pixel_format, .encoder = rgb.encoder};
      form.primaries = primaries;
      form.transfer = trc_srgb;
      Shoot shoot;
      const char* name = primaries == p3 ? "p3-d65" : "bt2020";
      shoot.film(rgb.file, form, {white},
                 {{"fps", 25}, {"read_as", {{"primaries", name}, {"range", "full"}}}});
      const FramePtr frame = shoot.first_frame();
      ASSERT_EQ(frame->format, PixelFormat::rgb16) << rgb.pixel_format;
      EXPECT_EQ(frame->bytes, Bytes(frame->bytes.size(), 255)) << rgb.pixel_format;
    }
  }
}

}  // namespace previz::exchange::import_video_color_test
