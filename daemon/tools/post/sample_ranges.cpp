#include "daemon/tools/post/sample_ranges.hpp"

#include <bit>
#include <charconv>
#include <string_view>

#include "daemon/core/pipeline/refinement.hpp"
#include "drivers/error.hpp"

namespace previz::post {
namespace {

// Returns "1", or "1, 2 or 4".
std::string counts_words(int most) {
  std::string text = "1";
  for (int count = 2; count <= most; count *= 2)
    text += (count == most ? " or " : ", ") + std::to_string(count);
  return text;
}

}  // namespace

render::SampleRange parse_sample_range(const std::string& text) {
  const Error error("--sample-range " + text +
                    ": write which range of how many, 2/4 for the second of four");
  const auto number = [&](std::string_view digits) {
    int value = 0;
    const auto [end, code] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (code != std::errc() || end != digits.data() + digits.size()) throw error;
    return value;
  };
  const std::string_view view = text;
  const std::size_t slash = view.find('/');
  if (slash == std::string_view::npos) throw error;
  const render::SampleRange range{number(view.substr(0, slash)), number(view.substr(slash + 1))};
  if (range.index < 1 || range.index > range.count) throw error;
  return range;
}

void check_sample_range(render::SampleRange range, const set::Quality& quality) {
  const std::string option = "--sample-range " + to_string(range) + ": ";
  if (quality.error > 0 || quality.seconds > 0)
    throw Error(option + "how many samples a frame gets is decided by quality." +
                (quality.error > 0 ? "error" : "seconds") +
                " while it is rendered, so they cannot be divided beforehand; set it to 0 and say "
                "the number with --spp");
  if (pipeline::spreads_samples(quality))
    throw Error(option +
                "adaptive samples go where a first look at the frame finds most noise, so they "
                "cannot be divided beforehand; use --even");
  if (quality.denoise && quality.neighbours > 0)
    throw Error(option +
                "each picture is averaged with its neighbours, which a range of samples does not "
                "have; use --neighbours 0, or divide the take by frames: several `previz render` "
                "share one folder");
  const int most = render::part_count(quality.samples);
  if (range.count > most || !std::has_single_bit(static_cast<unsigned>(range.count)))
    throw Error(option + std::to_string(quality.samples) + " samples can be divided into " +
                counts_words(most) + (most == 1 ? " range" : " ranges of 64 or more"));
}

}  // namespace previz::post
