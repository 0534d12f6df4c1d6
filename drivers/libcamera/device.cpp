#include "drivers/libcamera/device.hpp"

#include <libcamera/libcamera.h>
#include <linux/dma-buf.h>
#include <sys/ioctl.h>
#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <map>
#include <memory>
#include <mutex>
#include <regex>

#include "drivers/error.hpp"
#include "drivers/frame_rate.hpp"
#include "drivers/libcamera/mailbox.hpp"

namespace previz::libcam {
namespace {

namespace lc = ::libcamera;
using convert::Layout;
using convert::Packing;

// libcamera allows one manager in a process, and ends a process that makes a second.
class ManagerUse {
 public:
  ManagerUse() {
    const std::lock_guard lock(mutex());
    if (users()++ > 0) return;
    manager() = std::make_unique<lc::CameraManager>();
    manager()->start();
  }
  ~ManagerUse() {
    const std::lock_guard lock(mutex());
    if (--users() > 0) return;
    manager()->stop();
    manager().reset();
  }
  ManagerUse(const ManagerUse&) = delete;
  ManagerUse& operator=(const ManagerUse&) = delete;

  lc::CameraManager& operator*() const { return *manager(); }

 private:
  static std::mutex& mutex() {
    static std::mutex mutex;
    return mutex;
  }
  static int& users() {
    static int users = 0;
    return users;
  }
  static std::unique_ptr<lc::CameraManager>& manager() {
    static std::unique_ptr<lc::CameraManager> manager;
    return manager;
  }
};

struct Known {
  lc::PixelFormat format;
  Layout layout;
  int bits = 8;
  Packing packing = Packing::words;
};

// libcamera's formats are DRM's, which name a packed pixel from its highest byte down: RGB888 has
// blue first in memory.
constexpr auto known_pixel_formats = std::to_array<Known>({
    {lc::formats::R8, Layout::mono},
    {lc::formats::R10, Layout::mono, 10},
    {lc::formats::R12, Layout::mono, 12},
    {lc::formats::SRGGB8, Layout::bayer_rggb},
    {lc::formats::SGRBG8, Layout::bayer_grbg},
    {lc::formats::SGBRG8, Layout::bayer_gbrg},
    {lc::formats::SBGGR8, Layout::bayer_bggr},
    {lc::formats::SRGGB10, Layout::bayer_rggb, 10},
    {lc::formats::SGRBG10, Layout::bayer_grbg, 10},
    {lc::formats::SGBRG10, Layout::bayer_gbrg, 10},
    {lc::formats::SBGGR10, Layout::bayer_bggr, 10},
    {lc::formats::SRGGB12, Layout::bayer_rggb, 12},
    {lc::formats::SGRBG12, Layout::bayer_grbg, 12},
    {lc::formats::SGBRG12, Layout::bayer_gbrg, 12},
    {lc::formats::SBGGR12, Layout::bayer_bggr, 12},
    {lc::formats::SRGGB16, Layout::bayer_rggb, 16},
    {lc::formats::SGRBG16, Layout::bayer_grbg, 16},
    {lc::formats::SGBRG16, Layout::bayer_gbrg, 16},
    {lc::formats::SBGGR16, Layout::bayer_bggr, 16},
    {lc::formats::R10_CSI2P, Layout::mono, 10, Packing::csi2},
    {lc::formats::SRGGB10_CSI2P, Layout::bayer_rggb, 10, Packing::csi2},
    {lc::formats::SGRBG10_CSI2P, Layout::bayer_grbg, 10, Packing::csi2},
    {lc::formats::SGBRG10_CSI2P, Layout::bayer_gbrg, 10, Packing::csi2},
    {lc::formats::SBGGR10_CSI2P, Layout::bayer_bggr, 10, Packing::csi2},
    {lc::formats::SRGGB12_CSI2P, Layout::bayer_rggb, 12, Packing::csi2},
    {lc::formats::SGRBG12_CSI2P, Layout::bayer_grbg, 12, Packing::csi2},
    {lc::formats::SGBRG12_CSI2P, Layout::bayer_gbrg, 12, Packing::csi2},
    {lc::formats::SBGGR12_CSI2P, Layout::bayer_bggr, 12, Packing::csi2},
    {lc::formats::BGR888, Layout::rgb},
    {lc::formats::RGB888, Layout::bgr},
    {lc::formats::YUYV, Layout::yuyv},
    {lc::formats::UYVY, Layout::uyvy},
    {lc::formats::NV12, Layout::nv12},
    {lc::formats::YUV420, Layout::i420},
    {lc::formats::YVU420, Layout::yv12},
    {lc::formats::MJPEG, Layout::mjpeg},
});

const Known* find_known(const lc::PixelFormat& format) {
  const auto found = std::ranges::find(known_pixel_formats, format, &Known::format);
  return found == known_pixel_formats.end() ? nullptr : &*found;
}

std::string names_of(const std::vector<lc::PixelFormat>& formats) {
  std::string names;
  for (const lc::PixelFormat& format : formats) add_to_list(names, format.toString());
  return names.empty() ? "none" : names;
}

convert::WireFormat wire_format(const Known& known, const std::optional<lc::ColorSpace>& space) {
  convert::WireFormat wire{known.layout, known.bits, known.packing};
  if (!space) return wire;
  if (space->ycbcrEncoding == lc::ColorSpace::YcbcrEncoding::Rec709)
    wire.matrix = convert::YuvMatrix::bt709;
  if (space->range == lc::ColorSpace::Range::Full) wire.range = convert::YuvRange::full;
  return wire;
}

// Maps a file of a buffer for reading.
class MappedFile {
 public:
  MappedFile(int descriptor, std::size_t length) : descriptor_(descriptor) {
    void* memory = ::mmap(nullptr, length, PROT_READ, MAP_SHARED, descriptor, 0);
    if (memory == MAP_FAILED)
      throw Error(std::string("a buffer cannot be mapped: ") + std::strerror(errno));
    memory_ = {static_cast<const std::uint8_t*>(memory), length};
  }
  ~MappedFile() { ::munmap(const_cast<std::uint8_t*>(memory_.data()), memory_.size()); }
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;

  std::span<const std::uint8_t> memory() const { return memory_; }

  // Makes the caches ready for reads by the CPU; memory that is no dma-buf needs none of this, and
  // the call's failure is ignored.
  void sync(std::uint64_t when) const {
    dma_buf_sync request{when | DMA_BUF_SYNC_READ};
    ioctl(descriptor_, DMA_BUF_IOCTL_SYNC, &request);
  }

 private:
  int descriptor_;  // owned by libcamera
  std::span<const std::uint8_t> memory_;
};

// Maps a buffer's planes, which may share a file.
class MappedBuffer {
 public:
  explicit MappedBuffer(const lc::FrameBuffer& buffer) {
    std::map<int, std::size_t> lengths;
    for (const lc::FrameBuffer::Plane& plane : buffer.planes()) {
      std::size_t& length = lengths[plane.fd.get()];
      length = std::max(length, std::size_t{plane.offset} + plane.length);
    }
    for (const auto& [descriptor, length] : lengths)
      files_.try_emplace(descriptor, descriptor, length);
    for (const lc::FrameBuffer::Plane& plane : buffer.planes())
      planes_.push_back(files_.at(plane.fd.get()).memory().subspan(plane.offset, plane.length));
  }

  const std::vector<std::span<const std::uint8_t>>& planes() const { return planes_; }
  void sync(std::uint64_t when) const {
    for (const auto& [descriptor, file] : files_) file.sync(when);
  }

 private:
  std::map<int, MappedFile> files_;  // by descriptor
  std::vector<std::span<const std::uint8_t>> planes_;
};

}  // namespace

std::optional<UvcProduct> uvc_product(const std::string& id) {
  static const std::regex ending("-([0-9a-f]{4}):([0-9a-f]{4})$");
  std::smatch ids;
  if (!std::regex_search(id, ids, ending)) return std::nullopt;
  const auto number = [&](std::size_t i) {
    return static_cast<std::uint16_t>(std::stoul(ids[i], nullptr, 16));
  };
  return UvcProduct{number(1), number(2)};
}

std::vector<Listed> list_cameras() {
  const ManagerUse manager;
  std::vector<Listed> listed;
  for (const auto& camera : (*manager).cameras())
    listed.push_back({camera->id(), camera->properties().get(lc::properties::Model).value_or("")});
  return listed;
}

struct Device::Impl {
  explicit Impl(const CameraSettings& its_settings) : settings(its_settings) {
    find();
    acquire();
    mailbox = mailbox_of(camera);
    try {
      agree();
      allocate();
    } catch (...) {
      release();
      throw;
    }
  }
  ~Impl() { release(); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  [[noreturn]] void refuse(const std::string& what) const {
    throw Error(settings.device + ": " + what);
  }
  void check(int error, const std::string& what) const {
    if (error < 0) refuse(what + ": " + std::strerror(-error));
  }

  void find() {
    std::string there;
    for (const auto& candidate : (*manager).cameras()) {
      if (candidate->id() == settings.device) camera = candidate;
      add_to_list(there, candidate->id());
    }
    if (!camera) refuse("not found; connected: " + (there.empty() ? "no cameras" : there));
  }

  void acquire() {
    check(camera->acquire(), "is busy; another program may be using it");
    acquired = true;
  }

  void release() {
    requests.clear();
    mapped.clear();
    allocator.reset();
    if (acquired) camera->release();
    acquired = false;
  }

  // ControlInfoMap::count() of 0.0.3 counts every control that libcamera knows.
  bool has(const lc::ControlId& control) const {
    return camera->controls().find(control.id()) != camera->controls().end();
  }

  void agree() {
    if (settings.trigger) refuse("libcamera has no triggers; remove trigger");
    if (settings.packet_size) refuse("is not a network camera; remove packet_size");
    if (settings.raw_gain) refuse("its gain is linear; use gain, not raw_gain");
    agreed.drives_exposure = has(lc::controls::ExposureTime);
    agreed.drives_gain = has(lc::controls::AnalogueGain);
    if (settings.exposure_s && !agreed.drives_exposure)
      refuse("its exposure cannot be set; remove exposure_s");
    if (settings.gain && !agreed.drives_gain) refuse("its gain cannot be set; remove gain");
    if (settings.gain && !settings.exposure_s)
      refuse("its gain and exposure are set together; give exposure_s too");
    if (settings.white_balance_k && !has(lc::controls::ColourTemperature))
      refuse("has no colour temperature; remove white_balance_k");
    agree_on_format();
    agree_on_rate();
  }

  void agree_on_format() {
    configuration = camera->generateConfiguration({lc::StreamRole::VideoRecording});
    if (!configuration || configuration->empty()) refuse("offers no video");
    lc::StreamConfiguration& config = configuration->at(0);
    const lc::StreamFormats formats = config.formats();
    const lc::PixelFormat wanted = wanted_format(config.pixelFormat, formats.pixelformats());
    config.pixelFormat = wanted;
    if (settings.width && settings.height)
      config.size = {static_cast<unsigned>(*settings.width),
                     static_cast<unsigned>(*settings.height)};
    const lc::Size size = config.size;
    const bool asked_size = settings.width.has_value();
    if (configuration->validate() == lc::CameraConfiguration::Invalid ||
        config.pixelFormat != wanted || (asked_size && config.size != size)) {
      std::string sizes;
      for (const lc::Size& possible : formats.sizes(wanted))
        add_to_list(sizes, possible.toString());
      refuse("offers " + config.toString() + " instead of " + size.toString() + "-" +
             wanted.toString() + "; possible: " + (sizes.empty() ? "unknown" : sizes));
    }
    check(camera->configure(configuration.get()), "rejects " + config.toString());
    const Known& known = *find_known(config.pixelFormat);
    agreed.wire = wire_format(known, config.colorSpace);
    agreed.stride = known.layout == Layout::mjpeg ? 0 : config.stride;
    agreed.format = {convert::delivered_format(agreed.wire), static_cast<int>(config.size.width),
                     static_cast<int>(config.size.height), 0, convert::bayer_pattern(agreed.wire)};
    const std::size_t least =
        convert::picture_bytes(agreed.wire, agreed.format.width, agreed.format.height);
    const std::size_t delivered =
        frame_bytes(agreed.format.format, agreed.format.width, agreed.format.height);
    if (std::max(least, delivered) > convert::most_picture_bytes)
      refuse("reports pictures of " + config.size.toString() + " pixels, which need more than " +
             std::to_string(convert::most_picture_bytes) + " bytes");
    if (config.frameSize < least)
      refuse("reports a frame size of " + std::to_string(config.frameSize) +
             " bytes; its picture needs " + std::to_string(least));
  }

  // Returns a bound of the frame's duration; 0 for one that is no whole number of microseconds.
  static double microseconds(const lc::ControlValue& bound) {
    if (bound.type() != lc::ControlTypeInteger64 || bound.isArray()) return 0;
    return static_cast<double>(bound.get<std::int64_t>());
  }

  // The bounds depend on the format. A pipeline clips a rate beyond them and does not report it.
  void agree_on_rate() {
    if (!settings.rate_hz) return;
    if (!has(lc::controls::FrameDurationLimits)) refuse("its rate cannot be set; remove rate_hz");
    const lc::ControlInfo& limits =
        camera->controls().find(lc::controls::FrameDurationLimits.id())->second;
    const RatesOnOffer offer =
        rates_between(1e6 / microseconds(limits.max()), 1e6 / microseconds(limits.min()));
    agreed.format.rate_hz = nearest_rate(offer, *settings.rate_hz);
    if (const auto other = other_rate(settings, agreed.format.rate_hz, text_of(offer)))
      agreed.doubts.push_back(*other);
  }

  // Returns the format that the set asks for; else what the camera proposes, if that can be
  // converted; else the first of its formats that can.
  lc::PixelFormat wanted_format(const lc::PixelFormat& proposed,
                                const std::vector<lc::PixelFormat>& its) const {
    if (settings.format) {
      const lc::PixelFormat wanted = lc::PixelFormat::fromString(*settings.format);
      if (std::ranges::find(its, wanted) == its.end())
        refuse("has no format " + *settings.format + "; it has: " + names_of(its));
      if (!find_known(wanted)) refuse("sends " + *settings.format + ", which is not supported");
      return wanted;
    }
    if (find_known(proposed)) return proposed;
    const auto first = std::ranges::find_if(its, find_known);
    if (first == its.end()) refuse("has no format that can be converted; it has: " + names_of(its));
    return *first;
  }

  void allocate() {
    stream = configuration->at(0).stream();
    allocator = std::make_unique<lc::FrameBufferAllocator>(camera);
    check(allocator->allocate(stream), "returns no buffers");
    for (const auto& buffer : allocator->buffers(stream)) mapped.emplace_back(*buffer);
  }

  void write(lc::ControlList& controls, const Exposure& exposure) const {
    if (has(lc::controls::AeEnable)) controls.set(lc::controls::AeEnable, false);
    controls.set(lc::controls::ExposureTime,
                 static_cast<std::int32_t>(std::lround(1e6 * exposure.exposure_s)));
    if (agreed.drives_gain)
      controls.set(lc::controls::AnalogueGain, static_cast<float>(exposure.gain));
  }

  lc::ControlList starting_controls(const std::optional<Exposure>& exposure) const {
    lc::ControlList controls(camera->controls());
    if (exposure) write(controls, *exposure);
    if (settings.white_balance_k) {
      if (has(lc::controls::AwbEnable)) controls.set(lc::controls::AwbEnable, false);
      controls.set(lc::controls::ColourTemperature,
                   static_cast<std::int32_t>(std::lround(*settings.white_balance_k)));
    }
    if (settings.rate_hz) {
      const std::int64_t frame_us = std::llround(1e6 / agreed.format.rate_hz);
      controls.set(lc::controls::FrameDurationLimits, {frame_us, frame_us});
    }
    return controls;
  }

  Completed outcome_of(lc::Request& request) const {
    Completed completed;
    completed.buffer = request.cookie();
    const lc::FrameBuffer* buffer = request.findBuffer(stream);
    if (request.status() != lc::Request::RequestComplete || !buffer) return completed;
    const lc::FrameMetadata& metadata = buffer->metadata();
    completed.fate = metadata.status == lc::FrameMetadata::FrameSuccess ? Completed::Fate::whole
                                                                        : Completed::Fate::damaged;
    completed.sequence = metadata.sequence;
    completed.timestamp_ns = static_cast<std::int64_t>(metadata.timestamp);
    if (const auto sensor_ns = request.metadata().get(lc::controls::SensorTimestamp))
      completed.timestamp_ns = *sensor_ns;
    if (const auto us = request.metadata().get(lc::controls::ExposureTime)) {
      completed.exposure_s = 1e-6 * *us;
      completed.gain = request.metadata().get(lc::controls::AnalogueGain).value_or(1.0f);
    }
    const MappedBuffer& memory = mapped[completed.buffer];
    memory.sync(DMA_BUF_SYNC_START);
    for (std::size_t i = 0; i < memory.planes().size() && i < metadata.planes().size(); ++i) {
      const std::size_t used = metadata.planes()[i].bytesused;
      completed.overfull = completed.overfull || used > memory.planes()[i].size();
      completed.planes.push_back(
          memory.planes()[i].first(std::min(used, memory.planes()[i].size())));
    }
    return completed;
  }

  const CameraSettings settings;
  const ManagerUse manager;
  std::shared_ptr<lc::Camera> camera;
  bool acquired = false;
  std::unique_ptr<lc::CameraConfiguration> configuration;
  lc::Stream* stream = nullptr;
  std::unique_ptr<lc::FrameBufferAllocator> allocator;
  std::vector<MappedBuffer> mapped;  // by buffer
  Agreed agreed;
  bool streaming = false;
  std::vector<std::unique_ptr<lc::Request>> requests;  // by buffer; while streaming
  std::shared_ptr<Mailbox> mailbox;
};

Device::Device(const CameraSettings& settings) : impl_(std::make_unique<Impl>(settings)) {}
Device::~Device() {
  stop();
}

const Agreed& Device::agreed() const {
  return impl_->agreed;
}
bool Device::streaming() const {
  return impl_->streaming;
}
bool Device::unplugged() const {
  return impl_->mailbox->unplugged();
}

void Device::start(const std::optional<Exposure>& exposure) {
  const auto& buffers = impl_->allocator->buffers(impl_->stream);
  for (std::size_t i = 0; i < buffers.size(); ++i) {
    auto request = impl_->camera->createRequest(i);
    if (!request || request->addBuffer(impl_->stream, buffers[i].get()) != 0) {
      impl_->requests.clear();
      impl_->refuse("accepts no requests");
    }
    impl_->requests.push_back(std::move(request));
  }
  const lc::ControlList controls = impl_->starting_controls(exposure);
  impl_->mailbox->open();
  const int error = impl_->camera->start(&controls);
  if (error < 0) impl_->requests.clear();
  impl_->check(error, "cannot start");
  impl_->streaming = true;
  for (const auto& request : impl_->requests)
    impl_->check(impl_->camera->queueRequest(request.get()), "a request cannot be queued");
}

void Device::stop() {
  if (!std::exchange(impl_->streaming, false)) return;
  impl_->camera->stop();  // gives every request back
  impl_->mailbox->close();
  impl_->requests.clear();
}

std::optional<Completed> Device::wait(std::chrono::milliseconds timeout) {
  lc::Request* request = impl_->mailbox->wait(timeout);
  return request ? std::optional(impl_->outcome_of(*request)) : std::nullopt;
}

Exposure Device::possible(const Exposure& wanted) const {
  Exposure made = wanted;
  const lc::ControlInfoMap& controls = impl_->camera->controls();
  if (const auto info = controls.find(lc::controls::ExposureTime.id()); info != controls.end()) {
    const double least = info->second.min().get<std::int32_t>();
    const double most = info->second.max().get<std::int32_t>();
    double us = std::clamp(1e6 * wanted.exposure_s, least, std::max(least, most));
    // UVC takes exposures in steps of 100 us (UVC 1.5, 4.2.2.1.4), rounded down, and does not say
    // which one a frame has.
    if (uvc_product(impl_->settings.device))
      us = std::max(100.0, 100 * std::floor(us / 100 + 1e-6));
    made.exposure_s = 1e-6 * std::round(us);
  }
  if (const auto info = controls.find(lc::controls::AnalogueGain.id()); info != controls.end()) {
    const double least = info->second.min().get<float>(), most = info->second.max().get<float>();
    made.gain = std::clamp(wanted.gain, least, std::max(least, most));
  }
  return made;
}

bool Device::queue(std::size_t buffer, const std::optional<Exposure>& exposure) {
  impl_->mapped[buffer].sync(DMA_BUF_SYNC_END);
  lc::Request& request = *impl_->requests[buffer];
  request.reuse(lc::Request::ReuseBuffers);
  if (exposure) impl_->write(request.controls(), *exposure);
  return impl_->camera->queueRequest(&request) == 0;
}

}  // namespace previz::libcam
