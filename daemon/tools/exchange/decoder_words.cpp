#include "daemon/tools/exchange/decoder_words.hpp"

extern "C" {
#include <libavutil/log.h>
}

#include <algorithm>
#include <array>
#include <cstdarg>
#include <map>
#include <mutex>
#include <span>
#include <string_view>

namespace previz::exchange {
namespace {

// In the words of libavcodec 59 (h264, hevc, and the concealment of errors that h264, mpeg2 and
// mpeg4 share) before numbers are put in. ImportVideoWithAHole and ImportTruncatedVideo show that
// they are still its words.
constexpr std::array<std::string_view, 4> damage = {"error while decoding", "concealing",
                                                    "illegal short term buffer state",
                                                    "First slice in a frame missing"};
constexpr std::array<std::string_view, 5> missing = {
    "Frame num gap", "eference picture missing", "issing reference picture",
    "Could not find ref with POC", "co located POCs unavailable"};

bool is_one_of(std::string_view words, std::span<const std::string_view> known) {
  return std::ranges::any_of(known, [&](std::string_view of_these) {
    return words.find(of_these) != std::string_view::npos;
  });
}

struct Heard {
  std::mutex mutex;
  std::map<const void*, DecoderWords::Said*> contexts;
};

Heard& heard() {
  static Heard all;
  return all;
}

// Called by libav, from any thread; `format` is as for printf.
void hear(void* context, int level, const char* format, va_list arguments) {
  {
    const std::lock_guard lock(heard().mutex);
    const auto found = heard().contexts.find(context);
    if (found != heard().contexts.end()) {
      if (is_one_of(format, damage)) found->second->damage = true;
      if (is_one_of(format, missing)) found->second->missing = true;
      return;
    }
  }
  av_log_default_callback(context, level, format, arguments);
}

}  // namespace

DecoderWords::DecoderWords(const void* context) : context_(context) {
  const std::lock_guard lock(heard().mutex);
  heard().contexts[context] = &said_;
  av_log_set_callback(hear);
}

DecoderWords::~DecoderWords() {
  const std::lock_guard lock(heard().mutex);
  heard().contexts.erase(context_);
}

}  // namespace previz::exchange
