#include <csetjmp>
#include <cstdio>
// jpeglib.h needs what <cstdio> declares.
#include <jerror.h>
#include <jpeglib.h>

#include <array>

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
  // before a marker, which many cameras send, is no damage.
  static void emit(j_common_ptr decoder, int level) {
    if (level < 0 && decoder->err->msg_code != JWRN_EXTRANEOUS_DATA) of(decoder).note(decoder);
  }

  void note(j_common_ptr decoder) {
    if (!damaged) decoder->err->format_message(decoder, text.data());
    damaged = true;
  }
};

// Returns false with reports.damaged set, or without it if header and expectation differ.
bool decode(jpeg_decompress_struct& decoder, Reports& reports, std::span<const std::uint8_t> jpeg,
            int width, int height, std::vector<std::uint8_t>& rgb) {
  if (setjmp(reports.escape)) return false;
  jpeg_create_decompress(&decoder);
  jpeg_mem_src(&decoder, jpeg.data(), jpeg.size());
  jpeg_read_header(&decoder, TRUE);
  if (decoder.image_width != static_cast<JDIMENSION>(width) ||
      decoder.image_height != static_cast<JDIMENSION>(height))
    return false;
  decoder.out_color_space = JCS_RGB;
  decoder.dct_method = JDCT_ISLOW;
  jpeg_start_decompress(&decoder);
  while (decoder.output_scanline < decoder.output_height) {
    JSAMPROW row = &rgb[std::size_t{3} * decoder.output_scanline * decoder.output_width];
    jpeg_read_scanlines(&decoder, &row, 1);
  }
  jpeg_finish_decompress(&decoder);
  return !reports.damaged;
}

}  // namespace

std::optional<std::string> decode_jpeg(std::span<const std::uint8_t> jpeg, int width, int height,
                                       std::vector<std::uint8_t>& rgb) {
  if (jpeg.empty()) return "is empty";
  rgb.resize(std::size_t{3} * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  jpeg_decompress_struct decoder{};
  Reports reports{};
  decoder.err = jpeg_std_error(&reports.manager);
  reports.manager.error_exit = Reports::fatal;
  reports.manager.emit_message = Reports::emit;
  const bool whole = decode(decoder, reports, jpeg, width, height, rgb);
  const std::string size =
      std::to_string(decoder.image_width) + "x" + std::to_string(decoder.image_height);
  jpeg_destroy_decompress(&decoder);
  if (whole) return std::nullopt;
  if (reports.damaged) return std::string("is a damaged JPEG: ") + reports.text.data();
  return "is a JPEG of " + size + " pixels; " + std::to_string(width) + "x" +
         std::to_string(height) + " was agreed";
}

}  // namespace previz::convert
