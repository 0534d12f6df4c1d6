#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "daemon/core/session/av.hpp"
#include "daemon/core/set/check.hpp"
#include "daemon/tools/exchange/damaged_packet.hpp"
#include "daemon/tools/exchange/decoder_words.hpp"
#include "daemon/tools/exchange/film_formats.hpp"
#include "daemon/tools/exchange/footage.hpp"
#include "daemon/tools/exchange/track_timecode.hpp"
#include "daemon/tools/exchange/video_packets.hpp"
#include "daemon/tools/exchange/video_picture.hpp"
#include "daemon/tools/exchange/video_tags.hpp"
#include "drivers/box/reading.hpp"

namespace previz::exchange {
namespace {

// What editors and cameras write. libav knows hundreds of further formats, among them play lists
// that name other files and addresses of networks, and decoders that nobody looks after.
constexpr const char* allowed_protocols = "file";
constexpr const char* allowed_formats =
    "mov,matroska,avi,mxf,mpegts,mpeg,ogg,nut,dv,gxf,asf,yuv4mpegpipe,h264,hevc,"
    "dpx_pipe";
constexpr const char* allowed_codecs =
    "ffv1,prores,dnxhd,cfhd,dpx,h264,hevc,libdav1d,av1,vp8,vp9,mjpeg,png,jpeg2000,rawvideo,v210,"
    "v410,"
    "r210,"
    "dvvideo,mpeg1video,mpeg2video,mpeg4,theora,huffyuv,ffvhuff,utvideo,qtrle,wrapped_avframe";

// So many joints of recordings are named, and the others counted.
constexpr std::size_t named_joints = 3;

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
  // Times begin again: all have passed.
  void begin_part() {
    passed_ += waiting_.size();
    waiting_.clear();
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
    open_decoder(*open_file());
  }

  std::optional<Picture> next() override {
    while (decode()) {
      const std::int64_t pts = frame_->best_effort_timestamp;
      if (frame_->decode_error_flags || frame_->flags & AV_FRAME_FLAG_CORRUPT) lost_.add(pts);
      if (lost_.contains(pts)) continue;
      // What came before the first frame that can be decoded belongs to a part that was cut away.
      if (!part_has_begun_) add_leading(pts);
      const std::uint64_t number = shown_ + lost_.before(pts);
      const std::string name = file_.string() + " frame " + std::to_string(number);
      if (!pictures_)
        pictures_.emplace(*frame_, stream(), *demuxer_, container_colors_, read_as_, file_);
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

  std::optional<FileTimecode> timecode() const override {
    const QuietLibav quiet;
    return track_timecode(*demuxer_, track_, file_begins_, url_);
  }

  std::vector<std::string> shape() const override {
    std::vector<std::string> shape = pictures_ ? pictures_->shape() : std::vector<std::string>{};
    if (!tracks_.empty()) shape.push_back(tracks_);
    return shape;
  }

  std::vector<std::string> notes() const override {
    std::vector<std::string> notes = pictures_ ? pictures_->notes() : std::vector<std::string>{};
    if (const std::uint64_t count = lost_.all())
      notes.push_back(file_.string() + ": " + std::to_string(count) +
                      (count == 1 ? " frame is lost, which" : " frames are lost, which") +
                      " cannot be decoded without what is damaged or missing in the file" +
                      (first_fault_.empty() ? "" : " (" + first_fault_ + ")"));
    if (!end_fault_.empty()) notes.push_back(end_fault_);
    if (!tracks_.empty()) notes.push_back(file_.string() + ": " + tracks_);
    if (!joints_.empty())
      notes.push_back(fmt::format(
          "{}: its times begin again at frame {}{}: recordings are joined; the times continue",
          file_.string(),
          fmt::join(std::span(joints_).first(std::min(named_joints, joints_.size())), ", "),
          joints_.size() > named_joints ? fmt::format(" and {} more", joints_.size() - named_joints)
                                        : ""));
    for (unsigned i = 0; i < demuxer_->nb_streams; ++i)
      if (demuxer_->streams[i]->codecpar->codec_type == AVMEDIA_TYPE_AUDIO) {
        notes.push_back(file_.string() + ": its sound is ignored");
        break;
      }
    return notes;
  }

 private:
  AVStream& stream() const { return *demuxer_->streams[track_]; }

  // Returns the decoder of the track.
  const AVCodec* open_file() {
    const AVCodec* codec = nullptr;
    AVFormatContext* context = nullptr;
    // "file:" keeps a name with a colon from being taken for another protocol.
    url_ = "file:" + std::filesystem::absolute(file_).string();
    const box::Reading reading(file_);
    const int opened = avformat_open_input(&context, url_.c_str(), nullptr, Limits().get());
    if (opened < 0) refuse_undecodable(nullptr);
    av::check(opened, file_, "cannot be read as a video");
    demuxer_.reset(context);
    demuxer_words_.emplace(context);
    std::vector<NamedColors> colors;
    for (unsigned i = 0; i < context->nb_streams; ++i)
      colors.push_back(named_colors(*context->streams[i]->codecpar));
    probe(*context);
    track_ = av_find_best_stream(context, AVMEDIA_TYPE_VIDEO, -1, -1, &codec, 0);
    if (track_ < 0) refuse_undecodable(context);
    av::check(track_, file_, "has no decodable video");
    tracks_ = words_of_tracks(*context, track_);
    if (static_cast<std::size_t>(track_) < colors.size())
      container_colors_ = colors[static_cast<std::size_t>(track_)];
    return codec;
  }

  void open_decoder(const AVCodec& codec) {
    decoder_.reset(av::made(avcodec_alloc_context3(&codec)));
    av::check(avcodec_parameters_to_context(decoder_.get(), stream().codecpar), file_,
              "cannot be decoded");
    decoder_->pkt_timebase = stream().time_base;
    decoder_->thread_count = 0;  // 0: one thread per core
    const AVCodecDescriptor* kind = avcodec_descriptor_get(codec.id);
    all_are_key_frames_ = kind && kind->props & AV_CODEC_PROP_INTRA_ONLY;
    const std::string_view container = demuxer_->iformat->name;
    is_bare_ = container == "h264" || container == "hevc";
    if (all_are_key_frames_ || is_bare_) decoder_->err_recognition = AV_EF_EXPLODE;
    if (!all_are_key_frames_) {
      // Frames refer to others: several at once would hide which of them is damaged, and faults
      // that harm no picture, as at a cut, would end all.
      decoder_->thread_type = FF_THREAD_SLICE;
    }
    words_.emplace(decoder_.get());
    packets_.emplace(*demuxer_, track_);
    const int opened_decoder = avcodec_open2(decoder_.get(), &codec, Limits().get());
    av::check(opened_decoder, file_, std::string("cannot be decoded as ") + codec.name);
  }

  // Throws where it is known what the file is, or how it is coded.
  void refuse_undecodable(const AVFormatContext* opened) const {
    if (const std::string words = undecodable_words(file_, opened); !words.empty())
      throw Error(file_.string() + ": " + words);
  }

  // Several tracks of pictures are said; a cover is none.
  static std::string words_of_tracks(const AVFormatContext& file, int used) {
    std::vector<std::string> sizes;
    std::size_t number = 0;
    for (unsigned i = 0; i < file.nb_streams; ++i) {
      const AVStream& stream = *file.streams[i];
      if (stream.codecpar->codec_type != AVMEDIA_TYPE_VIDEO ||
          stream.disposition & AV_DISPOSITION_ATTACHED_PIC)
        continue;
      sizes.push_back(fmt::format("{}x{}", stream.codecpar->width, stream.codecpar->height));
      if (static_cast<int>(i) == used) number = sizes.size();
    }
    if (sizes.size() < 2) return "";
    return fmt::format(
        "has {} video tracks, {}; number {} is used (for the first: ffmpeg -i IN -map 0:v:0 -c "
        "copy "
        "OUT)",
        sizes.size(), fmt::join(sizes, " and "), number);
  }

  // Looks into the streams, with decoders that have the limits, too.
  void probe(AVFormatContext& context) {
    std::vector<Limits> limits(context.nb_streams);
    std::vector<AVDictionary*> options;
    for (Limits& of_stream : limits) options.push_back(*of_stream.get());
    const int result = avformat_find_stream_info(&context, options.data());
    for (std::size_t i = 0; i < limits.size(); ++i) *limits[i].get() = options[i];  // what is left
    av::check(result, file_, "cannot be read as a video");
    // A stream that was received, not saved, may lack parts: the demuxer marks them as it is read
    // again.
    if (context.iformat->flags & AVFMT_TS_DISCONT)
      avformat_seek_file(&context, -1, 0, 0, 0, AVSEEK_FLAG_BYTE);
  }

  // Returns false after the last frame.
  bool decode() {
    for (;;) {
      const box::Reading reading(file_);
      const int got = avcodec_receive_frame(decoder_.get(), frame_.get());
      if (got == AVERROR_EOF) {
        if (!next_part_) return false;
        begin_part();
        continue;
      }
      heed_words();
      if (got == 0) return true;
      if (got != AVERROR(EAGAIN)) {
        lose(av::error_text(got));
        continue;
      }
      std::optional<VideoPackets::Unit> unit = packets_->next();
      if (!unit) note_end();
      if (unit && !unit->begins_part) {
        send(*unit);
      } else {
        next_part_ = std::move(unit);
        avcodec_send_packet(decoder_.get(), nullptr);
      }
    }
  }

  void note_end() {
    const int error = packets_->error();
    if (error == AVERROR(EIO)) av::check(error, file_, "cannot be read to its end");
    if (error < 0)
      end_fault_ = file_.string() + ": is damaged after " +
                   set::plural(std::uint64_t(shown_), "frame") +
                   "; what follows cannot be read: " + av::error_text(error);
  }

  // All frames of the part before are decoded; no frame of the next one refers to them.
  void begin_part() {
    avcodec_flush_buffers(decoder_.get());
    lost_.begin_part();
    joints_.push_back(shown_ + lost_.all());
    std::int64_t end = 0;
    if (part_has_begun_ && !__builtin_add_overflow(last_pts_, frame_duration_, &end))
      part_ns_ = container_ns(end).value_or(part_ns_);
    refers_to_damage_ = damaged_before_ = part_has_begun_ = false;
    sent_pts_ = key_pts_ = last_pts_ = AV_NOPTS_VALUE;
    leading_.clear();
    const VideoPackets::Unit first = *std::exchange(next_part_, std::nullopt);
    send(first);
  }

  void send(const VideoPackets::Unit& unit) {
    const AVPacket& packet = *unit.packet;
    sent_pts_ = packet.pts;
    if (all_are_key_frames_ || packet.flags & AV_PKT_FLAG_KEY) {
      damaged_before_ = std::exchange(refers_to_damage_, false);
      key_pts_ = sent_pts_;
    }
    last_pts_ = std::max(last_pts_, sent_pts_);  // AV_NOPTS_VALUE is less than all
    if (packet.duration > 0) frame_duration_ = packet.duration;
    if (!part_has_begun_ && !(packet.flags & AV_PKT_FLAG_DISCARD) && sent_pts_ != AV_NOPTS_VALUE)
      leading_.push_back(sent_pts_);
    // A frame that refers to a damaged one decodes without a word, to a picture that is wrong; and
    // those before a key frame in time, but after it in the file, refer to what was before it.
    if (refers_to_damage_ || (damaged_before_ && sent_pts_ < key_pts_)) lost_.add(sent_pts_);
    if (unit.incomplete) lose("a part of it is missing in the file");
    if (has_hole(packet, decoder_->codec_id)) lose("a piece of it is empty in the file");
    if (const int sent = avcodec_send_packet(decoder_.get(), &packet); sent < 0)
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
    if (is_bare_)
      throw Error(fmt::format(
          "{}: is a stream without times, and is damaged after {} frames ({}): which frames are "
          "lost is unknown; put it into a container that has times, such as .mkv or .mp4",
          file_.string(), shown_, why));
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
    part_has_begun_ = true;
    if (joints_.empty()) file_begins_ = first_pts_;
  }

  // Counts from the first frame, decoded or lost.
  std::optional<std::int64_t> container_ns(std::int64_t pts) const {
    std::int64_t since_first = 0;
    if (pts == AV_NOPTS_VALUE || __builtin_sub_overflow(pts, first_pts_, &since_first))
      return std::nullopt;
    const std::int64_t ns = av_rescale_q(since_first, stream().time_base, {1, 1'000'000'000});
    // libav returns its word for no time where the number is too large.
    std::int64_t since_start = 0;
    if (ns == AV_NOPTS_VALUE || __builtin_add_overflow(part_ns_, ns, &since_start))
      return std::nullopt;
    return since_start;
  }

  std::filesystem::path file_;
  std::string url_;
  ReadAs read_as_;
  NamedColors container_colors_;
  av::Demuxer demuxer_;
  int track_ = 0;
  av::Codec decoder_;
  std::optional<DecoderWords> words_, demuxer_words_;  // the demuxer's are only not printed
  std::optional<VideoPackets> packets_;
  av::Picture frame_{av::made(av_frame_alloc())};
  bool all_are_key_frames_ = false;
  bool is_bare_ = false;  // a stream without a container, and so without times
  std::optional<VideoPictures> pictures_;
  std::uint64_t shown_ = 0;
  LostFrames lost_;
  bool refers_to_damage_ = false;  // frames until the next key frame
  bool damaged_before_ = false;    // frames before the last key frame
  // Times of this part: most files have only one.
  std::int64_t sent_pts_ = AV_NOPTS_VALUE, key_pts_ = AV_NOPTS_VALUE, last_pts_ = AV_NOPTS_VALUE;
  std::int64_t first_pts_ = 0, frame_duration_ = 0;
  std::int64_t file_begins_ = 0;       // first_pts_ of the first part
  std::vector<std::int64_t> leading_;  // of the packets before the first frame
  bool part_has_begun_ = false;        // a frame has been shown
  std::optional<VideoPackets::Unit> next_part_;
  std::int64_t part_ns_ = 0;           // from the first part's first frame
  std::vector<std::uint64_t> joints_;  // numbers of the first frames of further parts
  std::string first_fault_, end_fault_, tracks_;
};

}  // namespace

std::unique_ptr<Footage> open_video(const std::filesystem::path& file, const ReadAs& read_as) {
  return std::make_unique<VideoFile>(file, read_as);
}

std::unique_ptr<Footage> open_video(const std::filesystem::path& file) {
  return open_video(file, ReadAs{});
}

}  // namespace previz::exchange
