// Decides which parts of a live picture are searched for tags, so that the tracker keeps up with
// large pictures.
#pragma once

#include <glm/vec2.hpp>
#include <vector>

namespace previz::tracking {

// A part of a picture, px.
struct Region {
  int x = 0, y = 0, width = 0, height = 0;

  friend bool operator==(const Region&, const Region&) = default;
};

// Where a tag with its margin of paper is likely to be. Pixels; (0,0) is the centre of the top-left
// pixel.
struct ExpectedTag {
  int id = 0;
  glm::dvec2 low{0}, high{0};
  bool is_inside = false;  // the whole tag, so that it should be found
};

struct SearchStep {
  // At full resolution: where tags are expected, in parts that do not meet, and then a strip.
  std::vector<Region> regions;
  bool coarse = false;  // the whole picture as well, at half the resolution
};

// Every picture is searched where tags are expected. What nobody expects is found by a sweep of 16
// pictures: 15 strips, which hold every tag of up to 64 px, and the whole picture at half the
// resolution, which shows the larger ones.
inline constexpr int sweep_pictures = 16;
// While the pose is found, a tag that is missing has the whole picture searched at most this often.
inline constexpr int pictures_between_whole = 8;

class SearchPlan {
 public:
  SearchPlan(int width, int height) : width_(width), height_(height) {}

  // Returns what to search of the next picture.
  SearchStep next(const std::vector<ExpectedTag>& expected);
  // Returns true if a missing tag is a reason to search all of this picture.
  bool may_search_whole() const { return since_whole_ >= pictures_between_whole; }
  void searched_whole() { since_whole_ = swept_ = 0; }

 private:
  Region around(glm::dvec2 low, glm::dvec2 high) const;

  int width_, height_;
  int swept_ = 0, since_whole_ = 0;
};

}  // namespace previz::tracking
