#include "drivers/aravis/receiver/device.hpp"

#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "drivers/aravis/receiver/guarded_sockets.hpp"
#include "drivers/aravis/receiver/packet_filter.hpp"
#include "drivers/host_clock.hpp"

namespace previz::aravis {
namespace {

// IPv4, host order; 0 for a camera that is on no network.
std::uint32_t address_of(ArvCamera& camera) {
  if (!arv_camera_is_gv_device(&camera)) return 0;
  GSocketAddress* address =
      arv_gv_device_get_device_address(ARV_GV_DEVICE(arv_camera_get_device(&camera)));
  GInetAddress* ip = g_inet_socket_address_get_address(G_INET_SOCKET_ADDRESS(address));
  const guint8* bytes = g_inet_address_to_bytes(ip);
  return std::uint32_t{bytes[0]} << 24 | std::uint32_t{bytes[1]} << 16 |
         std::uint32_t{bytes[2]} << 8 | std::uint32_t{bytes[3]};
}

Damage damage_of(ArvBufferStatus status) {
  switch (status) {
    case ARV_BUFFER_STATUS_SUCCESS:
      return Damage::none;
    case ARV_BUFFER_STATUS_MISSING_PACKETS:
      return Damage::packets_missing;
    case ARV_BUFFER_STATUS_TIMEOUT:
      return Damage::timed_out;
    case ARV_BUFFER_STATUS_SIZE_MISMATCH:
      return Damage::too_large;
    default:
      return Damage::given_up;
  }
}

std::uint32_t number_of(ArvBuffer& buffer) {
  return GPOINTER_TO_UINT(arv_buffer_get_user_data(&buffer));
}

}  // namespace

Device::Device(const CameraSettings& settings)
    : name_(settings.device),
      event_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      camera_(find_camera(settings.device)),
      agreed_(configure(*camera_, settings)),
      address_(address_of(*camera_)) {
  if (agreed_.chunks) chunks_.reset(arv_camera_create_chunk_parser(camera_.get()));
  if (address_ != 0) {
    control_socket_ = udp_socket(0);
    if (!is_filtered(control_socket_))
      throw Error(name_ + ": the socket that controls it is not filtered");
  }
  lost_handler_ = g_signal_connect(arv_camera_get_device(camera_.get()), "control-lost",
                                   G_CALLBACK(+[](ArvDevice*, gpointer self) {
                                     static_cast<Device*>(self)->lost_ = true;
                                     static_cast<Device*>(self)->wake();
                                   }),
                                   this);
}

Device::~Device() {
  stop();
  g_signal_handler_disconnect(arv_camera_get_device(camera_.get()), lost_handler_);
}

Terms Device::terms() const {
  Terms terms;
  terms.pfnc = agreed_.pfnc;
  terms.width = agreed_.width;
  terms.height = agreed_.height;
  terms.payload = agreed_.payload;
  terms.rate_hz = agreed_.rate_hz;
  terms.exposure_s = agreed_.exposure.exposure_s;
  terms.gain = agreed_.exposure.gain;
  terms.drives_exposure = agreed_.drives_exposure;
  terms.address = address_;
  return terms;
}

void Device::start(const Ring& ring, OwnedDescriptor memory) {
  if (stream_ || ring.buffers == 0 || ring.payload == 0)
    throw Error("cannot start: already started, or no buffers");
  memory_.emplace(ring, std::move(memory));
  Failure failure;
  if (address_ != 0) {
    const std::int64_t packet_size = arv_camera_gv_get_packet_size(camera_.get(), failure.out());
    failure.check(name_, "packet size");
    admit(stream_filter(address_, packet_size, agreed_.payload));
  }
  stream_.reset(arv_camera_create_stream(camera_.get(), &Device::on_stream, this, failure.out()));
  if (!stream_) throw Error(name_ + ": its stream cannot be opened: " + failure.text());
  try {
    begin_stream();
  } catch (const Error&) {
    stop();
    throw;
  }
}

void Device::begin_stream() {
  if (ARV_IS_GV_STREAM(stream_.get())) {
    check_stream();
    configure_gige_stream(*stream_, agreed_.payload);
  }
  filling_ = stream_.get();
  const Ring& ring = memory_->ring();
  lent_.assign(ring.buffers, nullptr);
  for (std::uint32_t i = 0; i < ring.buffers; ++i)
    arv_stream_push_buffer(
        stream_.get(), arv_buffer_new_full(static_cast<std::size_t>(ring.payload),
                                           memory_->at(i).data(), GUINT_TO_POINTER(i), nullptr));
  Failure failure;
  arv_camera_start_acquisition(camera_.get(), failure.out());
  failure.check(name_, "cannot start");
}

// Aravis believes what it receives, so nothing but what the camera can have sent comes to it.
void Device::check_stream() const {
  if (!is_filtered(udp_socket(arv_gv_stream_get_port(ARV_GV_STREAM(stream_.get())))))
    throw Error(name_ + ": the socket of its stream is not filtered");
}

// Destroys the stream with the buffers that it has, so that none of them can come again.
void Device::stop() {
  if (!stream_) return;
  Failure ignored;  // a camera that is gone cannot be stopped
  if (!lost_) arv_camera_stop_acquisition(camera_.get(), ignored.out());
  filling_ = nullptr;
  stream_.reset();
  const std::lock_guard lock(mutex_);
  for (const Filled& filled : filled_) g_object_unref(filled.buffer);
  filled_.clear();
  begun_ns_.clear();
  mismatches_ = 0;
  for (ArvBuffer* buffer : std::exchange(lent_, {}))
    if (buffer) g_object_unref(buffer);
  memory_.reset();
}

void Device::trigger() {
  Failure failure;
  arv_camera_software_trigger(camera_.get(), failure.out());
  if (failure.failed()) throw Error(failure.text());
}

ExposureWords Device::expose(const ExposureWords& wanted) {
  const Exposure applied = set_exposure(*camera_, name_, {wanted.exposure_s, wanted.gain});
  return {applied.exposure_s, applied.gain};
}

void Device::give_back(std::uint32_t buffer) {
  if (!stream_ || buffer >= lent_.size() || !lent_[buffer]) return;
  arv_stream_push_buffer(stream_.get(), std::exchange(lent_[buffer], nullptr));
}

void Device::wake() const {
  const std::uint64_t one = 1;
  if (write(event_.get(), &one, sizeof one) < 0) return;  // it is readable already
}

// On Aravis' thread, which closes buffers in the order in which it begins them. Its own stamps are
// of the wall clock, which may be set at any time.
void Device::on_stream(void* self_pointer, ArvStreamCallbackType type, ArvBuffer* buffer) {
  auto& self = *static_cast<Device*>(self_pointer);
  if (type == ARV_STREAM_CALLBACK_TYPE_START_BUFFER) self.begun_ns_.push_back(monotonic_ns());
  if (type != ARV_STREAM_CALLBACK_TYPE_BUFFER_DONE) return;
  std::int64_t arrival_ns = monotonic_ns();
  if (!self.begun_ns_.empty()) {
    arrival_ns = self.begun_ns_.front();
    self.begun_ns_.pop_front();
  }
  ArvStream* stream = self.filling_;
  if (!stream) return;
  const bool is_too_large = self.more_mismatches(*stream);
  while (ArvBuffer* done = arv_stream_try_pop_buffer(stream)) {
    const std::lock_guard lock(self.mutex_);
    self.filled_.push_back({done, done == buffer ? arrival_ns : monotonic_ns(), is_too_large});
  }
  self.wake();
}

// Returns whether packets that were too long for their picture came since the last call.
bool Device::more_mismatches(ArvStream& stream) {
  const std::uint64_t before = mismatches_;
  if (ARV_IS_GV_STREAM(&stream))
    mismatches_ = arv_stream_get_info_uint64_by_name(&stream, "n_size_mismatch_errors");
  return mismatches_ != before;
}

std::vector<FrameNote> Device::filled() {
  std::uint64_t ignored = 0;
  if (read(event_.get(), &ignored, sizeof ignored) < 0) return {};
  std::vector<Filled> filled;
  {
    const std::lock_guard lock(mutex_);
    filled.swap(filled_);
  }
  std::vector<FrameNote> notes;
  for (const Filled& one : filled) {
    notes.push_back(note_of(one));
    lent_[notes.back().buffer] = one.buffer;
  }
  return notes;
}

FrameNote Device::note_of(const Filled& filled) {
  ArvBuffer& buffer = *filled.buffer;
  FrameNote note;
  note.buffer = number_of(buffer);
  // The filter lets no packet through that lies behind the end of a picture as agreed, so that a
  // larger picture never becomes whole.
  const Damage damage = damage_of(arv_buffer_get_status(&buffer));
  note.damage = static_cast<std::uint8_t>(
      damage != Damage::none && filled.is_too_large ? Damage::too_large : damage);
  note.arrival_ns = filled.arrival_ns;
  if (note.damage != 0 || arv_buffer_get_n_parts(&buffer) < 1) return note;
  note.pfnc = arv_buffer_get_image_pixel_format(&buffer);
  note.width = arv_buffer_get_image_width(&buffer);
  note.height = arv_buffer_get_image_height(&buffer);
  std::size_t size = 0;
  const auto* picture = static_cast<const std::uint8_t*>(arv_buffer_get_image_data(&buffer, &size));
  int ignored = 0;
  arv_buffer_get_image_padding(&buffer, &note.row_padding, &ignored);
  note.size = picture ? size : 0;
  note.offset = picture ? static_cast<std::uint64_t>(picture - memory_->at(note.buffer).data()) : 0;
  note.id = arv_buffer_get_frame_id(&buffer);
  // Of a camera without a clock, Aravis gives the time of day, which may be set at any time.
  const std::uint64_t stamp = arv_buffer_get_timestamp(&buffer);
  note.device_ns = stamp == arv_buffer_get_system_timestamp(&buffer)
                       ? filled.arrival_ns
                       : static_cast<std::int64_t>(stamp);
  add_chunk_exposure(buffer, note);
  return note;
}

void Device::add_chunk_exposure(ArvBuffer& buffer, FrameNote& note) {
  if (!chunks_ || !arv_buffer_has_chunks(&buffer)) return;
  Failure failure;
  const double us =
      arv_chunk_parser_get_float_value(chunks_.get(), &buffer, "ChunkExposureTime", failure.out());
  if (failure.failed() || !(us > 0)) return;
  note.exposure_s = 1e-6 * us;
  const double gain_db =
      arv_chunk_parser_get_float_value(chunks_.get(), &buffer, "ChunkGain", failure.out());
  if (!failure.failed())
    note.exposure_gain = agreed_.gain_in_db ? std::pow(10.0, gain_db / 20.0) : 1.0;
}

Pulse Device::pulse() const {
  Pulse pulse;
  if (!stream_) return pulse;
  for (unsigned i = 0; i < arv_stream_get_n_infos(stream_.get()); ++i)
    if (arv_stream_get_info_type(stream_.get(), i) == G_TYPE_UINT64)
      pulse.counters.push_back({counter_name(arv_stream_get_info_name(stream_.get(), i)),
                                arv_stream_get_info_uint64(stream_.get(), i)});
  return pulse;
}

}  // namespace previz::aravis
