// Reads the points of real things that the crew marked while a session was recorded.
#pragma once

#include <cstddef>
#include <filesystem>
#include <glm/vec2.hpp>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/session/records.hpp"

namespace previz::session {

// The crew marks corners of boxes: these three of the upper side, in order around.
inline constexpr std::size_t corners_of_a_box = 3;

// Who aims a camera at a corner does so within about this (standard deviation).
inline constexpr double aimed_px = 2;
// Rays that meet at less than this angle, 5 degrees, leave a corner aimed_px / (focal length *
// angle) of its distance uncertain: 4 % at a focal length of 600 px.
inline constexpr double least_parallax_rad = 0.087;

// A corner of a box, both counted from 0. Its name is "box 1 corner 1".
struct BoxCorner {
  std::size_t box = 0, corner = 0;
};
std::string name_of(const BoxCorner& corner);
// Inverts name_of(); nothing for another name.
std::optional<BoxCorner> box_corner_of(const std::string& name);

struct Marks {
  struct Mark {
    std::size_t picture = 0;  // index among the observer's pictures
    std::string point;
    glm::dvec2 px{0};  // (0, 0) is the centre of the top left pixel
  };
  std::vector<Mark> marks;           // by picture, then as they were made
  std::vector<std::string> missing;  // what cannot be used, and why, in plain words
};

// Returns the marks that nobody has withdrawn; of several of one point in one picture the last.
// `observer` are the pictures that the session has. Throws previz::Error naming the file if it
// cannot be read.
Marks read_marks(const std::filesystem::path& session, const std::vector<FrameRecord>& observer);

}  // namespace previz::session
