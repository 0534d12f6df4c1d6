// By libjpeg itself and not by its TurboJPEG, which keeps only the text of the first warning, so
// that padding before a marker would hide samples that are missing, and has its own bound of scans.
#include <csetjmp>
#include <cstdio>
// jpeglib.h needs what <cstdio> declares.
#include <jerror.h>
#include <jpeglib.h>

#include <array>
#include <string_view>

#include "drivers/convert/convert.hpp"

namespace previz::convert {
namespace {

// libjpeg reports by calling back; a fatal error must not return, and jumps. Nothing with a
// destructor may live between setjmp and the jump.
struct Reports {
  jpeg_error_mgr manager;  // first: libjpeg hands back a pointer to it
  std::jmp_buf escape;
  bool damaged = false;
  std::array<char, JMSG_LENGTH_MAX> text{};

  static Reports& of(j_common_ptr decoder) { return *reinterpret_cast<Reports*>(decoder->err); }

  static void fatal(j_common_ptr decoder) {
    Reports& reports = of(decoder);
    reports.note(decoder);
    std::longjmp(reports.escape, 1);
  }

  // Level -1 is a warning: the data is damaged, and libjpeg goes on with made-up samples. Padding
  // before a marker, which many cameras send, is no damage; nor is a picture whose last marker
  // (EOI) is missing, as some cameras send it: where samples are missing, too, libjpeg says that as
  // well (JWRN_HIT_MARKER).
  static void emit(j_common_ptr decoder, int level) {
    const int what = decoder->err->msg_code;
    if (level < 0 && what != JWRN_EXTRANEOUS_DATA && what != JWRN_JPEG_EOF)
      of(decoder).note(decoder);
  }

  static void too_many_scans(j_common_ptr decoder) {
    Reports& reports = of(decoder);
    constexpr std::string_view why = "it has too many scans";
    why.copy(reports.text.data(), why.size());
    reports.damaged = true;
    std::longjmp(reports.escape, 1);
  }

  void note(j_common_ptr decoder) {
    if (!damaged) decoder->err->format_message(decoder, text.data());
    damaged = true;
  }
};

// libjpeg's own progressive pictures have ten scans. Each scan costs as much time as a picture.
constexpr int most_scans = 20;

// Every block of 8x8 pixels takes a bit at least, so that a picture has no more pixels than this
// for each byte, whatever its header claims.
constexpr std::size_t most_pixels_of_a_byte = 8 * 64;

class JpegDecoder {
 public:
  explicit JpegDecoder(std::span<const std::uint8_t> jpeg) : jpeg_(jpeg) {
    decoder_.err = jpeg_std_error(&reports_.manager);
    reports_.manager.error_exit = Reports::fatal;
    reports_.manager.emit_message = Reports::emit;
    progress_.progress_monitor = [](j_common_ptr common) {
      if (reinterpret_cast<j_decompress_ptr>(common)->input_scan_number > most_scans)
        Reports::too_many_scans(common);
    };
  }
  ~JpegDecoder() { jpeg_destroy_decompress(&decoder_); }
  JpegDecoder(const JpegDecoder&) = delete;
  JpegDecoder& operator=(const JpegDecoder&) = delete;

  std::string damage() const { return reports_.text.data(); }
  std::size_t width() const { return decoder_.image_width; }
  std::size_t height() const { return decoder_.image_height; }

  // These return false where the picture is damaged.
  bool read_header() {
    if (setjmp(reports_.escape)) return false;
    jpeg_create_decompress(&decoder_);
    decoder_.progress = &progress_;
    jpeg_mem_src(&decoder_, jpeg_.data(), jpeg_.size());
    jpeg_read_header(&decoder_, TRUE);
    return true;
  }
  // Begins with the samples: RGB, or those of CMYK, which libjpeg does not convert.
  bool begin() {
    if (setjmp(reports_.escape)) return false;
    decoder_.out_color_space = is_cmyk() ? JCS_CMYK : JCS_RGB;
    decoder_.dct_method = JDCT_ISLOW;
    jpeg_start_decompress(&decoder_);
    return true;
  }
  bool read_row(std::uint8_t* samples) {
    if (setjmp(reports_.escape)) return false;
    JSAMPROW row = samples;
    jpeg_read_scanlines(&decoder_, &row, 1);
    return true;
  }
  bool end() {
    if (setjmp(reports_.escape)) return false;
    jpeg_finish_decompress(&decoder_);
    return !reports_.damaged;
  }

  bool is_cmyk() const {
    return decoder_.jpeg_color_space == JCS_CMYK || decoder_.jpeg_color_space == JCS_YCCK;
  }
  // Adobe's programs store how much of each ink is missing.
  bool has_inverted_inks() const { return decoder_.saw_Adobe_marker != 0; }

 private:
  const std::span<const std::uint8_t> jpeg_;
  jpeg_decompress_struct decoder_{};
  jpeg_progress_mgr progress_{};
  Reports reports_{};
};

std::string size_text(std::size_t width, std::size_t height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

// Returns what is wrong with the header of a picture of this size, or with the number of its bytes:
// before memory for the picture is asked for.
std::optional<std::string> wrong_header(JpegDecoder& decoder, std::span<const std::uint8_t> jpeg,
                                        std::size_t width, std::size_t height) {
  if (!decoder.read_header()) return "is a damaged JPEG: " + decoder.damage();
  if (decoder.width() != width || decoder.height() != height)
    return "is a JPEG of " + size_text(decoder.width(), decoder.height()) + " pixels; " +
           size_text(width, height) + " was agreed";
  if (width * height / most_pixels_of_a_byte > jpeg.size())
    return "is a JPEG of " + std::to_string(jpeg.size()) + " bytes, too few for " +
           size_text(width, height) + " pixels";
  return std::nullopt;
}

// Reads a picture whose row y goes to place(y); taken(row) follows when it is there.
template <typename Place, typename Taken>
std::optional<std::string> read_rows(JpegDecoder& decoder, const Place& place, const Taken& taken) {
  bool is_good = decoder.begin();
  for (std::size_t y = 0; y < decoder.height() && is_good; ++y) {
    std::uint8_t* const row = place(y);
    is_good = decoder.read_row(row);
    if (is_good) taken(row);
  }
  if (is_good && decoder.end()) return std::nullopt;
  return "is a damaged JPEG: " + decoder.damage();
}

void rgb_of_cmyk(std::vector<std::uint8_t>& row, bool is_inverted) {
  const auto light = [&](int ink) { return is_inverted ? ink : 255 - ink; };
  for (std::size_t i = 0; i < row.size() / 4; ++i)
    for (std::size_t c = 0; c < 3; ++c)
      row[3 * i + c] =
          static_cast<std::uint8_t>((light(row[4 * i + c]) * light(row[4 * i + 3]) + 127) / 255);
}

}  // namespace

std::optional<std::string> jpeg_size(std::span<const std::uint8_t> jpeg, int& width, int& height) {
  JpegDecoder decoder(jpeg);
  if (!decoder.read_header()) return "is a damaged JPEG: " + decoder.damage();
  width = static_cast<int>(decoder.width());
  height = static_cast<int>(decoder.height());
  return std::nullopt;
}

std::optional<std::string> decode_jpeg(std::span<const std::uint8_t> jpeg, int width, int height,
                                       std::vector<std::uint8_t>& rgb) {
  if (jpeg.empty()) return "is empty";
  JpegDecoder decoder(jpeg);
  const auto w = static_cast<std::size_t>(width), h = static_cast<std::size_t>(height);
  if (auto wrong = wrong_header(decoder, jpeg, w, h)) return wrong;
  if (decoder.is_cmyk()) return "is a JPEG in CMYK";
  rgb.resize(3 * w * h);
  return read_rows(
      decoder, [&](std::size_t y) { return &rgb[3 * w * y]; }, [](std::uint8_t*) {});
}

std::optional<std::string> decode_jpeg_rows(
    std::span<const std::uint8_t> jpeg, int width, int height,
    const std::function<void(std::span<const std::uint8_t>)>& take) {
  JpegDecoder decoder(jpeg);
  const auto w = static_cast<std::size_t>(width), h = static_cast<std::size_t>(height);
  if (auto wrong = wrong_header(decoder, jpeg, w, h)) return wrong;
  std::vector<std::uint8_t> row(w * (decoder.is_cmyk() ? 4 : 3));
  return read_rows(
      decoder, [&](std::size_t) { return row.data(); },
      [&](std::uint8_t* samples) {
        if (decoder.is_cmyk()) rgb_of_cmyk(row, decoder.has_inverted_inks());
        take({samples, 3 * w});
      });
}

}  // namespace previz::convert
