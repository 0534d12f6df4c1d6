// Makes footage for the tests of the import: pictures of noise in every kind of file, and a video.
#pragma once

extern "C" {
#include <libavcodec/avcodec.h>
}

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "daemon/tools/exchange/import.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::exchange {

using Json = nlohmann::json;
using Bytes = std::vector<std::uint8_t>;

// A file name.
std::string numbered(const std::string& before, int number, const std::string& after);
// BGR or grey noise as OpenCV holds it; `type` is CV_8UC3 and so on.
cv::Mat noise_picture(int seed, int type, int width, int height);
// The bytes that previz::Frame should hold for that picture: RGB order, packed.
Bytes frame_bytes_of(const cv::Mat& picture);
void write_picture(const std::filesystem::path& file, const cv::Mat& picture);

// A video as write_video() makes it.
struct VideoForm {
  std::string pixel_format = "rgb24";
  int width = 32, height = 16, fps = 25, seconds = 1;  // fps frames in so many seconds
  std::string encoder = "ffv1";                        // libav's name
  std::map<std::string, std::string> options{};        // the encoder's
  AVColorRange range = AVCOL_RANGE_UNSPECIFIED;
  AVColorSpace matrix = AVCOL_SPC_UNSPECIFIED;
  AVColorTransferCharacteristic transfer = AVCOL_TRC_UNSPECIFIED;
  AVColorPrimaries primaries = AVCOL_PRI_UNSPECIFIED;
  AVRational pixel_aspect = {0, 1};
  std::vector<std::int32_t> display_matrix{};     // 9, as in libavutil/display.h
  std::vector<std::int64_t> times{};              // in frames; else 0, 1, 2 ...
  std::map<std::string, std::string> metadata{};  // of the stream
  // Changes the packet of a number, in the order of decoding; false leaves it out.
  std::function<bool(AVPacket&, int)> spoil{};
  // Changes what the container says of the stream, not the encoder.
  std::function<void(AVCodecParameters&)> container{};
};

// Each frame's rows packed, planes one after the other, in the order of the pixel format. The
// container is what the file's name says.
void write_video(const std::filesystem::path& file, const VideoForm& form,
                 const std::vector<Bytes>& frames);

// A folder with observer/0000.png ... and FRAMES.json; every test changes one thing.
class Shoot {
 public:
  Shoot();
  explicit Shoot(const std::string& picture);  // that one, which the test writes
  const std::filesystem::path& folder() const { return directory_.path(); }
  std::filesystem::path session() const { return folder() / "take"; }

  Json json;  // FRAMES.json: three pictures of 32x24, 25 frames per second, exposure 0.5

  // Writes a video of that name, and makes it the footage of the film camera with exposure 1 and
  // what `more` says.
  void film(const std::string& name, const VideoForm& form, const std::vector<Bytes>& frames,
            const Json& more = {{"fps", 25}});

  // In the place of what was imported before.
  ImportReport import() const;
  // The message, or "" if the import succeeded; checks that a failure leaves nothing.
  std::string error() const;
  // Imports, and returns the film camera's first frame.
  FramePtr first_frame() const;
  // Returns the frames of a camera that were imported.
  std::unique_ptr<session::StreamReader> open(const std::string& source = "observer") const;

 private:
  test::TemporaryDirectory directory_;
};

}  // namespace previz::exchange
