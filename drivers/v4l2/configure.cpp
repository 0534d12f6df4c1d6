#include "drivers/v4l2/configure.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "drivers/error.hpp"
#include "drivers/frame_rate.hpp"
#include "drivers/v4l2/formats.hpp"

namespace previz::v4l2 {
namespace {

constexpr double exposure_step_s = 100e-6;  // the unit of V4L2_CID_EXPOSURE_ABSOLUTE
// A driver that never ends its lists must not hold us for ever.
constexpr std::uint32_t most_entries = 1000;
constexpr double most_rate_hz = 100'000;

// Returns the bounds of a control; none if the node has no such control, or not now.
std::optional<v4l2_queryctrl> query(Node& node, std::uint32_t id) {
  v4l2_queryctrl control{};
  control.id = id;
  if (node.control(VIDIOC_QUERYCTRL, &control) != 0) return std::nullopt;
  if (control.flags & V4L2_CTRL_FLAG_DISABLED) return std::nullopt;
  return control;
}

double rate_of(const v4l2_fract& period) {
  return double(period.denominator) / period.numerator;
}

bool write(Node& node, std::uint32_t id, std::int32_t value) {
  v4l2_control control{id, value};
  return node.control(VIDIOC_S_CTRL, &control) == 0;
}

std::optional<std::int32_t> read(Node& node, std::uint32_t id) {
  v4l2_control control{id, 0};
  if (node.control(VIDIOC_G_CTRL, &control) != 0) return std::nullopt;
  return control.value;
}

class Configuration {
 public:
  Configuration(Node& node, const CameraSettings& settings) : node_(node), settings_(settings) {}

  Agreed agree() {
    check_capabilities();
    agree_on_format();
    agree_on_rate();
    agree_on_exposure();
    agree_on_control(V4L2_CID_AUTOGAIN, V4L2_CID_GAIN, "raw_gain", settings_.raw_gain);
    agree_on_control(V4L2_CID_AUTO_WHITE_BALANCE, V4L2_CID_WHITE_BALANCE_TEMPERATURE,
                     "white_balance_k", settings_.white_balance_k);
    return agreed_;
  }

 private:
  [[noreturn]] void refuse(const std::string& what) const {
    throw Error(settings_.device + ": " + what);
  }
  void check(int error, const std::string& what) const {
    if (error != 0) refuse(what + ": " + std::strerror(error));
  }

  void check_capabilities() const {
    v4l2_capability capability{};
    check(node_.control(VIDIOC_QUERYCAP, &capability), "is not a video device");
    const std::uint32_t can = capability.capabilities & V4L2_CAP_DEVICE_CAPS
                                  ? capability.device_caps
                                  : capability.capabilities;
    if (can & V4L2_CAP_VIDEO_CAPTURE_MPLANE) refuse("is multi-planar; use the libcamera driver");
    if (!(can & V4L2_CAP_VIDEO_CAPTURE)) refuse("captures no video");
    if (!(can & V4L2_CAP_STREAMING)) refuse("cannot stream");
    if (settings_.trigger) refuse("V4L2 has no triggers; remove trigger");
    if (settings_.packet_size) refuse("is not a network camera; remove packet_size");
    if (settings_.gain) refuse("its gain has no unit; use raw_gain, not gain");
  }

  std::vector<std::uint32_t> formats() const {
    std::vector<std::uint32_t> formats;
    v4l2_fmtdesc description{};
    description.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    for (; description.index < most_entries; ++description.index) {
      if (node_.control(VIDIOC_ENUM_FMT, &description) != 0) break;
      formats.push_back(description.pixelformat);
    }
    return formats;
  }

  std::string format_names() const {
    std::string names;
    for (const std::uint32_t fourcc : formats()) add_to_list(names, fourcc_name(fourcc));
    return names.empty() ? "none" : names;
  }

  // Returns the rates that the node offers for pictures of a format and size.
  RatesOnOffer rates_of(std::uint32_t fourcc, std::uint32_t width, std::uint32_t height) const {
    RatesOnOffer rates;
    v4l2_frmivalenum interval{};
    interval.pixel_format = fourcc;
    interval.width = width;
    interval.height = height;
    for (; interval.index < most_entries; ++interval.index) {
      if (node_.control(VIDIOC_ENUM_FRAMEINTERVALS, &interval) != 0) break;
      if (interval.type == V4L2_FRMIVAL_TYPE_DISCRETE) {
        if (interval.discrete.numerator > 0) rates.hz.push_back(rate_of(interval.discrete));
        continue;
      }
      if (interval.stepwise.max.numerator > 0 && interval.stepwise.min.numerator > 0)
        rates = rates_between(rate_of(interval.stepwise.max), rate_of(interval.stepwise.min));
      break;
    }
    return rates;
  }

  // Returns whether the node can send that many frames per second, or does not report it.
  bool holds_rate(std::uint32_t fourcc, const v4l2_pix_format& picture) const {
    const RatesOnOffer rates = rates_of(fourcc, picture.width, picture.height);
    return !settings_.rate_hz || rates.hz.empty() ||
           std::ranges::max(rates.hz) >= 0.99 * *settings_.rate_hz;
  }

  static bool is_compressed(std::uint32_t fourcc) {
    const auto wire = wire_format(fourcc);
    return wire && wire->layout == convert::Layout::mjpeg;
  }

  // Returns the first that holds the rate: what the node is set to, its other formats, and last
  // those that lose quality. Where none does, what the node is set to.
  std::uint32_t format_for_rate(std::uint32_t first, const std::vector<std::uint32_t>& its,
                                const v4l2_pix_format& picture) const {
    if (holds_rate(first, picture)) return first;
    for (const bool compressed : {false, true})
      for (const std::uint32_t fourcc : its)
        if (wire_format(fourcc) && is_compressed(fourcc) == compressed &&
            holds_rate(fourcc, picture))
          return fourcc;
    return first;
  }

  // Returns the rates at the picture's size by pixel format; empty if the node reports none.
  std::string rates_text(const v4l2_pix_format& picture) const {
    std::string text;
    for (const std::uint32_t fourcc : formats()) {
      if (!wire_format(fourcc)) continue;
      const std::string rates = text_of(rates_of(fourcc, picture.width, picture.height));
      if (!rates.empty()) add_to_list(text, rates + " (pixel_format " + fourcc_name(fourcc) + ")");
    }
    return text.empty() ? text : text + " at " + size_text(picture.width, picture.height);
  }

  // Returns the format that the set asks for; else what the node is set to, if that can be
  // converted; else the first of its formats that can; but another one if only that holds the rate.
  std::uint32_t wanted_format(const v4l2_pix_format& picture) const {
    const std::uint32_t now = picture.pixelformat;
    const std::vector<std::uint32_t> its = formats();
    if (settings_.format) {
      const std::optional<std::uint32_t> wanted = fourcc_of(*settings_.format);
      if (!wanted)
        refuse("format \"" + *settings_.format + "\" is unknown; known: " + known_formats());
      if (std::ranges::find(its, *wanted) == its.end())
        refuse("has no format " + *settings_.format + "; it has: " + format_names());
      return *wanted;
    }
    if (wire_format(now)) return format_for_rate(now, its, picture);
    const auto first = std::ranges::find_if(
        its, [](std::uint32_t fourcc) { return wire_format(fourcc).has_value(); });
    if (first == its.end())
      refuse("has no format that can be converted; it has: " + format_names());
    return format_for_rate(*first, its, picture);
  }

  void agree_on_format() {
    v4l2_format format{};
    format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    check(node_.control(VIDIOC_G_FMT, &format), "does not report its format");
    v4l2_pix_format& picture = format.fmt.pix;
    if (settings_.width && settings_.height) {
      picture.width = static_cast<std::uint32_t>(*settings_.width);
      picture.height = static_cast<std::uint32_t>(*settings_.height);
    }
    const std::uint32_t wanted = wanted_format(picture);
    picture.pixelformat = wanted;
    picture.field = V4L2_FIELD_NONE;
    picture.bytesperline = picture.sizeimage = 0;
    check(node_.control(VIDIOC_S_FMT, &format), "rejects the format " + fourcc_name(wanted));
    const bool as_wanted = picture.pixelformat == wanted &&
                           (!settings_.width || !settings_.height ||
                            (picture.width == static_cast<std::uint32_t>(*settings_.width) &&
                             picture.height == static_cast<std::uint32_t>(*settings_.height)));
    if (!as_wanted) refuse_size(picture, wanted);
    if (picture.field != V4L2_FIELD_NONE)
      refuse("sends interlaced pictures, which are not supported");
    if (picture.width < 1 || picture.height < 1 || picture.width > 65535 || picture.height > 65535)
      refuse("reports pictures of " + size_text(picture.width, picture.height) +
             " pixels, which is impossible");
    const std::optional<convert::WireFormat> wire = wire_format(picture);
    if (!wire) refuse("sends " + fourcc_name(picture.pixelformat) + ", which is not supported");
    agreed_.wire = *wire;
    picture_ = picture;
    agreed_.stride = wire->layout == convert::Layout::mjpeg ? 0 : picture.bytesperline;
    agreed_.format = {convert::delivered_format(*wire), static_cast<int>(picture.width),
                      static_cast<int>(picture.height), 0, convert::bayer_pattern(*wire)};
    check_sizes();
  }

  // A device may claim anything, and memory is asked for by what it claims.
  void check_sizes() {
    const auto& [format, width, height, rate_hz, bayer] = agreed_.format;
    const std::size_t row = convert::row_bytes(agreed_.wire, width);
    if (agreed_.stride != 0 && agreed_.stride < row)
      refuse("reports rows of " + std::to_string(agreed_.stride) + " bytes; " +
             std::to_string(row) + " are needed");
    agreed_.least_bytes = convert::picture_bytes(agreed_.wire, width, height, agreed_.stride);
    const std::size_t bytes = std::max(agreed_.least_bytes, frame_bytes(format, width, height));
    if (bytes > convert::most_picture_bytes)
      refuse("reports pictures of " + std::to_string(width) + "x" + std::to_string(height) +
             " pixels and " + std::to_string(bytes) + " bytes; " +
             std::to_string(convert::most_picture_bytes) + " bytes is the maximum");
  }

  static std::string size_text(std::uint32_t width, std::uint32_t height) {
    return std::to_string(width) + "x" + std::to_string(height);
  }

  [[noreturn]] void refuse_size(const v4l2_pix_format& made, std::uint32_t wanted) const {
    std::string sizes;
    v4l2_frmsizeenum size{};
    size.pixel_format = wanted;
    for (; size.index < most_entries; ++size.index) {
      if (node_.control(VIDIOC_ENUM_FRAMESIZES, &size) != 0) break;
      sizes += sizes.empty() ? "" : ", ";
      if (size.type == V4L2_FRMSIZE_TYPE_DISCRETE) {
        sizes += size_text(size.discrete.width, size.discrete.height);
        continue;
      }
      sizes += size_text(size.stepwise.min_width, size.stepwise.min_height) + " to " +
               size_text(size.stepwise.max_width, size.stepwise.max_height) + " in steps of " +
               size_text(size.stepwise.step_width, size.stepwise.step_height);
      break;
    }
    const std::string asked =
        fourcc_name(wanted) +
        (settings_.width && settings_.height
             ? " " + std::to_string(*settings_.width) + "x" + std::to_string(*settings_.height)
             : "");
    refuse("offers " + fourcc_name(made.pixelformat) + " " + size_text(made.width, made.height) +
           " instead of " + asked + "; possible: " + (sizes.empty() ? "unknown" : sizes));
  }

  // Asks for the rate, of which the node takes the nearest it has; format() reports the result.
  void agree_on_rate() {
    v4l2_streamparm parameters{};
    parameters.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    v4l2_fract& period = parameters.parm.capture.timeperframe;
    if (settings_.rate_hz) {
      if (!(*settings_.rate_hz > 0 && *settings_.rate_hz <= most_rate_hz))
        refuse(rate_not_possible(*settings_.rate_hz, std::nullopt, rates_text(picture_)));
      period = {1000, static_cast<std::uint32_t>(std::lround(1000 * *settings_.rate_hz))};
      check(node_.control(VIDIOC_S_PARM, &parameters), "its rate cannot be set");
    } else if (node_.control(VIDIOC_G_PARM, &parameters) != 0) {
      return;
    }
    const double rate_hz = period.numerator > 0 ? rate_of(period) : 0;
    if (rate_hz <= most_rate_hz) agreed_.format.rate_hz = rate_hz;  // otherwise it is not known
    if (const auto other = other_rate(settings_, agreed_.format.rate_hz, rates_text(picture_)))
      agreed_.doubts.push_back(*other + "; a smaller picture may be faster");
  }

  void agree_on_exposure() {
    agreed_.drives_exposure = query(node_, V4L2_CID_EXPOSURE_ABSOLUTE).has_value();
    if (!agreed_.drives_exposure) {
      if (settings_.exposure_s) refuse("its exposure cannot be set; remove exposure_s");
      return;
    }
    if (settings_.exposure_s) {
      write(node_, V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL);
      write(node_, V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0);  // the rate stays, whatever the exposure
      const std::optional<double> applied = set_exposure(node_, *settings_.exposure_s);
      if (!applied)
        refuse("rejects an exposure of " + std::to_string(*settings_.exposure_s) + " s");
      agreed_.exposure.exposure_s = *applied;
    } else if (read(node_, V4L2_CID_EXPOSURE_AUTO).value_or(V4L2_EXPOSURE_MANUAL) ==
               V4L2_EXPOSURE_MANUAL) {
      const std::optional<std::int32_t> steps = read(node_, V4L2_CID_EXPOSURE_ABSOLUTE);
      if (steps && *steps > 0) agreed_.exposure.exposure_s = *steps * exposure_step_s;
    }
  }

  // Sets a control that has an automatic, and switches that off.
  void agree_on_control(std::uint32_t automatic, std::uint32_t id, const char* key,
                        const std::optional<double>& value) const {
    if (!value) return;
    const std::string name(key);
    write(node_, automatic, 0);
    const std::optional<v4l2_queryctrl> bounds = query(node_, id);
    if (!bounds) refuse("has no such control; remove " + name);
    if (*value < bounds->minimum || *value > bounds->maximum)
      refuse(name + " " + std::to_string(*value) + " is not possible; " +
             std::to_string(bounds->minimum) + " to " + std::to_string(bounds->maximum) +
             " are allowed");
    if (!write(node_, id, static_cast<std::int32_t>(std::lround(*value))))
      refuse("rejects " + name);
  }

  Node& node_;
  const CameraSettings& settings_;
  Agreed agreed_;
  v4l2_pix_format picture_{};
};

}  // namespace

Agreed configure(Node& node, const CameraSettings& settings) {
  return Configuration(node, settings).agree();
}

std::optional<double> set_exposure(Node& node, double exposure_s) {
  const std::optional<v4l2_queryctrl> bounds = query(node, V4L2_CID_EXPOSURE_ABSOLUTE);
  if (!bounds || !(exposure_s > 0)) return std::nullopt;
  const std::int32_t least = std::max(1, bounds->minimum);
  if (bounds->maximum < least) return std::nullopt;
  const double steps = std::clamp(std::round(exposure_s / exposure_step_s),
                                  static_cast<double>(least), static_cast<double>(bounds->maximum));
  if (!write(node, V4L2_CID_EXPOSURE_ABSOLUTE, static_cast<std::int32_t>(steps)))
    return std::nullopt;
  const std::optional<std::int32_t> made = read(node, V4L2_CID_EXPOSURE_ABSOLUTE);
  return made && *made > 0 ? std::optional(*made * exposure_step_s) : std::nullopt;
}

}  // namespace previz::v4l2
