#include "daemon/tools/exchange/film_formats.hpp"

#include <algorithm>
#include <array>
#include <span>
#include <string_view>

#include "daemon/core/session/files.hpp"
#include "daemon/core/set/problems.hpp"
#include "daemon/tools/exchange/picture_header.hpp"

namespace previz::exchange {
namespace {

struct RawFilm {
  const char* name;
  // First bytes of codec tags, or of the file after its first four, and ends of names.
  std::array<std::string_view, 3> marks, endings;
};
constexpr std::array<RawFilm, 7> raw_film = {{
    {"Blackmagic RAW", {"brxq", "brst", "brhq"}, {".braw"}},
    {"Blackmagic RAW", {"brvn", "brs2"}, {}},
    {"ProRes RAW", {"aprn", "aprh"}, {}},
    {"Canon Cinema RAW", {"CRAW"}, {".crm", ".rmf"}},
    {"REDCODE RAW", {"RED1", "RED2"}, {".r3d"}},
    {"ARRIRAW", {}, {".ari", ".arx"}},
    {"Nikon N-RAW", {}, {".nev"}},
}};

constexpr auto video_endings = std::to_array<std::string_view>(
    {".mp4", ".mov",  ".mkv",  ".avi",  ".webm", ".m4v", ".mxf", ".mts",  ".m2ts",
     ".m2t", ".ts",   ".mpg",  ".mpeg", ".vob",  ".m2v", ".3gp", ".3g2",  ".qt",
     ".wmv", ".asf",  ".ogv",  ".ogg",  ".nut",  ".dv",  ".gxf", ".y4m",  ".h264",
     ".264", ".hevc", ".h265", ".265",  ".insv", ".360", ".lrv", ".divx", ".f4v"});

template <std::size_t count>
bool has(const std::array<std::string_view, count>& texts, std::string_view text) {
  return !text.empty() && std::ranges::find(texts, text) != texts.end();
}

const char* raw_film_of(std::string_view mark, std::string_view ending) {
  const auto found = std::ranges::find_if(raw_film, [&](const RawFilm& film) {
    return has(film.marks, mark) || has(film.endings, ending);
  });
  return found == raw_film.end() ? nullptr : found->name;
}

std::string mark_of(std::uint32_t tag) {
  std::string mark;
  for (int i = 0; i < 4; ++i) mark += static_cast<char>(tag >> 8 * i & 255);
  return mark;
}

// The four bytes after the first four, where boxes have their names.
std::string first_mark(const std::filesystem::path& file) {
  std::string bytes = session::read_beginning(file, 8);
  bytes.resize(8);
  return bytes.substr(4);
}

std::string words_of_raw_film(const char* name) {
  return std::string("is ") + name +
         ", which only its maker's programs and some editors read: export ProRes 4444 or DNxHR "
         "from them, or import the camera's proxy";
}

}  // namespace

bool is_video_name(const std::filesystem::path& file) {
  const std::string ending = ending_of(file);
  return has(video_endings, ending) || raw_film_of("", ending);
}

std::string undecodable_words(const std::filesystem::path& file, const AVFormatContext* opened) {
  if (const char* name = raw_film_of(first_mark(file), ending_of(file)))
    return words_of_raw_film(name);
  if (!opened) return "";
  for (const AVStream* stream : std::span(opened->streams, opened->nb_streams)) {
    const AVCodecParameters& track = *stream->codecpar;
    const std::string mark = mark_of(track.codec_tag);
    if (const char* name = raw_film_of(mark, "")) return words_of_raw_film(name);
    if (track.codec_type != AVMEDIA_TYPE_VIDEO) continue;
    if (mark == "encv" || mark == "drmi")
      return "is encrypted: import a copy that is not protected";
    const bool known = track.codec_id != AV_CODEC_ID_NONE;
    return std::string("is coded ") +
           (known                  ? std::string("as ") + avcodec_get_name(track.codec_id)
            : track.codec_tag != 0 ? "as \"" + set::printable(mark) + '"'
                                   : "in an unknown way, as ARRIRAW and Sony X-OCN in MXF are") +
           ", which previzd does not decode: export ProRes, DNxHR or H.264 from an editor";
  }
  return "";
}

}  // namespace previz::exchange
