#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "daemon/exchange/footage.hpp"
#include "daemon/exchange/picture_header.hpp"
#include "drivers/error.hpp"

namespace previz::exchange {
namespace {

// A picture with transparency cannot come from a camera; an alpha channel that is opaque everywhere
// is harmless.
bool is_opaque(const cv::Mat& bgra) {
  cv::Mat alpha;
  cv::extractChannel(bgra, alpha, 3);
  double least = 0;
  cv::minMaxLoc(alpha, &least);
  return least == (bgra.depth() == CV_8U ? 255.0 : 65535.0);
}

PixelFormat format_of(const cv::Mat& image) {
  const bool deep = image.depth() == CV_16U;
  if (image.channels() == 1) return deep ? PixelFormat::gray16 : PixelFormat::gray8;
  return deep ? PixelFormat::rgb16 : PixelFormat::rgb8;
}

class PictureFiles final : public Footage {
 public:
  explicit PictureFiles(std::vector<std::filesystem::path> files) : files_(std::move(files)) {}

  std::optional<Picture> next() override {
    if (index_ == files_.size()) return std::nullopt;
    const std::string name = files_[index_++].string();
    check_picture_file(name);
    // UNCHANGED keeps the bit depth and ignores EXIF's rotation.
    cv::Mat image = cv::imread(name, cv::IMREAD_UNCHANGED);
    if (image.empty()) throw Error(name + ": cannot be read as a picture; it is damaged");
    const bool known_depth = image.depth() == CV_8U || image.depth() == CV_16U;
    if (!known_depth || image.channels() == 2 || image.channels() > 4)
      throw Error(name +
                  ": has samples or channels that no camera delivers; allowed: grey or RGB "
                  "of 8 or 16 bits");
    if (image.channels() == 4 && !is_opaque(image))
      throw Error(name + ": is transparent in places; allowed: grey or RGB, opaque");
    if (image.channels() >= 3)
      cv::cvtColor(image, image, image.channels() == 4 ? cv::COLOR_BGRA2RGB : cv::COLOR_BGR2RGB);
    if (!image.isContinuous()) image = image.clone();
    Picture picture{format_of(image), image.cols, image.rows, {}, name, {}};
    picture.bytes.assign(image.datastart, image.dataend);
    return picture;
  }

 private:
  std::vector<std::filesystem::path> files_;
  std::size_t index_ = 0;
};

}  // namespace

std::unique_ptr<Footage> open_pictures(std::vector<std::filesystem::path> files) {
  return std::make_unique<PictureFiles>(std::move(files));
}

}  // namespace previz::exchange
