// What a take from elsewhere consists of.
#include "daemon/core/session/json_lines.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/core/session/session_toml.hpp"
#include "daemon/core/session/video_reader.hpp"
#include "drivers/error.hpp"
#include "tests/fuzz/mutators.hpp"
#include "tests/fuzz/targets.hpp"

namespace previz::fuzz {
namespace session_targets_cpp {

void session_toml(Bytes bytes) {
  const session::SessionFile file = session::parse_session_toml(text_of(bytes), "session.toml");
  const std::string again = session::to_toml(file);
  try {
    session::parse_session_toml(again, "again.toml");
  } catch (const Error& error) {
    expect(false, error.what());
  }
}

template <typename Record>
void read_lines(session::Lines<Record> (*read)(const std::filesystem::path&), Bytes bytes) {
  const session::Lines<Record> lines = read(file_of(bytes, "lines.jsonl"));
  std::string again;
  for (const Record& record : lines.records) again += session::to_line(record) + '\n';
  const std::string text = again;
  const session::Lines<Record> back =
      read(file_of({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, "again"));
  expect(back.bad_lines.empty() && back.records.size() == lines.records.size(),
         "what was read is written so that it can be read");
}

void frame_lines(Bytes bytes) {
  read_lines<session::FrameLine>(session::read_frame_lines, bytes);
}
void track_lines(Bytes bytes) {
  read_lines<session::TrackRecord>(session::read_track_lines, bytes);
}
void mark_lines(Bytes bytes) {
  read_lines<session::MarkEvent>(session::read_mark_lines, bytes);
}
void button_lines(Bytes bytes) {
  read_lines<ButtonEvent>(session::read_button_lines, bytes);
}

void matroska(Bytes bytes) {
  session::StreamFormat format;
  format.width = 24;
  format.height = 18;
  session::VideoReader video(file_of(bytes, "observer.mkv"), format);
  std::size_t left = 8;
  for (const session::VideoReader::PacketInfo& packet : video.scan()) {
    if (left-- == 0) return;
    try {
      expect(video.read(packet).size() == frame_bytes(format.format, format.width, format.height),
             "a picture is as long as its format and size say");
    } catch (const Error&) {  // this picture is damaged; the next may be whole
    }
  }
}

constexpr Target own[] = {
    {"session_toml", "session.toml of a take", session_toml, mutate_toml},
    {"frame_lines", "observer.jsonl or light.jsonl", frame_lines, mutate_json_lines},
    {"track_lines", "track.jsonl", track_lines, mutate_json_lines},
    {"mark_lines", "the marks in events.jsonl", mark_lines, mutate_json_lines},
    {"button_lines", "events.jsonl", button_lines, mutate_json_lines},
    {"matroska", "observer.mkv, of 24x18 pixels", matroska, mutate_matroska},
};

}  // namespace session_targets_cpp

std::span<const Target> session_targets() {
  return session_targets_cpp::own;
}

}  // namespace previz::fuzz
