#include "drivers/aravis/pixel_formats.hpp"

#include <array>

#include "drivers/error.hpp"

namespace previz::aravis {
namespace {

using convert::Layout;
using convert::Packing;

struct Known {
  std::uint32_t pfnc;
  const char* name;
  Layout layout;
  int bits;
  Packing packing = Packing::words;
};

// EMVA, "GenICam Pixel Format Naming Convention" 2.4 and "PFNC values".
constexpr auto table = std::to_array<Known>({
    {0x01080001, "Mono8", Layout::mono, 8},
    {0x01100003, "Mono10", Layout::mono, 10},
    {0x010c0004, "Mono10Packed", Layout::mono, 10, Packing::gige},
    {0x010a0046, "Mono10p", Layout::mono, 10, Packing::bits},
    {0x01100005, "Mono12", Layout::mono, 12},
    {0x010c0006, "Mono12Packed", Layout::mono, 12, Packing::gige},
    {0x010c0047, "Mono12p", Layout::mono, 12, Packing::bits},
    {0x01100025, "Mono14", Layout::mono, 14},
    {0x01100007, "Mono16", Layout::mono, 16},
    {0x01080008, "BayerGR8", Layout::bayer_grbg, 8},
    {0x01080009, "BayerRG8", Layout::bayer_rggb, 8},
    {0x0108000a, "BayerGB8", Layout::bayer_gbrg, 8},
    {0x0108000b, "BayerBG8", Layout::bayer_bggr, 8},
    {0x0110000c, "BayerGR10", Layout::bayer_grbg, 10},
    {0x0110000d, "BayerRG10", Layout::bayer_rggb, 10},
    {0x0110000e, "BayerGB10", Layout::bayer_gbrg, 10},
    {0x0110000f, "BayerBG10", Layout::bayer_bggr, 10},
    {0x010a0056, "BayerGR10p", Layout::bayer_grbg, 10, Packing::bits},
    {0x010a0058, "BayerRG10p", Layout::bayer_rggb, 10, Packing::bits},
    {0x010a0054, "BayerGB10p", Layout::bayer_gbrg, 10, Packing::bits},
    {0x010a0052, "BayerBG10p", Layout::bayer_bggr, 10, Packing::bits},
    {0x010c0026, "BayerGR10Packed", Layout::bayer_grbg, 10, Packing::gige},
    {0x010c0027, "BayerRG10Packed", Layout::bayer_rggb, 10, Packing::gige},
    {0x010c0028, "BayerGB10Packed", Layout::bayer_gbrg, 10, Packing::gige},
    {0x010c0029, "BayerBG10Packed", Layout::bayer_bggr, 10, Packing::gige},
    {0x01100010, "BayerGR12", Layout::bayer_grbg, 12},
    {0x01100011, "BayerRG12", Layout::bayer_rggb, 12},
    {0x01100012, "BayerGB12", Layout::bayer_gbrg, 12},
    {0x01100013, "BayerBG12", Layout::bayer_bggr, 12},
    {0x010c0057, "BayerGR12p", Layout::bayer_grbg, 12, Packing::bits},
    {0x010c0059, "BayerRG12p", Layout::bayer_rggb, 12, Packing::bits},
    {0x010c0055, "BayerGB12p", Layout::bayer_gbrg, 12, Packing::bits},
    {0x010c0053, "BayerBG12p", Layout::bayer_bggr, 12, Packing::bits},
    {0x010c002a, "BayerGR12Packed", Layout::bayer_grbg, 12, Packing::gige},
    {0x010c002b, "BayerRG12Packed", Layout::bayer_rggb, 12, Packing::gige},
    {0x010c002c, "BayerGB12Packed", Layout::bayer_gbrg, 12, Packing::gige},
    {0x010c002d, "BayerBG12Packed", Layout::bayer_bggr, 12, Packing::gige},
    {0x0110002e, "BayerGR16", Layout::bayer_grbg, 16},
    {0x0110002f, "BayerRG16", Layout::bayer_rggb, 16},
    {0x01100030, "BayerGB16", Layout::bayer_gbrg, 16},
    {0x01100031, "BayerBG16", Layout::bayer_bggr, 16},
    {0x02180014, "RGB8", Layout::rgb, 8},
    {0x02180015, "BGR8", Layout::bgr, 8},
    {0x02300018, "RGB10", Layout::rgb, 10},
    {0x02300019, "BGR10", Layout::bgr, 10},
    {0x0230001a, "RGB12", Layout::rgb, 12},
    {0x0230001b, "BGR12", Layout::bgr, 12},
    {0x02300033, "RGB16", Layout::rgb, 16},
    {0x0230004b, "BGR16", Layout::bgr, 16},
    {0x0210001f, "YUV422_8_UYVY", Layout::uyvy, 8},
    {0x02100032, "YUV422_8", Layout::yuyv, 8},
});

}  // namespace

// The YUV422 formats of PFNC are full range, with BT.601's matrix.
std::optional<convert::WireFormat> wire_format(std::uint32_t pfnc) {
  for (const Known& known : table)
    if (known.pfnc == pfnc)
      return convert::WireFormat{known.layout, known.bits, known.packing, convert::YuvMatrix::bt601,
                                 convert::YuvRange::full};
  return std::nullopt;
}

std::string known_formats() {
  std::string names;
  for (const Known& known : table) add_to_list(names, known.name);
  return names;
}

}  // namespace previz::aravis
