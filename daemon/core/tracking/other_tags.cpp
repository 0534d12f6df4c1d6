#include "daemon/core/tracking/other_tags.hpp"

#include <apriltag/apriltag.h>

#include <algorithm>
#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <utility>

#include "daemon/core/set/tag_families.hpp"
#include "daemon/core/tracking/photometry.hpp"
#include "daemon/core/tracking/tag_family.hpp"
#include "daemon/core/tracking/tag_map.hpp"
#include "drivers/plate.hpp"

namespace previz::tracking {
namespace {

constexpr double kMinMargin = 20;   // libapriltag's decision margin, of one tag among several
constexpr double kSureMargin = 50;  // of a single tag
// A picture of a room has hundreds of quads. One of them is a code of 16 bits by chance (30 codes,
// 4 turns: 1 in 550), but not of 25 (35 codes, 4 turns: 1 in 240000).
constexpr std::uint32_t kLeastBitsOfOne = 25;
constexpr int kWidestPicture = 1920;  // larger ones are searched at half their size
constexpr int kMinSearchedSide = 32;

// How tags are printed or shown, beside their family.
struct TagLook {
  bool is_mirrored, is_negative;
  auto operator<=>(const TagLook&) const = default;
};
constexpr std::array tag_looks = {TagLook{false, false}, TagLook{true, false}, TagLook{false, true},
                                  TagLook{true, true}};

using TagKind = std::pair<std::string, TagLook>;

// The tags of one kind over all pictures.
struct Sightings {
  std::size_t pictures = 0, tags = 0;
  std::set<int> ids;
};

// Finds the tags of all families, without corrected bits.
class AllFamilies {
 public:
  AllFamilies() : detector_(apriltag_detector_create()) {
    for (const char* name : set::tag_families) {
      families_.push_back(make_tag_family(name));
      apriltag_detector_add_family_bits(detector_, families_.back().get(), 0);
    }
  }
  ~AllFamilies() { apriltag_detector_destroy(detector_); }
  AllFamilies(const AllFamilies&) = delete;
  AllFamilies& operator=(const AllFamilies&) = delete;

  // Adds what a grey picture shows.
  void look_at(std::vector<std::uint8_t> gray, int width, int height, const TagLook& look,
               std::map<TagKind, Sightings>& seen) {
    for (int y = 0; look.is_mirrored && y < height; ++y)
      std::reverse(gray.begin() + std::ptrdiff_t(y) * width,
                   gray.begin() + std::ptrdiff_t(y + 1) * width);
    for (std::uint8_t& sample : gray)
      if (look.is_negative) sample = static_cast<std::uint8_t>(255 - sample);
    image_u8_t picture{width, height, width, gray.data()};
    detector_->quad_decimate = width > kWidestPicture ? 2 : 1;
    zarray_t* found = apriltag_detector_detect(detector_, &picture);
    std::map<std::string, std::set<int>> ids, sure;
    for (int i = 0; i < zarray_size(found); ++i) {
      apriltag_detection_t* tag = nullptr;
      zarray_get(found, i, &tag);
      if (tag->decision_margin < kMinMargin) continue;
      ids[tag->family->name].insert(tag->id);
      if (tag->decision_margin >= kSureMargin && tag->family->nbits >= kLeastBitsOfOne)
        sure[tag->family->name].insert(tag->id);
    }
    apriltag_detections_destroy(found);
    for (const auto& [family, those] : ids) {
      if (those.size() < 2 && !sure.contains(family)) continue;
      Sightings& all = seen[{family, look}];
      ++all.pictures;
      all.tags += those.size();
      all.ids.insert(those.begin(), those.end());
    }
  }

 private:
  std::vector<TagFamily> families_;
  apriltag_detector_t* detector_;
};

std::string kind_words(const TagKind& kind, const Sightings& seen, const std::string& family) {
  const auto& [name, look] = kind;
  std::string text = "the pictures hold ";
  if (look.is_mirrored) text += "mirrored ";
  if (look.is_negative) text += "negative (white on black) ";
  text += "tags of " + name + ": " + tags_in_words({seen.ids.begin(), seen.ids.end()});
  if (name != family)
    text += "; write tracking.family = \"" + name +
            "\" in the set file (calibrate tags: --family " + name + "), or print tags of " +
            family;
  if (look.is_mirrored)
    text +=
        "; the prints or the picture are mirrored: print the tags unmirrored, or film without the "
        "camera's mirroring";
  if (look.is_negative) text += "; print the tags black on white";
  return text;
}

}  // namespace

std::string other_tags(const std::vector<std::shared_ptr<const Frame>>& pictures,
                       const std::string& family, const ResponseCurve& response,
                       const std::stop_token& stop) {
  AllFamilies detector;
  const Photometry photometry(response);
  std::map<TagKind, Sightings> seen;
  for (const auto& picture : pictures) {
    if (std::min(picture->width, picture->height) < kMinSearchedSide) continue;
    const auto frame = picture->bayer == BayerPattern::none ? picture : demosaiced(picture);
    const std::vector<std::uint8_t> gray = photometry.gray8(*frame);
    for (const TagLook& look : tag_looks) {
      if (stop.stop_requested()) return "";
      detector.look_at(gray, frame->width, frame->height, look, seen);
    }
  }
  seen.erase({family, tag_looks[0]});
  const auto most = std::ranges::max_element(
      seen, {}, [](const auto& one) { return std::pair(one.second.pictures, one.second.tags); });
  if (most == seen.end() || most->second.pictures < std::min<std::size_t>(2, pictures.size()))
    return "";
  return kind_words(most->first, most->second, family);
}

}  // namespace previz::tracking
