#include "daemon/tools/exchange/track_timecode.hpp"

#include <span>
#include <string_view>

#include "drivers/box/reading.hpp"

namespace previz::exchange {
namespace {

const char* timecode_in(const AVDictionary* words) {
  const AVDictionaryEntry* found = av_dict_get(words, "timecode", nullptr, 0);
  return found ? found->value : nullptr;
}

std::span<AVStream* const> streams_of(const AVFormatContext& file) {
  return {file.streams, file.nb_streams};
}

bool is_timecode_track(const AVStream& stream) {
  return stream.codecpar->codec_tag == MKTAG('t', 'm', 'c', 'd');
}

// The count of frames in a sample of the track: 32 bits, the most significant ones first.
std::int64_t count_at(AVFormatContext& file, const AVIndexEntry& sample) {
  return avio_seek(file.pb, sample.pos, SEEK_SET) < 0 ? 0 : avio_rb32(file.pb);
}

// libav applies the edit list of the video, and drops that of the timecode. Without its own edits
// ("advanced_editlist") it gives the times at which samples would be shown.
void add_edit(AVFormatContext& unedited, int video_track, std::int64_t shown,
              FileTimecode& timecode) {
  AVStream* const video = unedited.streams[video_track];
  const AVIndexEntry* const first_picture = avformat_index_get_entry(video, 0);
  // A video without edits begins with its first picture, which B-frames may delay.
  if (!first_picture || first_picture->timestamp == 0) shown = 0;
  const char* const of_video = timecode_in(video->metadata);
  for (AVStream* const track : streams_of(unedited)) {
    const char* const words = timecode_in(track->metadata);
    const AVIndexEntry* const first = avformat_index_get_entry(track, 0);
    if (!is_timecode_track(*track) || !first || !words) continue;
    // With several, libav has copied the words of the one that the video refers to.
    if (of_video && std::string_view(words) != of_video) continue;
    const std::int64_t time = av_rescale_q(shown, video->time_base, track->time_base);
    const AVIndexEntry* sample = first;
    for (int i = 1; i < avformat_index_get_entries_count(track); ++i)
      if (const AVIndexEntry* next = avformat_index_get_entry(track, i); next->timestamp <= time)
        sample = next;
    timecode.first = words;
    // The first sample's words, and the other's count.
    if (sample != first) timecode.frames = count_at(unedited, *sample) - count_at(unedited, *first);
    timecode.seconds = (static_cast<double>(time) - static_cast<double>(sample->timestamp)) *
                       av_q2d(track->time_base);
    return;
  }
}

}  // namespace

std::optional<FileTimecode> track_timecode(const AVFormatContext& file, int video_track,
                                           std::int64_t shown, const std::string& url) {
  const char* found = timecode_in(file.streams[video_track]->metadata);
  if (!found) found = timecode_in(file.metadata);
  bool has_track = false;
  for (const AVStream* stream : streams_of(file)) {
    has_track = has_track || is_timecode_track(*stream);
    if (!found) found = timecode_in(stream->metadata);
  }
  if (!found) return std::nullopt;
  FileTimecode timecode{found};
  if (!has_track || shown == AV_NOPTS_VALUE) return timecode;
  AVDictionary* options = nullptr;
  av_dict_set(&options, "advanced_editlist", "0", 0);
  av_dict_set(&options, "protocol_whitelist", "file", 0);
  AVFormatContext* again = nullptr;
  const box::Reading reading(url);
  const int opened = avformat_open_input(&again, url.c_str(), file.iformat, &options);
  av_dict_free(&options);
  const av::Demuxer unedited(again);
  if (opened >= 0 && unedited->nb_streams == file.nb_streams)
    add_edit(*unedited, video_track, shown, timecode);
  return timecode;
}

}  // namespace previz::exchange
