// Owns libav's objects and puts its errors into words. A target that includes this header must link
// libav.
#pragma once

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libswscale/swscale.h>
}

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <new>
#include <span>
#include <string>

#include "drivers/error.hpp"

namespace previz::av {

struct Closer {
  void operator()(AVCodecContext* context) const { avcodec_free_context(&context); }
  void operator()(AVFrame* frame) const { av_frame_free(&frame); }
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
  void operator()(SwsContext* context) const { sws_freeContext(context); }
};
struct InputCloser {
  void operator()(AVFormatContext* context) const { avformat_close_input(&context); }
};
struct OutputCloser {
  void operator()(AVFormatContext* context) const {
    avio_closep(&context->pb);
    avformat_free_context(context);
  }
};

using Codec = std::unique_ptr<AVCodecContext, Closer>;
using Picture = std::unique_ptr<AVFrame, Closer>;
using Packet = std::unique_ptr<AVPacket, Closer>;
using Scaler = std::unique_ptr<SwsContext, Closer>;
using Demuxer = std::unique_ptr<AVFormatContext, InputCloser>;
using Muxer = std::unique_ptr<AVFormatContext, OutputCloser>;

// Passes on what libav has made; throws std::bad_alloc where there was no memory for it.
template <class Object>
Object* made(Object* object) {
  if (!object) throw std::bad_alloc();
  return object;
}

inline std::string error_text(int code) {
  std::array<char, AV_ERROR_MAX_STRING_SIZE> text{};
  av_strerror(code, text.data(), text.size());
  return text.data();
}

// Returns `code`, or throws previz::Error "<file>: <what>: <libav's reason>" if it is an error.
// libav also says that it has no memory where a file claims too much.
inline int check(int code, const std::filesystem::path& file, const std::string& what) {
  if (code < 0) throw Error(file.string() + ": " + what + ": " + error_text(code));
  return code;
}

// Returns the name by which libav opens a file. libav takes a plain name with a colon in its first
// part ("12:A/take/observer.mkv") for an address of some protocol.
inline std::string url_of(const std::filesystem::path& file) {
  return "file:" + file.string();
}

inline std::span<const std::uint8_t> bytes_of(const AVPacket& packet) {
  return {packet.data, static_cast<std::size_t>(packet.size)};
}

// Returns what a stream says of such a kind about all its frames; empty if nothing.
inline std::span<const std::uint8_t> side_data(const AVStream& stream, AVPacketSideDataType type) {
#if LIBAVCODEC_VERSION_INT >= AV_VERSION_INT(60, 31, 100)
  const AVPacketSideData* data = av_packet_side_data_get(stream.codecpar->coded_side_data,
                                                         stream.codecpar->nb_coded_side_data, type);
  if (!data) return {};
  return {data->data, data->size};
#else
  std::size_t size = 0;
  const std::uint8_t* data = av_stream_get_side_data(&stream, type, &size);
  return {data, size};
#endif
}

inline bool is_interlaced(const AVFrame& frame) {
#ifdef AV_FRAME_FLAG_INTERLACED
  return (frame.flags & AV_FRAME_FLAG_INTERLACED) != 0;
#else
  return frame.interlaced_frame != 0;
#endif
}

}  // namespace previz::av
