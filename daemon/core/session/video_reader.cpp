#include "daemon/core/session/video_reader.hpp"

#include <unistd.h>

#include <map>
#include <optional>
#include <utility>

#include "daemon/core/session/av.hpp"
#include "daemon/core/session/crc32.hpp"
#include "daemon/core/session/ffv1.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/session/samples.hpp"
#include "drivers/box/reading.hpp"

namespace previz::session {
namespace {

av::Demuxer open_demuxer(const std::filesystem::path& file) {
  const box::Reading reading(file);
  AVFormatContext* context = nullptr;
  const AVInputFormat* matroska = av_find_input_format("matroska");
  const OpenFile plain = open_plain_file(file);  // which libav opens once more, by its descriptor
  const std::filesystem::path same = "/proc/self/fd/" + std::to_string(plain.get());
  av::check(avformat_open_input(&context, av::url_of(same).c_str(), matroska, nullptr), file,
            "cannot be read as Matroska");
  // Packets are read as they are in the file: without a parser, and without invented times.
  context->flags |= AVFMT_FLAG_NOPARSE | AVFMT_FLAG_NOFILLIN;
  return av::Demuxer(context);
}

int find_track(const AVFormatContext& demuxer, VideoCodec codec,
               const std::filesystem::path& file) {
  const bool is_raw = codec == VideoCodec::raw;
  for (unsigned int i = 0; i < demuxer.nb_streams; ++i)
    if (demuxer.streams[i]->codecpar->codec_id ==
        (is_raw ? AV_CODEC_ID_RAWVIDEO : AV_CODEC_ID_FFV1))
      return static_cast<int>(i);
  throw Error(file.string() + ": holds no " + (is_raw ? "raw" : "FFV1") + " track");
}

}  // namespace

struct VideoReader::Impl {
  using Key = std::pair<std::int64_t, std::uint32_t>;  // time and CRC-32 of a packet
  std::filesystem::path file;
  StreamFormat format;
  av::Demuxer demuxer;  // null where the places of the packets are known
  int track = -1;
  std::map<Key, PacketPlace> places;  // of the packets, if there is no demuxer
  std::optional<OpenFile> opened;     // likewise
  av::Codec decoder;
  av::Packet packet{av::made(av_packet_alloc())};
  av::Picture picture{av::made(av_frame_alloc())};

  Impl(const std::filesystem::path& path, const StreamFormat& stream_format)
      : file(path),
        format(stream_format),
        demuxer(open_demuxer(file)),
        track(find_track(*demuxer, format.codec, file)),
        decoder(is_raw() ? nullptr : open_ffv1_decoder(header(), file)) {
    if (header().width != format.width || header().height != format.height)
      throw Error(file.string() + ": its video header says " + std::to_string(header().width) +
                  "x" + std::to_string(header().height) + ", session.toml " +
                  std::to_string(format.width) + "x" + std::to_string(format.height));
  }

  Impl(const std::filesystem::path& path, const StreamFormat& stream_format,
       const std::vector<PacketPlace>& packets)
      : file(path),
        format(stream_format),
        opened(open_plain_file(file)),
        decoder(is_raw() ? nullptr : open_ffv1_decoder(format, file)) {
    for (const PacketPlace& place : packets) places[{place.video_ms, place.crc32}] = place;
  }

  bool is_raw() const { return format.codec == VideoCodec::raw; }
  const AVCodecParameters& header() const { return *demuxer->streams[track]->codecpar; }

  void rewind() { demuxer = open_demuxer(file); }

  // Returns false at the end of what can be read.
  bool next_packet() {
    const box::Reading reading(file);
    do {
      av_packet_unref(packet.get());
      if (av_read_frame(demuxer.get(), packet.get()) < 0) return false;
    } while (packet->stream_index != track || time_ms() == AV_NOPTS_VALUE);
    return true;
  }

  // libav writes FFV1 as V_MS/VFW/FOURCC, whose block times it reads back as decoding times.
  std::int64_t time_ms() const { return packet->pts != AV_NOPTS_VALUE ? packet->pts : packet->dts; }

  bool holds(const PacketInfo& wanted) const {
    return time_ms() == wanted.video_ms && crc32(av::bytes_of(*packet)) == wanted.crc32;
  }

  // Searches forward for the packet; a file's times increase, unless they are damaged.
  bool find_forward(const PacketInfo& wanted) {
    while (next_packet())
      if (holds(wanted)) return true;
    return false;
  }

  // Reads a packet whose place is known; it may have been changed since it was found.
  bool read_place(const PacketInfo& wanted) {
    const auto found = places.find({wanted.video_ms, wanted.crc32});
    if (found == places.end()) return false;
    const auto& [key, place] = *found;
    av_packet_unref(packet.get());
    av::check(av_new_packet(packet.get(), static_cast<int>(place.bytes)), file, "no memory");
    return read_at(*opened, place.offset, {packet->data, place.bytes}) &&
           crc32(av::bytes_of(*packet)) == wanted.crc32;
  }

  bool find(const PacketInfo& wanted) {
    if (!demuxer) return read_place(wanted);
    if (next_packet() && holds(wanted)) return true;
    if (av_seek_frame(demuxer.get(), track, wanted.video_ms, AVSEEK_FLAG_BACKWARD) >= 0 &&
        find_forward(wanted))
      return true;
    rewind();
    return find_forward(wanted);
  }

  std::string failure(const PacketInfo& wanted, const std::string& why) const {
    return file.string() + ": the picture at " + std::to_string(wanted.video_ms) + " ms " + why;
  }
};

VideoReader::VideoReader(const std::filesystem::path& file, const StreamFormat& format)
    : impl_(std::make_unique<Impl>(file, format)) {}

VideoReader::VideoReader(const std::filesystem::path& file, const StreamFormat& format,
                         const std::vector<PacketPlace>& packets)
    : impl_(std::make_unique<Impl>(file, format, packets)) {}

VideoReader::~VideoReader() = default;

std::vector<VideoReader::PacketInfo> VideoReader::scan(const std::stop_token& stop) {
  std::vector<PacketInfo> packets;
  for (const auto& [key, place] : impl_->places) packets.push_back({key.first, key.second});
  if (!impl_->demuxer) return packets;
  while (impl_->next_packet()) {
    if (stop.stop_requested()) throw Error(impl_->file.string() + ": reading interrupted");
    packets.push_back({impl_->time_ms(), crc32(av::bytes_of(*impl_->packet))});
  }
  impl_->rewind();
  return packets;
}

std::vector<std::uint8_t> VideoReader::read(const PacketInfo& wanted) {
  Impl& s = *impl_;
  const box::Reading reading(s.file);
  if (!s.find(wanted)) throw Error(s.failure(wanted, "is no longer in the file"));
  if (s.is_raw()) {
    if (static_cast<std::size_t>(s.packet->size) !=
        frame_bytes(s.format.format, s.format.width, s.format.height))
      throw Error(s.failure(wanted, "does not have the format and size in session.toml"));
    return {s.packet->data, s.packet->data + s.packet->size};
  }
  int code = avcodec_send_packet(s.decoder.get(), s.packet.get());
  if (code >= 0) code = avcodec_receive_frame(s.decoder.get(), s.picture.get());
  if (code < 0) {
    avcodec_flush_buffers(s.decoder.get());
    throw Error(s.failure(wanted, "cannot be decoded: " + av::error_text(code)));
  }
  const auto format = session_format(AVPixelFormat(s.picture->format));
  if (format != s.format.format || s.picture->width != s.format.width ||
      s.picture->height != s.format.height)
    throw Error(s.failure(wanted, "does not have the format and size in session.toml"));
  return unpack(*s.picture);
}

}  // namespace previz::session
