#include "daemon/core/session/timecode.hpp"

extern "C" {
#include <libavutil/timecode.h>
}

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <limits>

#include "daemon/core/session/nominal_rate.hpp"

namespace previz::session {

std::optional<TimecodeDigits> timecode_after(const Timecode& timecode, std::int64_t frames) {
  const RateFraction rate = fraction_of(timecode.fps);
  AVTimecode first{};
  if (rate.frames <= 0 || av_timecode_init_from_string(&first, {rate.frames, rate.seconds},
                                                       timecode.first.c_str(), nullptr) < 0)
    return std::nullopt;
  // libav reads any number of hours, and counts them in an int.
  const double in_a_day = 24 * 3600 * std::ceil(timecode.fps);
  if (!(in_a_day < std::numeric_limits<int>::max()) || first.start < 0 || first.start >= in_a_day)
    return std::nullopt;
  first.flags |= AV_TIMECODE_FLAG_24HOURSMAX;
  if (frames < -first.start || frames > std::numeric_limits<int>::max() - first.start)
    return std::nullopt;
  char text[AV_TIMECODE_STR_SIZE] = {};
  av_timecode_make_string(&first, text, static_cast<int>(frames));
  TimecodeDigits digits;
  char separator = ':';
  if (std::sscanf(text, "%d:%d:%d%c%d", &digits.hours, &digits.minutes, &digits.seconds, &separator,
                  &digits.frames) != 5)
    return std::nullopt;
  digits.fps = timecode.fps;
  digits.drops = separator == ';';
  return digits;
}

std::optional<TimecodeDigits> TakeClock::at(std::int64_t timestamp_ns) const {
  if (!timecode) return std::nullopt;
  const double seconds = static_cast<double>(timestamp_ns - first_ns) * 1e-9;
  return timecode_after(*timecode, std::llround(seconds * timecode->fps));
}

bool counts_frames(const TakeClock& clock) {
  return clock.timecode && std::abs(clock.timecode->fps - clock.fps) < 0.1;
}

std::string words_of(const TimecodeDigits& digits) {
  return fmt::format("{:02}:{:02}:{:02}{}{:02}", digits.hours, digits.minutes, digits.seconds,
                     digits.drops ? ';' : ':', digits.frames);
}

}  // namespace previz::session
