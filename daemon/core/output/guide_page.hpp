// Lines and words over a picture, in its own pixels, as plain data.
#pragma once

#include <glm/vec2.hpp>
#include <string>
#include <vector>

namespace previz::output {

// What a line shows; each has a colour of its own.
enum class GuideKind { model, tag, horizon, x_axis, y_axis, z_axis, bounds, focus, mark };

// From centre to centre of these pixels; (0,0) is the centre of the top left one.
struct GuideLine {
  glm::dvec2 a{0}, b{0};
  GuideKind kind = GuideKind::model;

  friend bool operator==(const GuideLine&, const GuideLine&) = default;
};

// A word, UTF-8, in the middle of which is `at`.
struct GuideWord {
  glm::dvec2 at{0};
  std::string text;
  GuideKind kind = GuideKind::model;

  friend bool operator==(const GuideWord&, const GuideWord&) = default;
};

// Later lines are above earlier ones, and words above all lines.
struct GuidePage {
  int width = 0, height = 0;  // of the picture, whatever size it is shown or rendered in
  std::vector<GuideLine> lines;
  std::vector<GuideWord> words;
  bool is_whole = true;  // false: some are not known yet

  friend bool operator==(const GuidePage&, const GuidePage&) = default;
};

}  // namespace previz::output
