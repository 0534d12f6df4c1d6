// Corners of real boxes that the crew marks in the live picture, under a cross in its middle, for
// `previz model`. Each is marked from two sides or more, by which it is found in space.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/session/marks.hpp"
#include "daemon/core/session/records.hpp"
#include "daemon/core/tracking/rays.hpp"
#include "drivers/calibration.hpp"

namespace previz::live {

// What the cross of a shown picture is on.
struct Aim {
  std::int64_t timestamp_ns = 0;     // of the picture
  glm::dvec2 px{0};                  // the picture's middle
  double px_per_rad = 0;             // there
  std::optional<tracking::Ray> ray;  // nothing: no tag of the set shows where the camera is
};
Aim aim_of(const pipeline::Shot& shot, const PinholeIntrinsics& lens);

struct MarkedCorner {
  struct Mark {
    std::int64_t timestamp_ns = 0;
    tracking::Ray ray;
    double px_per_rad = 0;

    friend bool operator==(const Mark&, const Mark&) = default;
  };
  std::vector<Mark> marks;

  tracking::Meeting meeting() const;
  // Returns where the corner is; nothing if its marks do not show that.
  std::optional<glm::dvec3> place() const;

  friend bool operator==(const MarkedCorner&, const MarkedCorner&) = default;
};

class Marking {
 public:
  bool is_on = false;  // the cross is shown

  // The take that has the marks; empty: there are none.
  std::string take;

  // Forgets all marks: those of a take belong to it.
  void begin();
  // Marks the selected corner and selects the box's next one. `aim` has a ray.
  session::MarkEvent mark(const Aim& aim);
  // Withdraws the last mark and selects its corner; nothing if there is none.
  std::optional<session::MarkEvent> withdraw();
  void next_corner();
  // Selects the first corner of the next box: a new one after the last that has marks, then the
  // first again.
  void next_box();

  // Returns the name of the selected corner, as the take and the model have it: "box 1 corner 2".
  std::string selected() const { return session::name_of({box_, corner_}); }
  const MarkedCorner& selected_corner() const { return boxes_[box_][corner_]; }
  // Returns in words what the marks of a corner are worth: "marked twice, within 0.8 px".
  static std::string words_of(const MarkedCorner& corner);
  // Returns in words what the corner that was marked last makes of its box; empty: nothing yet.
  std::string words_of_box() const;

  using Box = std::array<MarkedCorner, session::corners_of_a_box>;
  const std::vector<Box>& boxes() const { return boxes_; }
  // Returns the corner that was marked last; null if there is none.
  const MarkedCorner* last() const;

  friend bool operator==(const Marking&, const Marking&) = default;

 private:
  std::vector<Box> boxes_ = {Box{}};                        // never empty
  std::size_t box_ = 0, corner_ = 0;                        // selected
  std::vector<std::pair<std::size_t, std::size_t>> order_;  // of the marks
};

}  // namespace previz::live
