// Hears what libav's decoders say while they decode. Of a picture that refers to another which is
// not in the file they say only there that they put something in its place; the picture then comes
// out without a mark, and is wrong.
#pragma once

#include <atomic>

namespace previz::exchange {

class DecoderWords {
 public:
  // `context`: the AVCodecContext or AVFormatContext to hear, which lives longer. What it says is
  // no longer printed.
  explicit DecoderWords(const void* context);
  ~DecoderWords();
  DecoderWords(const DecoderWords&) = delete;
  DecoderWords& operator=(const DecoderWords&) = delete;

  // Returns whether, since the last call, it said that a picture or packet is damaged.
  bool told_of_damage() { return said_.damage.exchange(false); }
  // Returns whether, since the last call, it said that pictures lack which others refer to.
  bool told_of_missing() { return said_.missing.exchange(false); }

  struct Said {
    std::atomic<bool> damage = false, missing = false;
  };

 private:
  const void* context_;
  Said said_;
};

}  // namespace previz::exchange
