#include <algorithm>
#include <array>
#include <limits>
#include <set>
#include <utility>
#include <vector>

#include "daemon/exchange/damaged_packet.hpp"
#include "daemon/exchange/decoder_words.hpp"
#include "daemon/exchange/footage.hpp"
#include "daemon/exchange/video_picture.hpp"
#include "daemon/exchange/video_tags.hpp"
#include "drivers/av.hpp"

namespace previz::exchange {
namespace {

// What editors and cameras write. libav knows hundreds of further formats, among them play lists
// that name other files and addresses of networks, and decoders that nobody looks after.
constexpr const char* allowed_protocols = "file";
constexpr const char* allowed_formats =
    "mov,matroska,avi,mxf,mpegts,mpeg,ogg,nut,dv,gxf,asf,yuv4mpegpipe,dpx_pipe";
constexpr const char* allowed_codecs =
    "ffv1,prores,dnxhd,cfhd,dpx,h264,hevc,libdav1d,av1,vp8,vp9,mjpeg,png,jpeg2000,rawvideo,v210,v410,"
    "r210,"
    "dvvideo,mpeg1video,mpeg2video,mpeg4,theora,huffyuv,ffvhuff,utvideo,qtrle,wrapped_avframe";

// Options for opening a file or a decoder, with the limits of what is read.
class Limits {
 public:
  Limits() {
    av_dict_set(&options_, "protocol_whitelist", allowed_protocols, 0);
    av_dict_set(&options_, "format_whitelist", allowed_formats, 0);
    av_dict_set(&options_, "codec_whitelist", allowed_codecs, 0);
    av_dict_set_int(&options_, "max_pixels", static_cast<std::int64_t>(most_pixels), 0);
  }
  ~Limits() { av_dict_free(&options_); }
  Limits(const Limits&) = delete;
  Limits& operator=(const Limits&) = delete;
  AVDictionary** get() { return &options_; }

 private:
  AVDictionary* options_ = nullptr;
};

// While a file is opened, libav would print that it may not decode sound, and odd rates that are
// said otherwise.
class QuietLibav {
 public:
  QuietLibav() : level_(av_log_get_level()) { av_log_set_level(AV_LOG_QUIET); }
  ~QuietLibav() { av_log_set_level(level_); }
  QuietLibav(const QuietLibav&) = delete;
  QuietLibav& operator=(const QuietLibav&) = delete;

 private:
  const int level_;
};

// The frames of a video that are not in the take, by the time of their packets. libav gives frames
// in the order of their times, but takes packets in the order in which they are decoded.
class LostFrames {
 public:
  // A packet that cannot be decoded, or a frame that must not be shown.
  void add(std::int64_t pts) {
    if (pts == AV_NOPTS_VALUE)
      ++passed_;
    else
      waiting_.insert(pts);
  }
  bool contains(std::int64_t pts) const { return waiting_.contains(pts); }
  // Returns how many came before a frame of this time.
  std::uint64_t before(std::int64_t pts) {
    while (!waiting_.empty() && (pts == AV_NOPTS_VALUE || *waiting_.begin() < pts)) {
      waiting_.erase(waiting_.begin());
      ++passed_;
    }
    return passed_;
  }
  std::uint64_t all() const { return passed_ + waiting_.size(); }

 private:
  std::set<std::int64_t> waiting_;
  std::uint64_t passed_ = 0;
};

class VideoFile final : public Footage {
 public:
  VideoFile(const std::filesystem::path& file, const ReadAs& read_as)
      : file_(file), read_as_(read_as) {
    const QuietLibav quiet;
    AVFormatContext* context = nullptr;
    // "file:" keeps a name with a colon from being taken for another protocol.
    const std::string url = "file:" + std::filesystem::absolute(file).string();
    av::check(avformat_open_input(&context, url.c_str(), nullptr, Limits().get()), file,
              "cannot be read as a video");
    demuxer_.reset(context);
    demuxer_words_.emplace(context);
    probe(*context);
    const AVCodec* codec = nullptr;
    track_ = av::check(av_find_best_stream(context, AVMEDIA_TYPE_VIDEO, -1, -1, &codec, 0), file,
                       "has no decodable video");
    decoder_.reset(av::made(avcodec_alloc_context3(codec)));
    av::check(avcodec_parameters_to_context(decoder_.get(), stream().codecpar), file,
              "cannot be decoded");
    decoder_->pkt_timebase = stream().time_base;
    decoder_->thread_count = 0;  // 0: one thread per core
    const AVCodecDescriptor* kind = avcodec_descriptor_get(codec->id);
    all_are_key_frames_ = kind && kind->props & AV_CODEC_PROP_INTRA_ONLY;
    if (all_are_key_frames_) {
      decoder_->err_recognition = AV_EF_EXPLODE;
    } else {
      // Frames refer to others: several at once would hide which of them is damaged, and faults
      // that harm no picture, as at a cut, would end all.
      decoder_->thread_type = FF_THREAD_SLICE;
    }
    words_.emplace(decoder_.get());
    av::check(avcodec_open2(decoder_.get(), codec, Limits().get()), file, "cannot be decoded");
  }

  std::optional<Picture> next() override {
    while (decode()) {
      const std::int64_t pts = frame_->best_effort_timestamp;
      if (frame_->decode_error_flags || frame_->flags & AV_FRAME_FLAG_CORRUPT) lost_.add(pts);
      if (lost_.contains(pts)) continue;
      // What came before the first frame that can be decoded belongs to a part that was cut away.
      if (shown_ == 0) add_leading(pts);
      const std::uint64_t number = shown_ + lost_.before(pts);
      const std::string name = file_.string() + " frame " + std::to_string(number);
      if (!pictures_) pictures_.emplace(*frame_, stream(), *demuxer_, read_as_, file_);
      Picture picture = pictures_->picture(*frame_, name);
      picture.number = number;
      picture.container_ns = container_ns(pts);
      ++shown_;
      return picture;
    }
    if (shown_ == 0 && lost_.all() > 0)
      throw Error(file_.string() + ": none of its frames can be decoded: " + first_fault_);
    return std::nullopt;
  }

  std::uint64_t lost() const override { return lost_.all(); }

  // Containers have it as a track of its own, or as the video's or the file's own words.
  std::optional<std::string> timecode() const override {
    const auto of = [](const AVDictionary* words) {
      return av_dict_get(words, "timecode", nullptr, 0);
    };
    const AVDictionaryEntry* found = of(stream().metadata);
    if (!found) found = of(demuxer_->metadata);
    for (unsigned i = 0; !found && i < demuxer_->nb_streams; ++i)
      found = of(demuxer_->streams[i]->metadata);
    return found ? std::optional<std::string>(found->value) : std::nullopt;
  }

  std::vector<std::string> notes() const override {
    std::vector<std::string> notes = pictures_ ? pictures_->notes() : std::vector<std::string>{};
    if (const std::uint64_t count = lost_.all())
      notes.push_back(file_.string() + ": " + std::to_string(count) +
                      (count == 1 ? " frame is lost, which" : " frames are lost, which") +
                      " cannot be decoded without what is damaged or missing in the file" +
                      (first_fault_.empty() ? "" : " (" + first_fault_ + ")"));
    if (!end_fault_.empty()) notes.push_back(end_fault_);
    for (unsigned i = 0; i < demuxer_->nb_streams; ++i)
      if (demuxer_->streams[i]->codecpar->codec_type == AVMEDIA_TYPE_AUDIO) {
        notes.push_back(file_.string() + ": its sound is ignored");
        break;
      }
    return notes;
  }

 private:
  AVStream& stream() const { return *demuxer_->streams[track_]; }

  // Looks into the streams, with decoders that have the limits, too.
  void probe(AVFormatContext& context) {
    std::vector<Limits> limits(context.nb_streams);
    std::vector<AVDictionary*> options;
    for (Limits& of_stream : limits) options.push_back(*of_stream.get());
    const int result = avformat_find_stream_info(&context, options.data());
    for (std::size_t i = 0; i < limits.size(); ++i) *limits[i].get() = options[i];  // what is left
    av::check(result, file_, "cannot be read as a video");
    // A stream that was received, not saved, may lack parts: what the demuxer says of them is heard
    // as it is read again.
    if (context.iformat->flags & AVFMT_TS_DISCONT)
      avformat_seek_file(&context, -1, 0, 0, 0, AVSEEK_FLAG_BYTE);
    demuxer_words_->told_of_damage();
  }

  // Returns false after the last frame.
  bool decode() {
    for (;;) {
      const int got = avcodec_receive_frame(decoder_.get(), frame_.get());
      if (got == AVERROR_EOF) return false;
      heed_words();
      if (got == 0) return true;
      if (got != AVERROR(EAGAIN)) {
        lose(av::error_text(got));
        continue;
      }
      if (!read()) avcodec_send_packet(decoder_.get(), nullptr);
    }
  }

  // Gives the decoder the next packet; returns false after the last.
  bool read() {
    const int read = av_read_frame(demuxer_.get(), packet_.get());
    if (read == AVERROR(EIO)) av::check(read, file_, "cannot be read to its end");
    if (read < 0) {
      if (read != AVERROR_EOF)
        end_fault_ = file_.string() + ": is damaged after " + std::to_string(shown_) +
                     " frames; what follows cannot be read: " + av::error_text(read);
      return false;
    }
    // The demuxer says this of a piece of the stream: the end of this packet, or the next one.
    if (demuxer_words_->told_of_damage()) incomplete_ = 2;
    if (packet_->stream_index == track_) send();
    av_packet_unref(packet_.get());
    return true;
  }

  void send() {
    sent_pts_ = packet_->pts;
    if (all_are_key_frames_ || packet_->flags & AV_PKT_FLAG_KEY) {
      damaged_before_ = std::exchange(refers_to_damage_, false);
      key_pts_ = sent_pts_;
    }
    if (shown_ == 0 && !(packet_->flags & AV_PKT_FLAG_DISCARD) && sent_pts_ != AV_NOPTS_VALUE)
      leading_.push_back(sent_pts_);
    // A frame that refers to a damaged one decodes without a word, to a picture that is wrong; and
    // those before a key frame in time, but after it in the file, refer to what was before it.
    if (refers_to_damage_ || (damaged_before_ && sent_pts_ < key_pts_)) lost_.add(sent_pts_);
    if (incomplete_ > 0 || packet_->flags & AV_PKT_FLAG_CORRUPT)
      lose("a part of it is missing in the file");
    if (has_hole(*packet_, decoder_->codec_id)) lose("a piece of it is empty in the file");
    incomplete_ = std::max(0, incomplete_ - 1);
    if (const int sent = avcodec_send_packet(decoder_.get(), packet_.get()); sent < 0)
      lose(av::error_text(sent));
    heed_words();
  }

  // What the decoder said of the packet last sent.
  void heed_words() {
    if (words_->told_of_damage()) lose("it is damaged");
    if (!words_->told_of_missing()) return;
    // A key frame refers to no other: others before it are missing.
    if (sent_pts_ == key_pts_ && sent_pts_ != AV_NOPTS_VALUE)
      damaged_before_ = true;
    else
      lose("it is made of a frame that is not in the file");
  }

  // The packet last sent cannot be decoded.
  void lose(const std::string& why) {
    if (!lost_.contains(sent_pts_)) lost_.add(sent_pts_);
    if (first_fault_.empty()) first_fault_ = why;
    if (all_are_key_frames_) return;
    // A frame after a key frame in time does not refer to those before it.
    if (sent_pts_ < key_pts_)
      damaged_before_ = true;
    else
      refers_to_damage_ = true;
  }

  void add_leading(std::int64_t first) {
    if (first != AV_NOPTS_VALUE)
      for (const std::int64_t pts : leading_)
        if (pts < first) lost_.add(pts);
    first_pts_ = first;
    for (const std::int64_t pts : leading_) first_pts_ = std::min(first_pts_, pts);
    leading_.clear();
  }

  // Counts from the first frame, decoded or lost.
  std::optional<std::int64_t> container_ns(std::int64_t pts) const {
    std::int64_t since_first = 0;
    if (pts == AV_NOPTS_VALUE || __builtin_sub_overflow(pts, first_pts_, &since_first))
      return std::nullopt;
    const std::int64_t ns = av_rescale_q(since_first, stream().time_base, {1, 1'000'000'000});
    // libav returns its word for no time where the number is too large.
    return ns == AV_NOPTS_VALUE ? std::nullopt : std::optional(ns);
  }

  std::filesystem::path file_;
  ReadAs read_as_;
  av::Demuxer demuxer_;
  int track_ = 0;
  av::Codec decoder_;
  std::optional<DecoderWords> words_, demuxer_words_;
  av::Packet packet_{av::made(av_packet_alloc())};
  av::Picture frame_{av::made(av_frame_alloc())};
  bool all_are_key_frames_ = false;
  std::optional<VideoPictures> pictures_;
  std::uint64_t shown_ = 0;
  LostFrames lost_;
  int incomplete_ = 0;             // so many packets, from the next on, may lack a part
  bool refers_to_damage_ = false;  // frames until the next key frame
  bool damaged_before_ = false;    // frames before the last key frame
  std::int64_t sent_pts_ = AV_NOPTS_VALUE, key_pts_ = AV_NOPTS_VALUE, first_pts_ = 0;
  std::vector<std::int64_t> leading_;  // times of the packets before the first frame
  std::string first_fault_, end_fault_;
};

}  // namespace

std::unique_ptr<Footage> open_video(const std::filesystem::path& file, const ReadAs& read_as) {
  return std::make_unique<VideoFile>(file, read_as);
}

std::unique_ptr<Footage> open_video(const std::filesystem::path& file) {
  return open_video(file, ReadAs{});
}

}  // namespace previz::exchange
