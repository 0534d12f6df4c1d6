#include "daemon/tools/calibrate/tags/tag_walk.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <sstream>

#include "daemon/core/tracking/other_tags.hpp"
#include "daemon/core/tracking/tag_map.hpp"
#include "daemon/tools/calibrate/lens/length.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

constexpr std::size_t pictures_of_a_session = 150;
constexpr std::size_t most_sampled = 5;  // pictures, to say what they hold in place of the tags

std::size_t stride_of(const PictureSource& source, const WalkOptions& options) {
  if (options.every > 0) return std::size_t(options.every);
  const auto count = source.count();
  if (!count) return 1;  // thin_out() does the rest
  return std::max<std::size_t>(1, (*count + pictures_of_a_session - 1) / pictures_of_a_session);
}

void insist_on_size(const NamedFrame& picture, const PinholeIntrinsics& lens) {
  const Frame& frame = *picture.frame;
  if (frame.width == lens.width && frame.height == lens.height) return;
  throw Error(picture.name + ": has " + std::to_string(frame.width) + "x" +
              std::to_string(frame.height) + " pixels, the film camera is calibrated for " +
              std::to_string(lens.width) + "x" + std::to_string(lens.height));
}

double variance_of_corners(const tracking::TagDetection& tag) {
  double sum = 0;
  for (std::size_t i = 0; i < 8; ++i) sum += tag.covariance[9 * i];
  return sum / 8;
}

// A sighting whose tag is still an id.
struct SeenTag {
  int id = 0;
  TagSighting sighting;
};

// `doubles` counts the pictures in which a tag is more than once.
std::vector<SeenTag> usable_tags(const std::vector<tracking::TagDetection>& detections,
                                 const WalkOptions& options, std::map<int, std::size_t>& doubles) {
  std::map<int, int> times;
  for (const tracking::TagDetection& tag : detections) ++times[tag.id];
  for (const auto& [id, count] : times)
    if (count > 1) ++doubles[id];
  std::vector<SeenTag> tags;
  for (const tracking::TagDetection& tag : detections) {
    const bool carried = std::ranges::find(options.left_out, tag.id) != options.left_out.end();
    if (!tag.trouble.empty() || times[tag.id] > 1 || carried) continue;
    tags.push_back({tag.id, {0, 0, tag.corners, variance_of_corners(tag)}});
  }
  return tags;
}

// Gives the seen tags their numbers and sizes.
void number_tags(const std::vector<SeenTag>& seen, const TagSizes& sizes, TagWalk& walk) {
  for (const SeenTag& tag : seen) walk.ids.push_back(tag.id);
  std::ranges::sort(walk.ids);
  walk.ids.erase(std::unique(walk.ids.begin(), walk.ids.end()), walk.ids.end());
  std::vector<int> unknown;
  for (const int id : walk.ids) {
    const auto size = sizes.of(id);
    if (!size) unknown.push_back(id);
    walk.sizes_m.push_back(size.value_or(0));
  }
  if (!unknown.empty())
    throw Error("the size of " + tracking::tags_in_words(unknown) +
                " is unknown: give --size 80mm (the side of the black border, measured), or "
                "--size " +
                std::to_string(unknown.front()) + ":80mm for one of them");
  for (const SeenTag& tag : seen) {
    walk.sightings.push_back(tag.sighting);
    walk.sightings.back().tag =
        std::size_t(std::ranges::lower_bound(walk.ids, tag.id) - walk.ids.begin());
  }
}

// Leaves out every second picture.
void thin_out(std::vector<SeenTag>& seen, std::vector<std::string>& pictures) {
  std::erase_if(seen, [](const SeenTag& tag) { return tag.sighting.picture % 2 == 1; });
  for (SeenTag& tag : seen) tag.sighting.picture /= 2;
  std::vector<std::string> kept;
  for (std::size_t i = 0; i < pictures.size(); i += 2) kept.push_back(std::move(pictures[i]));
  pictures = std::move(kept);
}

// Says that no picture shows a tag that can be measured, and what they show instead.
std::string nothing_seen(std::size_t looked_at, const std::vector<FramePtr>& sampled,
                         const ResponseCurve& response, const std::string& family) {
  const std::string instead = tracking::other_tags(sampled, family, response);
  return fmt::format("none of the {} pictures examined shows a tag of {} that can be measured{}{}",
                     looked_at, family, instead.empty() ? "" : "; ", instead);
}

}  // namespace

std::optional<double> TagSizes::of(int id) const {
  const auto listed = by_id_m.find(id);
  return listed == by_id_m.end() ? common_m : std::optional(listed->second);
}

TagSizes parse_tag_sizes(const std::string& text) {
  TagSizes sizes;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, ',');) {
    const std::size_t colon = part.find(':');
    const auto length =
        parse_length(std::string_view(part).substr(colon == std::string::npos ? 0 : colon + 1));
    int id = 0;
    const char* const end = part.data() + std::min(colon, part.size());
    const auto read = std::from_chars(part.data(), end, id);
    const bool has_id = colon != std::string::npos;
    if (!length || (has_id && (read.ec != std::errc{} || read.ptr != end || id < 0)))
      throw Error("size \"" + part +
                  "\" is not valid; allowed: 80mm (all tags) or 7:80mm "
                  "(tag 7), in mm, cm, m or in, separated by commas");
    if (has_id)
      sizes.by_id_m[id] = *length;
    else
      sizes.common_m = length;
  }
  return sizes;
}

TagWalk gather_walk(PictureSource& source, const PinholeIntrinsics& lens,
                    const ResponseCurve& response, const WalkOptions& options,
                    const std::function<void(const std::string&)>& report) {
  tracking::TagDetector detector(options.detector, lens, response);
  TagWalk walk;
  std::vector<SeenTag> seen;
  std::map<int, std::size_t> doubles;
  std::vector<FramePtr> sampled;
  std::size_t index = 0, looked_at = 0;
  std::size_t stride = stride_of(source, options);
  // Nobody knows how long a video is before its end: of a short one all pictures are used.
  const bool is_of_any_length = options.every == 0 && !source.count();
  for (auto picture = source.next(); picture; picture = source.next()) {
    if (index++ % stride) continue;
    ++looked_at;
    insist_on_size(*picture, lens);
    const auto detections = detector.detect(*picture->frame, 1);
    if (detections.empty() && std::has_single_bit(looked_at) && sampled.size() < most_sampled)
      sampled.push_back(picture->frame);
    std::vector<SeenTag> tags = usable_tags(detections, options, doubles);
    if (tags.empty()) continue;
    for (SeenTag& tag : tags) {
      tag.sighting.picture = walk.pictures.size();
      seen.push_back(tag);
    }
    walk.pictures.push_back(picture->name);
    if (!is_of_any_length || walk.pictures.size() < pictures_of_a_session) continue;
    thin_out(seen, walk.pictures);
    stride *= 2;
  }
  if (!doubles.empty())
    report(tracking::doubles_in_words(doubles, "picture", "those pictures are used without it"));
  if (seen.empty())
    throw Error(nothing_seen(looked_at, sampled, response, options.detector.family));
  number_tags(seen, options.sizes, walk);
  report(std::to_string(looked_at) + " of " + std::to_string(index) + " pictures examined, " +
         std::to_string(walk.pictures.size()) + " show tags: " + tracking::tags_in_words(walk.ids));
  for (const std::string& note : source.notes()) report(note);
  return walk;
}

}  // namespace previz::calibrate
