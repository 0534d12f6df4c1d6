#include "daemon/tools/exchange/read_as.hpp"

#include <array>
#include <string>
#include <utility>

namespace previz::exchange {
namespace {

template <typename Tag, std::size_t count>
using Names = std::array<std::pair<const char*, Tag>, count>;

constexpr Names<AVColorRange, 2> range_names = {
    {{"full", AVCOL_RANGE_JPEG}, {"limited", AVCOL_RANGE_MPEG}}};
constexpr Names<AVColorSpace, 4> matrix_names = {{{"bt601", AVCOL_SPC_SMPTE170M},
                                                  {"bt709", AVCOL_SPC_BT709},
                                                  {"bt2020", AVCOL_SPC_BT2020_NCL},
                                                  {"smpte240m", AVCOL_SPC_SMPTE240M}}};
constexpr const char* as_recorded = "as recorded";
constexpr Names<AVColorTransferCharacteristic, 10> transfer_names = {
    {{as_recorded, AVCOL_TRC_UNSPECIFIED},
     {"srgb", AVCOL_TRC_IEC61966_2_1},
     {"bt709", AVCOL_TRC_BT709},
     {"hlg", AVCOL_TRC_ARIB_STD_B67},
     {"pq", AVCOL_TRC_SMPTE2084},
     {"linear", AVCOL_TRC_LINEAR},
     {"gamma22", AVCOL_TRC_GAMMA22},
     {"gamma28", AVCOL_TRC_GAMMA28},
     {"log100", AVCOL_TRC_LOG},
     {"log316", AVCOL_TRC_LOG_SQRT}}};
constexpr Names<AVColorPrimaries, 6> primary_names = {{{"bt601-525", AVCOL_PRI_SMPTE170M},
                                                       {"bt601-625", AVCOL_PRI_BT470BG},
                                                       {"bt709", AVCOL_PRI_BT709},
                                                       {"bt2020", AVCOL_PRI_BT2020},
                                                       {"p3-d65", AVCOL_PRI_SMPTE432},
                                                       {"p3-dci", AVCOL_PRI_SMPTE431}}};
const std::array<std::pair<int, Orientation>, 4> turns = {
    {{0, {}}, {90, {0, -1, 1, 0}}, {180, {-1, 0, 0, -1}}, {270, {0, 1, -1, 0}}}};

template <typename Tag, std::size_t count>
std::optional<Tag> read_name(const Members& m, const char* key, const Names<Tag, count>& names) {
  if (!m.has(key)) return std::nullopt;
  const auto given = m.read<std::string>(key);
  std::string allowed;
  for (const auto& [name, tag] : names) {
    if (given == name) return tag;
    allowed += std::string(allowed.empty() ? "" : ", ") + '"' + name + '"';
  }
  m.fail(key, "is \"" + given + "\"; allowed: " + allowed);
}

}  // namespace

ReadAs read_read_as(const Members& camera) {
  ReadAs read_as;
  if (!camera.has("read_as")) return read_as;
  const Members m = camera.object(
      "read_as", {"range", "matrix", "transfer", "primaries", "rotation_deg", "pixel_aspect"});
  read_as.range = read_name(m, "range", range_names);
  read_as.matrix = read_name(m, "matrix", matrix_names);
  read_as.transfer = read_name(m, "transfer", transfer_names);
  read_as.keeps_signal = m.has("transfer") && m.read<std::string>("transfer") == as_recorded;
  read_as.primaries = read_name(m, "primaries", primary_names);
  if (m.has("rotation_deg")) {
    const auto degrees = m.read<double>("rotation_deg");
    for (const auto& [angle, orientation] : turns)
      if (degrees == angle) read_as.orientation = orientation;
    if (!read_as.orientation)
      m.fail("rotation_deg", "must be 0, 90, 180 or 270, clockwise, to turn the picture upright");
  }
  if (m.has("pixel_aspect")) {
    const auto sides = m.read_list<int>("pixel_aspect", units::plain.within(1, 65535));
    if (sides.size() != 2) m.fail("pixel_aspect", "must be two numbers: width and height");
    read_as.pixel_aspect = AVRational{sides[0], sides[1]};
  }
  return read_as;
}

}  // namespace previz::exchange
