// Finds the things of a model that are off while the rest of it fits.
#pragma once

#include <cstddef>
#include <deque>
#include <map>
#include <string>
#include <vector>

#include "daemon/fit/real_model.hpp"
#include "daemon/fit/rest.hpp"
#include "daemon/fit/shift.hpp"

namespace previz::fit {

struct ThingOff {
  std::string name;
  double shift_px = 0;     // in the pictures, the mean of its pieces
  std::size_t pieces = 0;  // that were found of it, in the frames in which the rest fits
};

// What one frame shows of a thing.
struct ThingVotes {
  std::size_t looked_at = 0;
  Votes votes;  // of the pieces that were found
};

// So many frames, the last ones, decide on a thing: one alone mostly shows too little of it.
inline constexpr std::size_t frames_judged = 5;

// A thing is off if its pieces of these frames
// - agree on a way of it in the world that is more than most_off_px in the pictures, and most of
//   those that were looked at do,
// - lie clearly worse where the model says, and where the rest of the model is (RestShift),
// in the frames in which the rest fits.
class Things {
 public:
  // Looks at a frame: the things by their numbers in RealModel::things(), with no_thing for what is
  // none; the votes of all of these together, and the pieces that were found.
  void look(const std::map<std::size_t, ThingVotes>& things, const Votes& all,
            const std::vector<Looked>& found);

  // Returns the things that are off, the worst first. `names` is RealModel::things().
  std::vector<ThingOff> off(const std::vector<std::string>& names) const;

 private:
  struct Piece {
    Looked looked;
    RestShift rest;  // of the frame
  };
  struct Judged {
    std::size_t looked_at = 0;
    std::vector<Piece> pieces;
  };
  using JudgedThings = std::map<std::size_t, Judged>;

  JudgedThings judged() const;  // in all frames

  std::deque<JudgedThings> frames_;
};

}  // namespace previz::fit
