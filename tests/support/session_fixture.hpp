// What the session, replay and import tests share: files as text, frames of noise.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "daemon/core/session/session.hpp"
#include "drivers/frame.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/temporary_directory.hpp"

namespace previz::session {

using test::content_of;
using test::TemporaryDirectory;

inline void write_content(const std::filesystem::path& file, const std::string& content) {
  std::filesystem::create_directories(file.parent_path());
  std::ofstream(file, std::ios::binary) << content;
}

// Frame `index` of a 25 Hz stream; its samples are noise, different in every frame.
inline Frame noise_frame(const std::string& source, std::uint64_t index, PixelFormat format,
                         int width, int height) {
  Frame frame;
  frame.source = source;
  frame.sequence = 100 + index;
  frame.timestamp_ns = 1'700'000'000'123'456'789 + static_cast<std::int64_t>(index) * 40'000'003;
  frame.arrival_ns = frame.timestamp_ns + 5'000'001;
  frame.exposure_s = 1.0 / 3.0 / static_cast<double>(1 + index);
  frame.gain = 1.1;
  frame.exposure = 0.1 + 0.7 * static_cast<double>(index);
  frame.format = format;
  frame.width = width;
  frame.height = height;
  frame.bytes.resize(frame_bytes(format, width, height));
  std::mt19937 random(static_cast<std::uint32_t>(index * 7919 + frame.bytes.size()));
  for (std::uint8_t& byte : frame.bytes) byte = static_cast<std::uint8_t>(random());
  return frame;
}

// A closed session with `count` small observer frames.
inline void write_small_session(const std::filesystem::path& directory, int count, int width = 24,
                                int height = 18, VideoCodec codec = VideoCodec::ffv1) {
  SessionInfo info;
  info.name = "small";
  SessionWriter writer(directory, info, std::chrono::seconds(1), codec);
  for (int i = 0; i < count; ++i)
    writer.write(noise_frame("observer", i, PixelFormat::rgb8, width, height));
  writer.close();
}

// Whether a frame read back is the noise_frame it was, with every number.
inline bool is_frame(const Frame& frame, std::uint64_t index) {
  const Frame truth = noise_frame(frame.source, index, frame.format, frame.width, frame.height);
  return frame.sequence == truth.sequence && frame.timestamp_ns == truth.timestamp_ns &&
         frame.arrival_ns == truth.arrival_ns && frame.exposure_s == truth.exposure_s &&
         frame.gain == truth.gain && frame.exposure == truth.exposure && frame.bytes == truth.bytes;
}

inline bool mentions(const std::vector<std::string>& sentences, const std::string& words) {
  for (const std::string& sentence : sentences)
    if (sentence.find(words) != std::string::npos) return true;
  return false;
}

}  // namespace previz::session
