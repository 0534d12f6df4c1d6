// Reads pictures from files, one after the other, in a format that a session can hold.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drivers/frame.hpp"

namespace previz::exchange {

struct PictureSequence;
struct ReadAs;

struct Picture {
  PixelFormat format = PixelFormat::rgb8;
  int width = 0, height = 0;
  std::vector<std::uint8_t> bytes;           // laid out as Frame::bytes
  std::string name;                          // for errors: the file, or file and frame
  std::optional<std::int64_t> container_ns;  // a video's own time, from its first frame
  std::uint64_t number = 0;                  // in the footage, from 0; lost frames count
};

// "10:00:00:00", and so many frames and seconds after it.
struct FileTimecode {
  std::string first;
  std::int64_t frames = 0;
  double seconds = 0;
};

class Footage {
 public:
  virtual ~Footage() = default;
  // Returns the next picture, or nothing after the last. A video's frame that cannot be decoded is
  // left out and counted. Throws previz::Error naming the picture that cannot be read, or the video
  // if none of it can.
  virtual std::optional<Picture> next() = 0;
  // Returns how many frames have been left out so far.
  virtual std::uint64_t lost() const { return 0; }
  // Returns the timecode that the file has for its frame 0, lost or not; only after the first
  // frame.
  virtual std::optional<FileTimecode> timecode() const { return std::nullopt; }
  // Returns why the pictures have the size that they have, if that is not plain, in plain words;
  // only after the first picture.
  virtual std::vector<std::string> shape() const { return {}; }
  // Returns the conversions and what is lost in plain words; they are complete after the last
  // picture.
  virtual std::vector<std::string> notes() const { return {}; }
};

// Footage of unknown origin is read by allow-lists of formats and decoders, and no picture of more
// pixels than this: a small file can claim to hold any number.
inline constexpr std::size_t most_pixels = std::size_t{1} << 28;

// `read_as` stands for tags of the files that are wrong or lacking (video_tags.hpp).
std::unique_ptr<Footage> open_pictures(PictureSequence sequence, const ReadAs& read_as);
std::unique_ptr<Footage> open_pictures(std::vector<std::filesystem::path> files);
std::unique_ptr<Footage> open_video(const std::filesystem::path& file, const ReadAs& read_as);
std::unique_ptr<Footage> open_video(const std::filesystem::path& file);
// One clip in several files, which follow one another without a gap.
std::unique_ptr<Footage> open_videos(std::vector<std::filesystem::path> files,
                                     const ReadAs& read_as);

}  // namespace previz::exchange
