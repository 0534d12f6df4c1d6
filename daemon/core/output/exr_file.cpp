#include "daemon/core/output/exr_file.hpp"

#include <ImfChannelList.h>
#include <ImfIO.h>
#include <ImfOutputFile.h>
#include <ImfTestFile.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <exception>
#include <string>
#include <utility>

#include "daemon/core/lighting/exr_header.hpp"
#include "daemon/core/output/picture_size.hpp"
#include "drivers/error.hpp"

namespace previz::output {
namespace {

// Writes into a draft. OpenEXR writes the end of a picture in a destructor, which cannot report an
// error: the first one is remembered.
class ExrStream final : public Imf::OStream {
 public:
  explicit ExrStream(const session::Draft& draft)
      : OStream(draft.target().c_str()), file_(draft.file()) {}

  void write(const char bytes[], int count) override {
    waiting_.append(bytes, static_cast<std::size_t>(count));
    position_ += static_cast<std::uint64_t>(count);
    if (waiting_.size() >= piece) flush();
  }
  std::uint64_t tellp() override { return position_; }
  void seekp(std::uint64_t position) override {
    flush();
    position_ = position;
    if (::lseek(file_.get(), static_cast<off_t>(position), SEEK_SET) < 0)
      remember(std::string(fileName()) + ": cannot be written: " + std::strerror(errno));
  }

  // Throws previz::Error if any part of the file could not be written.
  void close() {
    flush();
    if (!failure_.empty()) throw Error(failure_);
  }

 private:
  static constexpr std::size_t piece = 1 << 20;

  void flush() {
    try {
      file_.append(std::exchange(waiting_, {}));
    } catch (const Error& error) {
      remember(error.what());
    }
    if (!failure_.empty()) throw Error(failure_);
  }
  void remember(const std::string& failure) {
    if (failure_.empty()) failure_ = failure;
  }

  const session::OpenFile& file_;
  std::string waiting_;  // for the file, from position_ - waiting_.size() on
  std::uint64_t position_ = 0;
  std::string failure_;
};

}  // namespace

// OpenEXR's slices take a mutable pointer for reading and writing alike.
Imf::Slice exr_slice(const float* first, std::size_t floats_a_pixel, int width) {
  const std::size_t stride = floats_a_pixel * sizeof(float);
  return Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(const_cast<float*>(first)), stride,
                    stride * static_cast<std::size_t>(width));
}

session::Draft exr_draft(const std::filesystem::path& path, const Imf::Header& header,
                         const Imf::FrameBuffer& channels) {
  session::Draft draft(path);
  try {
    ExrStream stream(draft);
    {
      Imf::OutputFile file(stream, header);
      file.setFrameBuffer(channels);
      file.writePixels(header.dataWindow().max.y + 1);
    }
    stream.close();
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    throw Error(path.string() + ": cannot be written: " + error.what());
  }
  return draft;
}

void require_exr(const std::filesystem::path& path) {
  bool is_tiled = false, is_deep = false, has_parts = false;
  if (!Imf::isOpenExrFile(path.c_str(), is_tiled, is_deep, has_parts) || is_deep || has_parts)
    throw Error(path.string() + ": is not a flat, single-part EXR file");
  lighting::check_exr_header(path);
}

std::size_t exr_pixels(const std::filesystem::path& path, const Imath::Box2i& window) {
  const bool begins_at_0 = window.min.x == 0 && window.min.y == 0;
  const std::int64_t width = std::int64_t{window.max.x} + 1,
                     height = std::int64_t{window.max.y} + 1;
  if (!begins_at_0 || width < 1 || height < 1 ||
      width > static_cast<std::int64_t>(most_pixels) / height)
    throw Error(path.string() + ": its data window from " + std::to_string(window.min.x) + ", " +
                std::to_string(window.min.y) + " to " + std::to_string(window.max.x) + ", " +
                std::to_string(window.max.y) + " does not begin at 0, 0, or is empty or too large");
  return static_cast<std::size_t>(width * height);
}

void read_channels(const std::filesystem::path& path, Imf::InputFile& file,
                   const Imf::FrameBuffer& channels) {
  const Imf::Header& header = file.header();
  for (auto channel = channels.begin(); channel != channels.end(); ++channel)
    if (!header.channels().findChannel(channel.name()))
      throw Error(path.string() + ": has no channel " + channel.name());
  file.setFrameBuffer(channels);
  file.readPixels(header.dataWindow().min.y, header.dataWindow().max.y);
}

}  // namespace previz::output
