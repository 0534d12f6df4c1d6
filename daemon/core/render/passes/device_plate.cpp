#include "daemon/core/render/passes/device_plate.hpp"

#include <algorithm>
#include <cstring>
#include <span>
#include <vector>

#include "shaders/lib/render_shared.h"
#include "shaders/plate_codes.spv.h"
#include "shaders/plate_scale.spv.h"

namespace previz::render {
namespace {

constexpr Purpose for_plate{"the plate", "choose a smaller picture of the camera"};

// Devices may allow no more than 65535 work groups at once.
constexpr std::uint32_t most_pairs = 1u << 21;

gpu::GpuCameraFrame constants_of(const Frame& frame) {
  gpu::GpuCameraFrame constants{};
  constants.width = static_cast<std::uint32_t>(frame.width);
  constants.height = static_cast<std::uint32_t>(frame.height);
  constants.is_deep = frame.format == PixelFormat::gray16 ? 1 : 0;
  const BayerPattern pattern = frame.bayer;
  constants.red_x = pattern == BayerPattern::grbg || pattern == BayerPattern::bggr ? 1 : 0;
  constants.red_y = pattern == BayerPattern::gbrg || pattern == BayerPattern::bggr ? 1 : 0;
  if (frame.format == PixelFormat::yuv422p8)
    constants.arrangement = gpu::CAMERA_YUV422;
  else if (frame.format == PixelFormat::rgb8)
    constants.arrangement = gpu::CAMERA_RGB;
  else
    constants.arrangement = pattern == BayerPattern::none ? gpu::CAMERA_GRAY : gpu::CAMERA_BAYER;
  return constants;
}

// Every frame is looked at as a whole unless it clips: in a form that compilers make wide
// instructions of.
template <typename Code>
bool is_any_at_least(std::span<const Code> codes, std::uint32_t least) {
  constexpr std::size_t at_once = 4096;
  for (std::size_t first = 0; first < codes.size(); first += at_once) {
    unsigned found = 0;
    for (const Code code : codes.subspan(first, std::min(at_once, codes.size() - first)))
      found |= code >= least ? 1u : 0u;
    if (found != 0) return true;
  }
  return false;
}

bool is_any_16_bit_at_least(std::span<const std::uint8_t> bytes, std::uint32_t least) {
  std::vector<std::uint16_t> codes(4096);
  for (std::size_t first = 0; first < bytes.size(); first += 2 * codes.size()) {
    const std::size_t count = std::min(2 * codes.size(), bytes.size() - first);
    std::memcpy(codes.data(), &bytes[first], count);
    if (is_any_at_least<std::uint16_t>(std::span(codes).first(count / 2), least)) return true;
  }
  return false;
}

struct Range {
  std::uint8_t low = 255, high = 0;
};

// This too becomes wide instructions.
Range range_of(std::span<const std::uint8_t> codes) {
  Range range;
  for (const std::uint8_t code : codes) {
    range.low = std::min(range.low, code);
    range.high = std::max(range.high, code);
  }
  return range;
}

// The brightest luma of a few pixels in a row with the strongest chroma around them is a bound.
bool may_yuv_be_at_least(const Frame& frame, std::uint32_t least) {
  constexpr std::size_t pixels = 64;
  const std::span<const std::uint8_t> bytes = frame.bytes;
  const std::size_t width = frame.width, height = frame.height, chroma_width = (width + 1) / 2;
  const auto cb = bytes.subspan(width * height, chroma_width * height);
  const auto cr = bytes.subspan(width * height + cb.size(), cb.size());
  const convert::YuvToRgb& to_rgb = yuv_of_plates();
  for (std::size_t y = 0; y < height; ++y)
    for (std::size_t x = 0; x < width; x += pixels) {
      const auto luma = range_of(bytes.subspan(y * width + x, std::min(pixels, width - x)));
      const std::size_t first = y * chroma_width + x / 2;
      const std::size_t count = std::min(pixels / 2 + 1, chroma_width - x / 2);
      const Range blue = range_of(cb.subspan(first, count)),
                  red = range_of(cr.subspan(first, count));
      std::uint8_t of_high_chroma[3], of_low_chroma[3];
      to_rgb(luma.high, 8 * blue.high, 8 * red.high, of_high_chroma);  // red and blue
      to_rgb(luma.high, 8 * blue.low, 8 * red.low, of_low_chroma);     // green
      if (std::max({of_high_chroma[0], of_low_chroma[1], of_high_chroma[2]}) >= least) return true;
    }
  return false;
}

}  // namespace

std::span<const Pass> DevicePlate::passes() {
  static constexpr Pass all[] = {{"plate_codes", plate_codes_spv},
                                 {"plate_scale", plate_scale_spv}};
  return all;
}

DevicePlate::DevicePlate(Device& device) : device_(device) {
  make_kernels({&codes_of_bytes_, &scale_}, device, passes());
  reserve(codes_, 0);
}

void DevicePlate::reserve(Buffer& codes, std::size_t pixels, bool is_made_here) {
  // Two pixels are written at once.
  const vk::DeviceSize size =
      std::max<std::size_t>((pixels + 1) / 2, 1) * 6 * sizeof(std::uint16_t);
  if (codes.size < size)
    codes = create_texel_buffer(device_, for_plate, size, vk::Format::eR32Uint, is_made_here);
}

// Runs a kernel that works on two pixels of the picture in each invocation.
template <typename Constants>
void DevicePlate::dispatch(Kernel& kernel, Constants constants, std::size_t pixels,
                           const Buffers& buffers) {
  const auto pairs = static_cast<std::uint32_t>((pixels + 1) / 2);
  device_.record([&](const vk::raii::CommandBuffer& commands) {
    for (constants.first = 0; constants.first < pairs; constants.first += most_pairs)
      kernel.dispatch({commands, constants, buffers},
                      std::min(pairs - constants.first, most_pairs));
  });
}

void DevicePlate::take(const Plate& plate) {
  reserve(codes_, plate.samples.size() / 3);
  if (!plate.samples.empty())
    upload_bytes(device_, codes_, std::as_bytes(std::span(plate.samples)));
}

void DevicePlate::take(const Frame& frame) {
  make_codes(frame, codes_);
}

void DevicePlate::take(const Frame& frame, int width, int height, const CodeTables& tables) {
  make_codes(frame, whole_);
  const std::size_t pixels = static_cast<std::size_t>(width) * height;
  reserve(codes_, pixels, true);
  Buffers buffers{{"plate_samples", &whole_}, {"small_samples", &codes_}};
  tables.add_to(buffers);
  gpu::GpuPlateScale constants{};
  constants.from_width = static_cast<std::uint32_t>(frame.width);
  constants.from_height = static_cast<std::uint32_t>(frame.height);
  constants.width = static_cast<std::uint32_t>(width);
  constants.height = static_cast<std::uint32_t>(height);
  constants.most = (1u << tables.bits) - 1;
  dispatch(scale_, constants, pixels, buffers);
}

void DevicePlate::make_codes(const Frame& frame, Buffer& codes) {
  check_size(frame);
  const std::span<const std::byte> bytes = std::as_bytes(std::span(frame.bytes));
  const std::size_t pixels = static_cast<std::size_t>(frame.width) * frame.height;
  reserve(codes, pixels, !device_.shares_host_memory());
  if (frame.format == PixelFormat::rgb16) return upload_bytes(device_, codes, bytes);
  // A processor makes a plate in a twentieth of the time if it does so by itself.
  if (device_.shares_host_memory()) {
    const std::vector<std::uint16_t> made = to_plate(frame).samples;
    return upload_bytes(device_, codes, std::as_bytes(std::span(made)));
  }
  if (!yuv_terms_.buffer) upload_storage(device_, for_plate, yuv_terms_, yuv_of_plates().terms());
  const vk::DeviceSize size = (bytes.size() + 3) / 4 * 4;
  if (bytes_.size < size) bytes_ = create_storage_buffer(device_, for_plate, size);
  upload_bytes(device_, bytes_, bytes);
  dispatch(codes_of_bytes_, constants_of(frame), pixels,
           {{"camera_bytes", &bytes_}, {"yuv_terms", &yuv_terms_}, {"plate_samples", &codes}});
}

bool has_at_least(const Frame& frame, std::uint32_t least) {
  if (frame.format == PixelFormat::yuv422p8) return may_yuv_be_at_least(frame, least);
  if (plate_bits(frame.format) == 16) return is_any_16_bit_at_least(frame.bytes, least);
  return is_any_at_least<std::uint8_t>(frame.bytes, least);
}

bool has_at_least(const Plate& plate, std::uint32_t least) {
  return is_any_at_least<std::uint16_t>(plate.samples, least);
}

}  // namespace previz::render
