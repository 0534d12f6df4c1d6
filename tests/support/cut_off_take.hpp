// A take that was cut off, without anything that knows its end.
#pragma once

#include <cstdint>
#include <filesystem>

#include "tests/support/session_fixture.hpp"

namespace previz::test {

inline void write_cut_off_take(const std::filesystem::path& take, std::uint64_t frames) {
  session::SessionInfo info;
  info.take = session::TakeInfo{1, "12A", "", 25, "", false};
  session::SessionWriter writer(take, info);
  for (std::uint64_t i = 0; i < frames; ++i)
    writer.write(session::noise_frame("observer", i, PixelFormat::rgb8, 24, 18));
  const std::filesystem::path as_it_is = take.string() + ".cut";
  std::filesystem::copy(take, as_it_is, std::filesystem::copy_options::recursive);
  writer.close();
  std::filesystem::remove_all(take);
  std::filesystem::rename(as_it_is, take);
}

}  // namespace previz::test
