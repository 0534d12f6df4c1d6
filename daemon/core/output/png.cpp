#include "daemon/core/output/png.hpp"

#include <png.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "daemon/core/output/picture_size.hpp"
#include "daemon/core/session/files.hpp"
#include "drivers/box/reading.hpp"
#include "drivers/error.hpp"

namespace previz::output {
namespace {

// On an error libpng calls longjmp to the last setjmp. So the functions here that call setjmp hold
// nothing with a destructor; PngError keeps the error, which is thrown afterwards.
struct PngError {
  std::string message;
};

[[noreturn]] void on_error(png_structp png, png_const_charp message) {
  static_cast<PngError*>(png_get_error_ptr(png))->message = message;
  png_longjmp(png, 1);
}

void on_warning(png_structp, png_const_charp) {}

struct FileCloser {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using FilePtr = std::unique_ptr<std::FILE, FileCloser>;

FilePtr open(const std::filesystem::path& path) {
  FilePtr file(std::fopen(path.c_str(), "rb"));
  if (!file) throw Error(path.string() + ": cannot be opened: " + std::strerror(errno));
  return file;
}

// Row-major bytes in PNG's order: 16-bit samples are big-endian.
std::vector<png_byte> to_bytes(const Plate& picture) {
  const std::size_t bytes_a_sample = picture.bits == 16 ? 2 : 1;
  std::vector<png_byte> bytes(picture.samples.size() * bytes_a_sample);
  for (std::size_t i = 0; i < picture.samples.size(); ++i) {
    if (bytes_a_sample == 2) {
      bytes[2 * i] = static_cast<png_byte>(picture.samples[i] >> 8);
      bytes[2 * i + 1] = static_cast<png_byte>(picture.samples[i] & 0xff);
    } else {
      bytes[i] = static_cast<png_byte>(picture.samples[i]);
    }
  }
  return bytes;
}

std::vector<png_bytep> row_pointers(std::vector<png_byte>& bytes, int height) {
  std::vector<png_bytep> rows(static_cast<std::size_t>(height));
  for (std::size_t y = 0; y < rows.size(); ++y)
    rows[y] = bytes.data() + y * (bytes.size() / rows.size());
  return rows;
}

// The file that libpng writes to.
struct Written {
  const session::OpenFile& file;
  std::string failure;
};

void append(png_structp png, png_bytep bytes, std::size_t count) {
  auto* written = static_cast<Written*>(png_get_io_ptr(png));
  try {
    written->file.append({reinterpret_cast<const char*>(bytes), count});
  } catch (const Error& error) {
    written->failure = error.what();
  }
  if (!written->failure.empty()) png_error(png, written->failure.c_str());
}

void flush(png_structp) {}

// This function holds nothing that needs a destructor, so that libpng may jump out of it.
bool encode(png_structp png, png_infop info, Written* file, const Plate& picture, png_bytepp rows) {
  if (setjmp(png_jmpbuf(png))) return false;
  png_set_write_fn(png, file, append, flush);
  png_set_IHDR(png, info, static_cast<png_uint_32>(picture.width),
               static_cast<png_uint_32>(picture.height), picture.bits, PNG_COLOR_TYPE_RGB,
               PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  png_write_image(png, rows);
  png_write_end(png, info);
  return true;
}

bool read_header(png_structp png, png_infop info, std::FILE* file) {
  if (setjmp(png_jmpbuf(png))) return false;
  png_init_io(png, file);
  png_read_info(png, info);
  png_set_expand(png);  // expands palettes and less than 8 bits
  png_set_strip_alpha(png);
  png_set_gray_to_rgb(png);
  png_set_interlace_handling(png);
  png_read_update_info(png, info);
  return true;
}

bool read_rows(png_structp png, png_bytepp rows) {
  if (setjmp(png_jmpbuf(png))) return false;
  png_read_image(png, rows);
  png_read_end(png, nullptr);
  return true;
}

struct Writer {
  png_structp png;
  png_infop info;
  explicit Writer(PngError& error)
      : png(png_create_write_struct(PNG_LIBPNG_VER_STRING, &error, on_error, on_warning)),
        info(png_create_info_struct(png)) {}
  ~Writer() { png_destroy_write_struct(&png, &info); }
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;
};

struct Reader {
  png_structp png;
  png_infop info;
  explicit Reader(PngError& error)
      : png(png_create_read_struct(PNG_LIBPNG_VER_STRING, &error, on_error, on_warning)),
        info(png_create_info_struct(png)) {}
  ~Reader() { png_destroy_read_struct(&png, &info, nullptr); }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;
};

}  // namespace

void write_png(const std::filesystem::path& path, const Plate& picture, session::Sync sync) {
  if (picture.width < 1 || picture.height < 1 || (picture.bits != 8 && picture.bits != 16) ||
      picture.samples.size() != 3 * std::size_t(picture.width) * std::size_t(picture.height))
    throw Error(path.string() + ": the picture is not complete 8- or 16-bit RGB");
  std::vector<png_byte> bytes = to_bytes(picture);
  std::vector<png_bytep> rows = row_pointers(bytes, picture.height);
  session::Draft draft(path);
  Written file{draft.file(), ""};
  PngError error;
  Writer writer(error);
  if (!encode(writer.png, writer.info, &file, picture, rows.data()))
    throw Error(file.failure.empty() ? path.string() + ": cannot be written: " + error.message
                                     : file.failure);
  draft.put(sync);
}

Plate read_png(const std::filesystem::path& path) {
  const box::Reading reading(path);
  FilePtr file = open(path);
  PngError error;
  Reader reader(error);
  if (!read_header(reader.png, reader.info, file.get()))
    throw Error(path.string() + ": is not a readable PNG: " + error.message);
  Plate picture;
  picture.width = static_cast<int>(png_get_image_width(reader.png, reader.info));
  picture.height = static_cast<int>(png_get_image_height(reader.png, reader.info));
  picture.bits = png_get_bit_depth(reader.png, reader.info);
  const std::size_t pixels = std::size_t(picture.width) * std::size_t(picture.height);
  if (pixels > most_pixels)
    throw Error(path.string() + ": has " + std::to_string(pixels) + " pixels; at most " +
                std::to_string(most_pixels) + " are allowed");
  const std::size_t samples = 3 * pixels;
  std::vector<png_byte> bytes(samples * (picture.bits == 16 ? 2 : 1));
  std::vector<png_bytep> rows = row_pointers(bytes, picture.height);
  if (!read_rows(reader.png, rows.data()))
    throw Error(path.string() + ": is damaged: " + error.message);
  picture.samples.resize(samples);
  for (std::size_t i = 0; i < samples; ++i)
    picture.samples[i] = picture.bits == 16
                             ? static_cast<std::uint16_t>(bytes[2 * i] << 8 | bytes[2 * i + 1])
                             : bytes[i];
  return picture;
}

}  // namespace previz::output
