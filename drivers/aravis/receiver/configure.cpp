#include "drivers/aravis/receiver/configure.hpp"

#include <arpa/inet.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "drivers/aravis/pixel_formats.hpp"
#include "drivers/aravis/receiver/guarded_sockets.hpp"
#include "drivers/aravis/receiver/packet_filter.hpp"
#include "drivers/frame_rate.hpp"

namespace previz::aravis {
namespace {

// Returns an IPv4 address in host order; none for other text.
std::optional<std::uint32_t> address_of(const std::string& text) {
  in_addr address{};
  if (inet_pton(AF_INET, text.c_str(), &address) != 1) return std::nullopt;
  return ntohl(address.s_addr);
}

std::string or_nothing(const char* text) {
  return text ? text : "";
}

bool gain_is_in_db(ArvCamera& camera) {
  ArvGcNode* node = arv_device_get_feature(arv_camera_get_device(&camera), "Gain");
  return ARV_IS_GC_FLOAT(node) && or_nothing(arv_gc_float_get_unit(ARV_GC_FLOAT(node))) == "dB";
}

// Throws if an exposure is not a number above 0 that radiance can be divided by.
void check_exposure(const std::string& device, const Exposure& exposure) {
  const double product = exposure.exposure_s * exposure.gain;
  if (exposure.exposure_s > 0 && exposure.gain > 0 && std::isnormal(product)) return;
  throw Error(device + ": reports an exposure of " + std::to_string(exposure.exposure_s) +
              " s with gain " + std::to_string(exposure.gain) + ", which is impossible");
}

class Configuration {
 public:
  Configuration(ArvCamera& camera, const CameraSettings& settings)
      : camera_(camera), settings_(settings) {}

  Agreed agree() {
    // A camera whose last receiver was killed may still stream, to where nobody listens.
    arv_camera_stop_acquisition(&camera_, failure_.out());
    arv_camera_set_acquisition_mode(&camera_, ARV_ACQUISITION_MODE_CONTINUOUS, failure_.out());
    check("acquisition mode");
    agree_on_format();
    agree_on_size();
    agree_on_trigger();
    agree_on_rate();
    agree_on_exposure();
    agree_on_white_balance();
    agree_on_chunks();
    agree_on_packets();
    agree_on_payload();
    return agreed_;
  }

 private:
  void check(const std::string& what) const { failure_.check(settings_.device, what); }
  [[noreturn]] void refuse(const std::string& what) const {
    throw Error(settings_.device + ": " + what);
  }

  void agree_on_format() {
    if (settings_.format) {
      arv_camera_set_pixel_format_from_string(&camera_, settings_.format->c_str(), failure_.out());
      if (failure_.failed())
        refuse("has no pixel format \"" + *settings_.format + "\"; it has " + its_formats());
    }
    agreed_.pfnc = arv_camera_get_pixel_format(&camera_, failure_.out());
    check("pixel format");
    if (!wire_format(agreed_.pfnc)) {
      const std::string name =
          or_nothing(arv_camera_get_pixel_format_as_string(&camera_, failure_.out()));
      refuse("its pixel format " + name + " cannot be converted; it has " + its_formats() +
             "; supported: " + known_formats());
    }
  }

  std::string its_formats() {
    unsigned count = 0;
    Failure ignored;
    const OwnedArray<const char*> formats(
        arv_camera_dup_available_pixel_formats_as_strings(&camera_, &count, ignored.out()));
    std::string names;
    for (unsigned i = 0; i < count; ++i) add_to_list(names, formats[i]);
    return names;
  }

  void agree_on_size() {
    if (settings_.width && settings_.height) {
      check_side("width", *settings_.width, arv_camera_get_width_bounds,
                 arv_camera_get_width_increment);
      check_side("height", *settings_.height, arv_camera_get_height_bounds,
                 arv_camera_get_height_increment);
      arv_camera_set_region(&camera_, 0, 0, *settings_.width, *settings_.height, failure_.out());
      check("picture size");
    }
    int x = 0, y = 0;
    int &width = agreed_.width, &height = agreed_.height;
    arv_camera_get_region(&camera_, &x, &y, &width, &height, failure_.out());
    check("picture size");
    if (width < 1 || height < 1 || width > 65535 || height > 65535)
      refuse("reports pictures of " + std::to_string(width) + "x" + std::to_string(height) +
             " pixels, which is impossible");
  }

  void check_side(const char* side, int wanted, decltype(arv_camera_get_width_bounds) bounds,
                  decltype(arv_camera_get_width_increment) increment) {
    int least = 0, most = 0;
    bounds(&camera_, &least, &most, failure_.out());
    check(side);
    const int step = std::max(1, increment(&camera_, failure_.out()));
    if (wanted < least || wanted > most || (wanted - least) % step != 0)
      refuse("a " + std::string(side) + " of " + std::to_string(wanted) + " is not possible; " +
             std::to_string(least) + " to " + std::to_string(most) + " in steps of " +
             std::to_string(step) + " are allowed");
  }

  void agree_on_trigger() {
    arv_camera_clear_triggers(&camera_, failure_.out());
    check("triggers");
    if (!settings_.trigger) return;
    const bool by_software = *settings_.trigger == "software";
    const char* source = by_software ? "Software" : settings_.trigger->c_str();
    arv_camera_set_trigger(&camera_, source, failure_.out());
    check("trigger \"" + *settings_.trigger + "\"");
  }

  void agree_on_rate() {
    if (settings_.trigger) {  // setting a rate would end the trigger
      if (settings_.rate_hz) refuse("its trigger sets its rate; remove rate_hz");
      return;
    }
    if (!arv_camera_is_frame_rate_available(&camera_, failure_.out())) {
      if (settings_.rate_hz) refuse("its rate cannot be set; remove rate_hz");
      return;
    }
    if (settings_.rate_hz) {
      double least = 0, most = 0;
      arv_camera_get_frame_rate_bounds(&camera_, &least, &most, failure_.out());
      check("frame rate");
      const RatesOnOffer offer = rates_between(least, most);
      const double nearest_hz = nearest_rate(offer, *settings_.rate_hz);
      if (!is_same_rate(*settings_.rate_hz, nearest_hz))
        refuse(rate_not_possible(*settings_.rate_hz, std::nullopt, text_of(offer)));
      arv_camera_set_frame_rate(&camera_, nearest_hz, failure_.out());
      check("frame rate");
    }
    const double rate_hz = arv_camera_get_frame_rate(&camera_, failure_.out());
    if (!failure_.failed() && std::isfinite(rate_hz) && rate_hz > 0) agreed_.rate_hz = rate_hz;
  }

  void agree_on_exposure() {
    agreed_.gain_in_db = gain_is_in_db(camera_);
    agreed_.drives_exposure = arv_camera_is_exposure_time_available(&camera_, failure_.out());
    if (!agreed_.drives_exposure && settings_.exposure_s)
      refuse("its exposure cannot be set; remove exposure_s");
    if (settings_.gain && !agreed_.gain_in_db)
      refuse("its gain is not in dB; use raw_gain, not gain");
    end_automatics();
    if (settings_.raw_gain) {
      arv_camera_set_gain(&camera_, *settings_.raw_gain, failure_.out());
      check("raw_gain");
    }
    if (!agreed_.drives_exposure || is_automatic()) return;
    const double us = arv_camera_get_exposure_time(&camera_, failure_.out());
    check("exposure");
    agreed_.exposure.exposure_s = 1e-6 * us;
    if (agreed_.gain_in_db)
      agreed_.exposure.gain = std::pow(10.0, arv_camera_get_gain(&camera_, failure_.out()) / 20.0);
    check_exposure(settings_.device, agreed_.exposure);
    if (settings_.exposure_s || settings_.gain)
      agreed_.exposure = set_exposure(camera_, settings_.device,
                                      {settings_.exposure_s.value_or(agreed_.exposure.exposure_s),
                                       settings_.gain.value_or(agreed_.exposure.gain)});
  }

  // Switches automatics off, so that the camera does not change what the set states.
  void end_automatics() {
    if ((settings_.exposure_s || settings_.gain) &&
        arv_camera_is_exposure_auto_available(&camera_, failure_.out())) {
      arv_camera_set_exposure_time_auto(&camera_, ARV_AUTO_OFF, failure_.out());
      check("automatic exposure");
    }
    if ((settings_.exposure_s || settings_.gain || settings_.raw_gain) &&
        arv_camera_is_gain_auto_available(&camera_, failure_.out())) {
      arv_camera_set_gain_auto(&camera_, ARV_AUTO_OFF, failure_.out());
      check("automatic gain");
    }
  }

  // Returns whether the camera changes its exposure by itself; only its chunk data then say what a
  // frame's exposure is.
  bool is_automatic() {
    return (arv_camera_is_exposure_auto_available(&camera_, failure_.out()) &&
            arv_camera_get_exposure_time_auto(&camera_, failure_.out()) != ARV_AUTO_OFF) ||
           (arv_camera_is_gain_auto_available(&camera_, failure_.out()) &&
            arv_camera_get_gain_auto(&camera_, failure_.out()) != ARV_AUTO_OFF);
  }

  // SFNC has colour ratios, not temperatures; only a calibration can say which ratio a lamp needs.
  void agree_on_white_balance() const {
    if (settings_.white_balance_k)
      refuse("GenICam cameras have no colour temperature; remove white_balance_k");
  }

  void agree_on_chunks() {
    if (!arv_camera_are_chunks_available(&camera_, failure_.out())) return;
    arv_camera_set_chunks(&camera_, "ExposureTime,Gain", failure_.out());
    agreed_.chunks = !failure_.failed();
  }

  void agree_on_packets() {
    if (!arv_camera_is_gv_device(&camera_)) {
      if (settings_.packet_size) refuse("is not a network camera; remove packet_size");
      return;
    }
    // Packet sockets need a privilege that the daemon does not have.
    arv_camera_gv_set_stream_options(&camera_, ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
    if (settings_.packet_size)
      arv_camera_gv_set_packet_size(&camera_, *settings_.packet_size, failure_.out());
    else
      arv_camera_gv_auto_packet_size(&camera_, failure_.out());
    check("packet size");
    // Aravis would try the size again as it makes the stream, by a socket that has the filter of
    // the stream, which lets no trial through.
    arv_camera_gv_set_packet_size_adjustment(&camera_, ARV_GV_PACKET_SIZE_ADJUSTMENT_NEVER);
  }

  // The driver decides whether it is large enough for the picture, and not too large.
  void agree_on_payload() {
    agreed_.payload = arv_camera_get_payload(&camera_, failure_.out());
    check("payload size");
  }

  ArvCamera& camera_;
  const CameraSettings& settings_;
  Failure failure_;
  Agreed agreed_;
};

// Aravis makes the socket of the control channel here, and one to try packet sizes in configure();
// the filter of answers lets the packets of that trial pass, too.
Owned<ArvCamera> open_camera(const std::string& id, const std::string& address,
                             const std::string& device) {
  if (const std::optional<std::uint32_t> camera = address_of(address))
    admit(control_filter(*camera));
  Failure failure;
  Owned<ArvCamera> camera(arv_camera_new(id.c_str(), failure.out()));
  if (!camera) throw Error(device + ": cannot be opened: " + failure.text());
  return camera;
}

}  // namespace

std::vector<Listed> list_devices() {
  admit(discovery_filter());
  arv_update_device_list();
  std::vector<Listed> devices;
  for (unsigned i = 0; i < arv_get_n_devices(); ++i)
    devices.push_back({or_nothing(arv_get_device_id(i)), or_nothing(arv_get_device_address(i)),
                       or_nothing(arv_get_device_serial_nbr(i)),
                       or_nothing(arv_get_device_vendor(i)), or_nothing(arv_get_device_model(i)),
                       or_nothing(arv_get_device_protocol(i))});
  return devices;
}

Owned<ArvCamera> find_camera(const std::string& device) {
  if (device.empty()) throw Error("an aravis camera needs its serial number or address");
  if (address_of(device)) return open_camera(device, device, device);
  std::string seen;
  for (const Listed& listed : list_devices()) {
    if (device == listed.serial || device == listed.id ||
        device == listed.vendor + "-" + listed.serial)
      return open_camera(listed.id, listed.address, device);
    add_to_list(seen, listed.serial + " (" + listed.address + ")");
  }
  throw Error(device + ": not found; connected: " + (seen.empty() ? "no cameras" : seen));
}

Agreed configure(ArvCamera& camera, const CameraSettings& settings) {
  return Configuration(camera, settings).agree();
}

Exposure set_exposure(ArvCamera& camera, const std::string& device, const Exposure& wanted) {
  const bool in_db = gain_is_in_db(camera);
  if (!in_db && wanted.gain != 1)
    throw Error(device + ": its gain is not in dB, so it cannot be set");
  Failure failure;
  double least = 0, most = 0;
  arv_camera_get_exposure_time_bounds(&camera, &least, &most, failure.out());
  failure.check(device, "exposure");
  arv_camera_set_exposure_time(
      &camera, std::clamp(1e6 * wanted.exposure_s, least, std::max(least, most)), failure.out());
  failure.check(device, "exposure");
  Exposure applied;
  applied.exposure_s = 1e-6 * arv_camera_get_exposure_time(&camera, failure.out());
  failure.check(device, "exposure");
  check_exposure(device, applied);
  if (!in_db) return applied;
  arv_camera_get_gain_bounds(&camera, &least, &most, failure.out());
  failure.check(device, "gain");
  const double db = 20.0 * std::log10(wanted.gain);
  arv_camera_set_gain(&camera, std::clamp(db, least, std::max(least, most)), failure.out());
  failure.check(device, "gain");
  applied.gain = std::pow(10.0, arv_camera_get_gain(&camera, failure.out()) / 20.0);
  failure.check(device, "gain");
  check_exposure(device, applied);
  return applied;
}

std::string counter_name(std::string aravis_name) {
  if (aravis_name.starts_with("n_")) aravis_name.erase(0, 2);
  std::ranges::replace(aravis_name, '_', ' ');
  return "stream " + aravis_name;
}

// A burst of a whole frame must fit between two runs of the receiver; the kernel cuts the size to
// net.core.rmem_max.
void configure_gige_stream(ArvStream& stream, std::int64_t payload) {
  const int size = static_cast<int>(std::clamp<std::int64_t>(4 * payload, 1 << 20, 64 << 20));
  g_object_set(&stream, "socket-buffer", ARV_GV_STREAM_SOCKET_BUFFER_FIXED, "socket-buffer-size",
               size, "packet-resend", ARV_GV_STREAM_PACKET_RESEND_ALWAYS, nullptr);
}

}  // namespace previz::aravis
