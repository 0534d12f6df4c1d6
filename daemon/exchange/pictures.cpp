#include <exiv2/exiv2.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "daemon/exchange/footage.hpp"
#include "daemon/exchange/orientation.hpp"
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

// Which side of a JPEG or PNG is up, by its EXIF data. (OpenCV turns TIFF itself.)
Orientation orientation_of(const std::string& file) try {
  const auto image = Exiv2::ImageFactory::open(file);
  if (image->imageType() == Exiv2::ImageType::tiff) return {};
  image->readMetadata();
  const Exiv2::ExifData& data = image->exifData();
  const auto found = data.findKey(Exiv2::ExifKey("Exif.Image.Orientation"));
  if (found == data.end() || found->count() == 0) return {};
  const float value = found->toFloat();
  if (!(value >= 1 && value <= 8)) return {};  // is none
  return exif_orientation(static_cast<int>(value)).value_or(Orientation{});
} catch (const Exiv2::Error&) {
  return {};  // damaged EXIF data says nothing; the picture may be whole
}

class PictureFiles final : public Footage {
 public:
  explicit PictureFiles(std::vector<std::filesystem::path> files) : files_(std::move(files)) {}

  std::optional<Picture> next() override {
    if (index_ == files_.size()) return std::nullopt;
    const std::uint64_t number = index_;
    const std::string name = files_[index_++].string();
    check_picture_file(name);
    // UNCHANGED keeps the bit depth, and leaves EXIF's rotation to us: IMREAD_COLOR would turn it.
    cv::Mat image = cv::imread(name, cv::IMREAD_UNCHANGED);
    if (image.empty()) throw Error(name + ": cannot be read as a picture; it is damaged");
    const bool known_depth = image.depth() == CV_8U || image.depth() == CV_16U;
    if (!known_depth || image.channels() == 2 || image.channels() > 4)
      throw Error(name +
                  ": unsupported sample type or channels; allowed: grey or RGB "
                  "of 8 or 16 bits");
    if (image.channels() == 4 && !is_opaque(image))
      throw Error(name + ": is transparent in places; allowed: grey or RGB, opaque");
    if (image.channels() >= 3)
      cv::cvtColor(image, image, image.channels() == 4 ? cv::COLOR_BGRA2RGB : cv::COLOR_BGR2RGB);
    if (!image.isContinuous()) image = image.clone();
    Picture picture{format_of(image), image.cols, image.rows, {}, name, {}, number};
    picture.bytes.assign(image.datastart, image.dataend);
    const Orientation orientation = orientation_of(name);
    turn(picture, orientation);
    if (!orientation.is_upright() && turned_++ == 0)
      first_turned_ = name + ": is " + orientation.words() + ", as its EXIF data says";
    return picture;
  }

  std::vector<std::string> notes() const override {
    if (turned_ == 0) return {};
    return {first_turned_ + (turned_ == 1 ? "" : "; " + std::to_string(turned_) + " pictures are")};
  }

 private:
  std::vector<std::filesystem::path> files_;
  std::size_t index_ = 0, turned_ = 0;
  std::string first_turned_;
};

}  // namespace

std::unique_ptr<Footage> open_pictures(std::vector<std::filesystem::path> files) {
  return std::make_unique<PictureFiles>(std::move(files));
}

}  // namespace previz::exchange
