// Whole imports of videos: what FRAMES.json says of them, their containers, packets, tags and
// colours, and the session that is made of them. The decoders are libav's own.
extern "C" {
#include <libavutil/mem.h>
}

#include <array>
#include <fstream>
#include <iterator>
#include <limits>

#include "daemon/core/session/session.hpp"
#include "daemon/tools/exchange/import.hpp"
#include "drivers/error.hpp"
#include "tests/fuzz/mutators.hpp"
#include "tests/fuzz/targets.hpp"

namespace previz::fuzz {
namespace video_targets_cpp {

namespace fs = std::filesystem;

// Videos of this many frames are kept in the corpus; the descriptions below list no more.
constexpr char video_mark = 'v';
constexpr std::size_t video_head = 2;  // the mark, and which description it is read by
constexpr std::array<std::string_view, 4> descriptions = {
    R"({"observer": {"video": "video", "exposure": [1, 1, 1, 1]}})",
    R"({"observer": {"video": "video", "fps": 25, "exposure_s": [0.01, 0.01, 0.02, 0.02],
 "read_as": {"range": "full", "matrix": "bt2020", "transfer": "hlg", "primaries": "bt2020",
  "rotation_deg": 270, "pixel_aspect": [4, 3]}}})",
    R"({"observer": {"video": "video", "timestamps_ns": [0, 1, 2, 9], "exposure": 1,
 "read_as": {"range": "limited", "matrix": "bt601", "transfer": "as recorded"}}})",
    R"({"observer": {"video": "video", "start_ns": 5, "exposure": [1, 1, 1, 1]},
 "light": {"video": "video", "fps": 50, "exposure": [1, 1, 1, 1]},
 "track": [{"frame": 3, "world_from_camera": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}]})",
};

// libav's memory for one thing, as a plane of a picture. Larger pictures are read as well, but
// slowly.
class MemoryOfLibav {
 public:
  MemoryOfLibav() { av_max_alloc(std::size_t{1} << 22); }
  ~MemoryOfLibav() { av_max_alloc(std::numeric_limits<int>::max()); }
  MemoryOfLibav(const MemoryOfLibav&) = delete;
  MemoryOfLibav& operator=(const MemoryOfLibav&) = delete;
};

Bytes bytes_of(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

// What a description may name: two videos of the corpus, and a table for them.
void make_footage() {
  static const bool is_made = [] {
    for (const auto& [kept, name] : {std::pair{"h264", "a.mp4"}, std::pair{"mjpeg", "b.mov"}}) {
      std::ifstream file(fs::path(PREVIZ_SOURCE_DIR) / "tests/fuzz/corpus/import_video" / kept,
                         std::ios::binary);
      const std::string content(std::istreambuf_iterator<char>(file), {});
      expect(content.size() > video_head, "the corpus has the videos that descriptions name");
      file_of(bytes_of(content).subspan(video_head), name);
    }
    file_of(bytes_of("timestamp_ns,exposure_s,gain\n1,0.01,1\n2,0.01,1\n3,0.02,2\n9,0.02,2\n"),
            "times.csv");
    return true;
  }();
  static_cast<void>(is_made);
}

void check_stream(session::Session& made, const char* source, std::uint64_t frames) {
  const auto stream = session::open_stream(made, source);
  expect(stream && stream->records().size() == frames, "the session has the frames reported");
  std::int64_t before = -1;
  for (const session::FrameRecord& record : stream->records()) {
    expect(record.timestamp_ns > before, "times are not negative, and increase");
    before = record.timestamp_ns;
  }
}

void check_session(const fs::path& take, const exchange::ImportReport& report) {
  try {
    session::Session made = session::open_session(take);
    check_stream(made, "observer", report.observer_frames);
    if (report.light_frames > 0) check_stream(made, "light", report.light_frames);
    expect(made.missing.empty(), "nothing of an imported session is missing");
    std::uint64_t poses = 0;
    for (const session::TrackRecord& record : made.track) poses += record.tracked;
    expect(poses == report.poses, "the session has the poses reported");
  } catch (const Error& error) {
    expect(false, error.what());
  }
}

void import_video(Bytes bytes) {
  const MemoryOfLibav limit;
  make_footage();
  fs::path description;
  if (bytes.size() >= video_head && bytes[0] == video_mark) {
    file_of(bytes.subspan(video_head), "video");
    description = file_of(bytes_of(descriptions[bytes[1] % descriptions.size()]), "video.json");
  } else {
    description = file_of(bytes, "video.json");
  }
  const fs::path take = work_folder() / "take";
  fs::remove_all(take);
  check_session(take, exchange::import_session({description, take}));
}

constexpr Target own[] = {
    {"import_video", "FRAMES.json that names videos; or, after a v and a digit, a video",
     import_video, mutate_import_video},
};

}  // namespace video_targets_cpp

std::span<const Target> video_targets() {
  return video_targets_cpp::own;
}

}  // namespace previz::fuzz
