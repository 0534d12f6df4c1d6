// How well printed tags are taken out of the picture (docs: README.md, "Tags that are hidden").
#pragma once

#include <string>
#include <vector>

#include "tests/truth/truth_set.hpp"

namespace previz::truth {

// Returns whether the set has the truth of a frame without its printed tags.
bool has_untagged(const TruthSet& set, int frame);

// Returns the truth of a frame whose mixed world has no printed tags; they count as covered, as the
// renderer has them, so `mask` is 1 there. Throws previz::Error naming the file.
TruthFrame load_untagged_frame(const TruthSet& set, int frame);

struct UntaggedMeasures {
  // The rms of the composite's error where tags were, over the rms of what hiding them changes.
  double e_tags = 0;
  // The largest step that shows a tag's outline: how much brighter the composite is than the truth
  // just inside of it, less how much just outside, of the truth's brightness.
  double outline = 0;
  int pixels = 0, tags = 0;
};

// One line a measure that is above its bound: e_tags 0.08, outline 0.01, which is what an eye
// begins to see.
std::vector<std::string> violations(const UntaggedMeasures& measures);

UntaggedMeasures compare_untagged(const TruthSet& set, int frame,
                                  std::span<const glm::vec3> composite);

}  // namespace previz::truth
