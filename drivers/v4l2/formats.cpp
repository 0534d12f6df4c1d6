#include "drivers/v4l2/formats.hpp"

#include <array>

#include "drivers/error.hpp"

namespace previz::v4l2 {
namespace {

using convert::Layout;
using convert::Packing;

struct Known {
  std::uint32_t fourcc;
  Layout layout;
  int bits = 8;
  Packing packing = Packing::words;
};

// The kernel's Documentation/userspace-api/media/v4l/pixfmt.rst.
constexpr auto table = std::to_array<Known>({
    {V4L2_PIX_FMT_GREY, Layout::mono},
    {V4L2_PIX_FMT_Y10, Layout::mono, 10},
    {V4L2_PIX_FMT_Y12, Layout::mono, 12},
    {V4L2_PIX_FMT_Y14, Layout::mono, 14},
    {V4L2_PIX_FMT_Y16, Layout::mono, 16},
    {V4L2_PIX_FMT_SRGGB8, Layout::bayer_rggb},
    {V4L2_PIX_FMT_SGRBG8, Layout::bayer_grbg},
    {V4L2_PIX_FMT_SGBRG8, Layout::bayer_gbrg},
    {V4L2_PIX_FMT_SBGGR8, Layout::bayer_bggr},
    {V4L2_PIX_FMT_SRGGB10, Layout::bayer_rggb, 10},
    {V4L2_PIX_FMT_SGRBG10, Layout::bayer_grbg, 10},
    {V4L2_PIX_FMT_SGBRG10, Layout::bayer_gbrg, 10},
    {V4L2_PIX_FMT_SBGGR10, Layout::bayer_bggr, 10},
    {V4L2_PIX_FMT_SRGGB12, Layout::bayer_rggb, 12},
    {V4L2_PIX_FMT_SGRBG12, Layout::bayer_grbg, 12},
    {V4L2_PIX_FMT_SGBRG12, Layout::bayer_gbrg, 12},
    {V4L2_PIX_FMT_SBGGR12, Layout::bayer_bggr, 12},
    {V4L2_PIX_FMT_SRGGB14, Layout::bayer_rggb, 14},
    {V4L2_PIX_FMT_SGRBG14, Layout::bayer_grbg, 14},
    {V4L2_PIX_FMT_SGBRG14, Layout::bayer_gbrg, 14},
    {V4L2_PIX_FMT_SBGGR14, Layout::bayer_bggr, 14},
    {V4L2_PIX_FMT_SRGGB16, Layout::bayer_rggb, 16},
    {V4L2_PIX_FMT_SGRBG16, Layout::bayer_grbg, 16},
    {V4L2_PIX_FMT_SGBRG16, Layout::bayer_gbrg, 16},
    {V4L2_PIX_FMT_SBGGR16, Layout::bayer_bggr, 16},
    {V4L2_PIX_FMT_Y10P, Layout::mono, 10, Packing::csi2},
    {V4L2_PIX_FMT_SRGGB10P, Layout::bayer_rggb, 10, Packing::csi2},
    {V4L2_PIX_FMT_SGRBG10P, Layout::bayer_grbg, 10, Packing::csi2},
    {V4L2_PIX_FMT_SGBRG10P, Layout::bayer_gbrg, 10, Packing::csi2},
    {V4L2_PIX_FMT_SBGGR10P, Layout::bayer_bggr, 10, Packing::csi2},
    {V4L2_PIX_FMT_SRGGB12P, Layout::bayer_rggb, 12, Packing::csi2},
    {V4L2_PIX_FMT_SGRBG12P, Layout::bayer_grbg, 12, Packing::csi2},
    {V4L2_PIX_FMT_SGBRG12P, Layout::bayer_gbrg, 12, Packing::csi2},
    {V4L2_PIX_FMT_SBGGR12P, Layout::bayer_bggr, 12, Packing::csi2},
    {V4L2_PIX_FMT_SRGGB14P, Layout::bayer_rggb, 14, Packing::csi2},
    {V4L2_PIX_FMT_SGRBG14P, Layout::bayer_grbg, 14, Packing::csi2},
    {V4L2_PIX_FMT_SGBRG14P, Layout::bayer_gbrg, 14, Packing::csi2},
    {V4L2_PIX_FMT_SBGGR14P, Layout::bayer_bggr, 14, Packing::csi2},
    {V4L2_PIX_FMT_RGB24, Layout::rgb},
    {V4L2_PIX_FMT_BGR24, Layout::bgr},
    {V4L2_PIX_FMT_YUYV, Layout::yuyv},
    {V4L2_PIX_FMT_UYVY, Layout::uyvy},
    {V4L2_PIX_FMT_NV12, Layout::nv12},
    {V4L2_PIX_FMT_YUV420, Layout::i420},
    {V4L2_PIX_FMT_YVU420, Layout::yv12},
    {V4L2_PIX_FMT_MJPEG, Layout::mjpeg},
    {V4L2_PIX_FMT_JPEG, Layout::mjpeg},
});

}  // namespace

std::optional<convert::WireFormat> wire_format(std::uint32_t fourcc) {
  for (const Known& known : table)
    if (known.fourcc == fourcc) return convert::WireFormat{known.layout, known.bits, known.packing};
  return std::nullopt;
}

std::optional<convert::WireFormat> wire_format(const v4l2_pix_format& format) {
  std::optional<convert::WireFormat> wire = wire_format(format.pixelformat);
  if (!wire) return wire;
  std::uint32_t encoding = format.ycbcr_enc, quantization = format.quantization;
  if (encoding == V4L2_YCBCR_ENC_DEFAULT) encoding = V4L2_MAP_YCBCR_ENC_DEFAULT(format.colorspace);
  if (quantization == V4L2_QUANTIZATION_DEFAULT)
    quantization = V4L2_MAP_QUANTIZATION_DEFAULT(false, format.colorspace, encoding);
  const bool bt709 = encoding == V4L2_YCBCR_ENC_709 || encoding == V4L2_YCBCR_ENC_XV709;
  wire->matrix = bt709 ? convert::YuvMatrix::bt709 : convert::YuvMatrix::bt601;
  wire->range = quantization == V4L2_QUANTIZATION_FULL_RANGE ? convert::YuvRange::full
                                                             : convert::YuvRange::limited;
  return wire;
}

std::string fourcc_name(std::uint32_t fourcc) {
  std::string name;
  for (int shift = 0; shift < 32; shift += 8) {
    const std::uint32_t byte = fourcc >> shift & (shift == 24 ? 0x7f : 0xff);
    name += byte >= 0x20 && byte < 0x7f ? static_cast<char>(byte) : '?';  // it goes into messages
  }
  while (name.ends_with(' ')) name.pop_back();
  return fourcc >> 31 ? name + "-BE" : name;
}

std::optional<std::uint32_t> fourcc_of(const std::string& name) {
  for (const Known& known : table)
    if (fourcc_name(known.fourcc) == name) return known.fourcc;
  return std::nullopt;
}

std::string known_formats() {
  std::string names;
  for (const Known& known : table) add_to_list(names, fourcc_name(known.fourcc));
  return names;
}

}  // namespace previz::v4l2
