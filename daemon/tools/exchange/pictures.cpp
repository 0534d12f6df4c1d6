#include <ImfChannelList.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <tiffio.h>

#include <algorithm>
#include <cmath>
#include <exiv2/exiv2.hpp>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "daemon/core/lighting/exr_picture.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/tracking/photometry.hpp"
#include "daemon/tools/exchange/footage.hpp"
#include "daemon/tools/exchange/orientation.hpp"
#include "daemon/tools/exchange/picture_color.hpp"
#include "daemon/tools/exchange/picture_header.hpp"
#include "daemon/tools/exchange/picture_sequence.hpp"
#include "drivers/box/reading.hpp"
#include "drivers/error.hpp"

namespace previz::exchange {
namespace {

namespace fs = std::filesystem;

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

// What a picture's file says beside its samples.
struct Tags {
  Orientation orientation{};
  ColorTag color{};
};

// Nothing where they are damaged; the picture may be whole.
std::optional<Tags> tags_of(const std::string& file, const std::string& content) try {
  const box::Reading reading(file);
  const auto image = Exiv2::ImageFactory::open(file);
  image->readMetadata();
  Tags tags{{}, color_tag_of(content, *image)};
  const Exiv2::ExifData& data = image->exifData();
  const auto found = data.findKey(Exiv2::ExifKey("Exif.Image.Orientation"));
  if (found == data.end() || found->count() == 0) return tags;
  const float value = found->toFloat();
  if (value >= 1 && value <= 8)
    tags.orientation = exif_orientation(static_cast<int>(value)).value_or(Orientation{});
  return tags;
} catch (const Exiv2::Error&) {
  return std::nullopt;
}

// OpenCV 4.6 takes planes of 16 bits for interleaved samples (its issue 29567).
cv::Mat read_planes(const std::string& name) {
  const std::unique_ptr<TIFF, decltype(&TIFFClose)> tiff(TIFFOpen(name.c_str(), "r"), TIFFClose);
  std::uint32_t width = 0, height = 0, rows = 0, columns = 0;
  std::uint16_t count = 0;
  if (!tiff || !TIFFGetField(tiff.get(), TIFFTAG_IMAGEWIDTH, &width) ||
      !TIFFGetField(tiff.get(), TIFFTAG_IMAGELENGTH, &height) ||
      !TIFFGetField(tiff.get(), TIFFTAG_SAMPLESPERPIXEL, &count) || count > 4 || height == 0 ||
      width == 0 || width > most_pixels / height)
    return {};
  const bool is_tiled = TIFFIsTiled(tiff.get());
  columns = width;
  if (is_tiled) {
    TIFFGetField(tiff.get(), TIFFTAG_TILEWIDTH, &columns);
    TIFFGetField(tiff.get(), TIFFTAG_TILELENGTH, &rows);
  } else {
    TIFFGetFieldDefaulted(tiff.get(), TIFFTAG_ROWSPERSTRIP, &rows);
    rows = std::min(rows, height);
  }
  const tmsize_t bytes = is_tiled ? TIFFTileSize(tiff.get()) : TIFFStripSize(tiff.get());
  if (columns == 0 || rows == 0 || bytes < tmsize_t{2} * columns * rows ||
      static_cast<std::uint64_t>(bytes) > 2 * most_pixels)
    return {};
  std::vector<std::uint16_t> block(static_cast<std::size_t>(bytes) / 2);
  std::vector<cv::Mat> planes;
  for (std::uint16_t plane = 0; plane < count; ++plane) {
    planes.emplace_back(static_cast<int>(height), static_cast<int>(width), CV_16UC1);
    for (std::uint32_t y = 0; y < height; y += rows)
      for (std::uint32_t x = 0; x < width; x += columns) {
        const auto read =
            is_tiled ? TIFFReadTile(tiff.get(), block.data(), x, y, 0, plane)
                     : TIFFReadEncodedStrip(tiff.get(), TIFFComputeStrip(tiff.get(), y, plane),
                                            block.data(), bytes);
        if (read < 0) return {};
        const cv::Rect place(static_cast<int>(x), static_cast<int>(y),
                             static_cast<int>(std::min(columns, width - x)),
                             static_cast<int>(std::min(rows, height - y)));
        cv::Mat(static_cast<int>(rows), static_cast<int>(columns), CV_16UC1,
                block.data())({{}, place.size()})
            .copyTo(planes.back()(place));
      }
  }
  if (count > 2) std::swap(planes[0], planes[2]);  // OpenCV's order is blue, green, red
  cv::Mat picture;
  cv::merge(planes, picture);
  return picture;
}

class PictureFiles final : public Footage {
 public:
  PictureFiles(PictureSequence sequence, const ReadAs& read_as)
      : sequence_(std::move(sequence)), read_as_(read_as) {}

  std::optional<Picture> next() override {
    if (index_ == sequence_.files.size()) return std::nullopt;
    const std::uint64_t number = sequence_.positions[index_];
    Picture picture = read(sequence_.files[index_++].string());
    picture.number = number;
    return picture;
  }

  std::uint64_t lost() const override { return sequence_.missing; }

  std::vector<std::string> shape() const override { return turned_; }

  std::vector<std::string> notes() const override {
    std::vector<std::string> notes;
    if (!sequence_.words.empty()) notes.push_back(sequence_.words);
    for (const auto& [what, said] : said_)
      notes.push_back(said.first + ": " + what +
                      (said.count == 1 ? "" : " (" + std::to_string(said.count) + " pictures)"));
    for (const auto& [tag, found] : colors_)
      if (const double share = found.colors.clipped_share(); share > 0)
        notes.push_back(found.first + ": " + clipping_words(share));
    if (outside_ > 0)
      notes.push_back(
          sequence_.files.front().string() + ": " +
          clipping_words(static_cast<double>(outside_) / static_cast<double>(samples_)));
    return notes;
  }

 private:
  struct Said {
    std::string first;  // picture
    std::size_t count = 0;
  };

  void note(const std::string& name, const std::string& what) {
    Said& said = said_[what];
    if (said.count++ == 0) said.first = name;
  }

  Picture read(const std::string& name) {
    const std::string content = session::read_file(name, {"a picture", std::uint64_t{1} << 32});
    const PictureKind kind = check_picture_file(name, content);
    if (kind == PictureKind::dpx) return read_dpx(name, content);
    if (kind == PictureKind::exr) return read_exr(name);
    const bool is_tiff = kind == PictureKind::tiff;
    const bool in_planes = is_tiff && has_deep_planes(content);
    cv::Mat image = decode(name, in_planes);
    const auto found = tags_of(name, content);
    if (!found) note(name, "has damaged metadata; it is used as upright, and as sRGB");
    const Tags tags = found.value_or(Tags{});
    convert(image, tags.color, name);
    Picture picture = picture_of(image, name);
    if (!is_tiff || in_planes) return shaped(std::move(picture), tags.orientation);
    // OpenCV has turned a TIFF itself.
    if (read_as_.orientation) turn(picture, tags.orientation.inverse());
    return shaped(std::move(picture), Orientation{});
  }

  // Returns grey, or red, green and blue, of 8 or 16 bits.
  static cv::Mat decode(const std::string& name, bool has_deep_planes) try {
    const box::Reading reading(name);
    // UNCHANGED keeps the bit depth, and leaves EXIF's rotation to us: IMREAD_COLOR would turn it.
    cv::Mat image = has_deep_planes ? read_planes(name) : cv::imread(name, cv::IMREAD_UNCHANGED);
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
    return image;
  } catch (const cv::Exception& error) {
    throw Error(name + ": cannot be read as a picture: " + error.err);
  }

  void convert(cv::Mat& image, const ColorTag& tag, const std::string& name) {
    if (read_as_.keeps_signal) return;
    const bool is_said =
        read_as_.transfer || read_as_.primaries || read_as_.range == AVCOL_RANGE_MPEG;
    const bool is_whole = read_as_.transfer && (read_as_.primaries || !tag.has_primaries());
    if (is_said && tag.kind != ColorTag::Kind::none && tag.kind != ColorTag::Kind::srgb &&
        !is_whole)
      throw Error(name + ": names its colours by " + StillColors(tag, name).words() +
                  ", and read_as takes the place of all of it: give both \"transfer\" and "
                  "\"primaries\" there");
    const ColorTag key = is_said ? ColorTag{} : tag;
    auto found = colors_.find(key);
    if (found == colors_.end())
      found =
          colors_
              .emplace(key, Found{name, is_said ? StillColors(read_as_) : StillColors(tag, name)})
              .first;
    StillColors& colors = found->second.colors;
    if (!colors.changes_anything()) return;
    colors.convert(image, name);
    note(name, "is converted to Rec. 709 under sRGB's curve, by " + colors.words());
  }

  Picture read_dpx(const std::string& name, const std::string& content) {
    // SMPTE ST 268: who wrote it, and the transfer characteristic of its first element.
    constexpr std::size_t creator = 160, transfer = 801;
    constexpr char printing_density = 1, logarithmic = 3;
    ReadAs read_as = read_as_;
    if (!read_as.transfer) {
      if (content.at(transfer) == printing_density || content.at(transfer) == logarithmic)
        throw Error(name +
                    ": is logarithmic, as film is scanned; convert it to linear OpenEXR or to Rec. "
                    "709, or give \"read_as\": {\"transfer\": ...} beside \"pictures\" in "
                    "FRAMES.json if the tag is wrong");
      // FFmpeg's encoder calls every picture linear.
      if (content.compare(creator, 4, "Lavc") == 0) read_as.transfer = AVCOL_TRC_BT709;
    }
    const auto video = open_video(name, read_as);
    auto picture = video->next();
    if (!picture) throw Error(name + ": cannot be read as a picture; it is damaged");
    if (read_as.transfer && !read_as_.transfer)
      note(name, "was written by FFmpeg, which calls every DPX linear; its curve is kept");
    else
      for (const std::string& what : video->notes())
        note(name, what.ends_with("clipped") ? "has samples outside of what Rec. 709 holds"
                                             : what.substr(std::min(what.size(), name.size() + 2)));
    picture->name = name;
    picture->container_ns.reset();
    return std::move(*picture);
  }

  // Scene light; the take holds it from 0 to 1 under sRGB's curve.
  Picture read_exr(const std::string& name) {
    if (read_as_.transfer.value_or(AVCOL_TRC_LINEAR) != AVCOL_TRC_LINEAR || read_as_.range)
      throw Error(name +
                  ": is OpenEXR, which holds linear light of any range; read_as can name its "
                  "primaries only");
    std::vector<std::string> oddities;
    const lighting::LinearPicture light =
        lighting::read_exr_picture(name, oddities,
                                   {.keeps_primaries = read_as_.primaries.has_value(),
                                    .is_plate = true,
                                    .most_kept = static_cast<std::int64_t>(most_pixels)});
    for (const std::string& oddity : oddities)
      note(name, oddity.substr(std::min(oddity.size(), name.size() + 2)));
    const auto m = *rec709_from(read_as_.primaries.value_or(AVCOL_PRI_BT709));
    cv::Mat image(light.height, light.width, CV_16UC3);
    auto* sample = image.ptr<std::uint16_t>();
    for (const glm::vec3& radiance : light.radiance)
      for (std::size_t row = 0; row < 9; row += 3) {
        const double value =
            m[row] * radiance.r + m[row + 1] * radiance.g + m[row + 2] * radiance.b;
        outside_ += !(value >= 0 && value <= 1);
        *sample++ = static_cast<std::uint16_t>(
            std::lround(65535 * tracking::srgb_encode(value > 0 ? std::min(value, 1.0) : 0)));
      }
    samples_ += 3 * light.radiance.size();
    note(name, "holds linear light, which is converted to sRGB's curve; 1 is white");
    Picture picture = picture_of(image, name);
    const Imf::InputFile file(name.c_str());
    if (file.header().channels().findChannel("A")) note(name, "its transparency is not used");
    constexpr int parts = 10'000;
    const double aspect = light.pixel_aspect;
    if (!read_as_.pixel_aspect && aspect > 0.125 && aspect < 8)
      make_square(picture, static_cast<int>(std::lround(aspect * parts)), parts);
    return shaped(std::move(picture), Orientation{});
  }

  static Picture picture_of(cv::Mat& image, const std::string& name) {
    if (!image.isContinuous()) image = image.clone();
    Picture picture{format_of(image), image.cols, image.rows, {}, name, {}, 0};
    picture.bytes.assign(image.datastart, image.dataend);
    return picture;
  }

  // `orientation` is the file's.
  Picture shaped(Picture picture, const Orientation& orientation) {
    if (const auto& aspect = read_as_.pixel_aspect) make_square(picture, aspect->num, aspect->den);
    turn(picture, read_as_.orientation.value_or(orientation));
    if (!orientation.is_upright() && !read_as_.orientation) {
      const std::string what = "is " + orientation.words() + ", as its EXIF data says";
      turned_ = {picture.name + ": " + what};
      note(picture.name, what);
    }
    return picture;
  }

  PictureSequence sequence_;
  ReadAs read_as_;
  std::size_t index_ = 0;
  struct Found {
    std::string first;  // picture
    StillColors colors;
  };
  std::map<ColorTag, Found> colors_;
  std::map<std::string, Said> said_;
  std::vector<std::string> turned_;          // the last picture that was
  std::uint64_t samples_ = 0, outside_ = 0;  // of OpenEXR
};

}  // namespace

std::unique_ptr<Footage> open_pictures(PictureSequence sequence, const ReadAs& read_as) {
  return std::make_unique<PictureFiles>(std::move(sequence), read_as);
}

std::unique_ptr<Footage> open_pictures(std::vector<fs::path> files) {
  return open_pictures(whole_sequence(std::move(files)), ReadAs{});
}

}  // namespace previz::exchange
