// Reads the pictures that a calibration looks at: a stream of a recorded session, a folder, or a
// video.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"

namespace previz::calibrate {

struct NamedFrame {
  FramePtr frame;
  std::string name;  // the picture's file, or the video and the frame's number
};

class PictureSource {
 public:
  virtual ~PictureSource() = default;
  // Returns nothing after the last picture. Throws previz::Error naming a picture that cannot be
  // read.
  virtual std::optional<NamedFrame> next() = 0;
  // Returns the number of pictures; nothing if it is only known after reading them (a video).
  virtual std::optional<std::size_t> count() const { return std::nullopt; }
  // Returns remarks for the reader of the result; complete after the last picture.
  virtual std::vector<std::string> notes() const { return {}; }
};

// `stream` is "observer" or "light" and matters for sessions only. Pictures of a folder come in the
// order of their names, without exposure (Frame::exposure_s 0). Throws previz::Error if there is
// nothing to read.
std::unique_ptr<PictureSource> open_source(const std::filesystem::path& path,
                                           const std::string& stream);

// Returns the picture files of a folder that can be read, by name. Throws previz::Error if there
// are none.
std::vector<std::filesystem::path> picture_files(const std::filesystem::path& folder);

bool is_session(const std::filesystem::path& path);

}  // namespace previz::calibrate
