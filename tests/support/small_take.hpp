// A recorded take small enough to render in a test: a grey floor (phantom), a white card over it
// (virtual), eight observer pictures of noise and three light frames of one grey.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "daemon/core/session/session.hpp"
#include "drivers/frame.hpp"

namespace previz::test {

inline constexpr int small_take_frames = 8;
inline constexpr int small_take_lost = 3;   // the frame without a pose
inline constexpr int small_take_unlit = 0;  // the frame before the first light frame
inline constexpr std::int64_t small_take_interval_ns = 40'000'000;

// Observer picture `index`, 48x36, every sample random.
Frame small_take_frame(int index);

// Makes `directory`/session (the session, with the set in it), floor.gltf, card.gltf and set.toml.
// `with_card` false: nothing virtual in the set. `more` is appended to the set file. `light`: in
// every line of track.jsonl.
void write_small_take(const std::filesystem::path& directory, bool with_card = true,
                      const std::string& more = "",
                      const std::optional<session::CapturedLight>& light = {},
                      std::int64_t interval_ns = small_take_interval_ns);

// A square of this side, facing glTF's +Y, which is the world's +Z.
void write_square(const std::filesystem::path& file, float side_m, float height_m);

// Spoils the picture of observer frame `index` in such a way that opening the session finds it
// whole, and reading the frame fails.
void make_unreadable(const std::filesystem::path& session, int index);

// Writes the card with variants of its material: grey, as without one, black, and a lamp.
void write_card_with_variants(const std::filesystem::path& file);

}  // namespace previz::test
