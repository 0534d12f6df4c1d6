// Finds the parts of a model that are off while the rest of it fits.
#pragma once

#include <cstddef>
#include <deque>
#include <map>
#include <string>
#include <vector>

#include "daemon/core/fit/real_model.hpp"
#include "daemon/core/fit/residual.hpp"
#include "daemon/core/fit/shift.hpp"

namespace previz::fit {

struct PartOff {
  std::string name;
  // The part would have to be moved by this in the pictures; the mean of its pieces.
  double shift_px = 0;
  // So many of its pieces were found in the frames in which the rest fits.
  std::size_t pieces = 0;
};

// One frame says this about a part.
struct PartVotes {
  std::size_t looked_at = 0;
  Votes votes;  // only pieces that were found vote
};

// The last frames, so many of them, decide on a part: one alone mostly shows too little of it.
inline constexpr std::size_t frames_judged = 5;

// A part is off if its pieces of these frames
// - agree on a translation of it in the world that is more than most_off_px in the pictures, and
// most of
//   those that were looked at do,
// - lie clearly worse where the model says, and where the rest of the model is (ResidualShift),
// in the frames in which the rest fits.
class Parts {
 public:
  // Looks at a frame: the parts by their numbers in RealModel::parts(), with no_part for what is
  // none; the votes of all of these together, and the pieces that were found.
  void look(const std::map<std::size_t, PartVotes>& parts, const Votes& all,
            const std::vector<EdgeSample>& found);

  // Returns the parts that are off, the worst first. `names` is RealModel::parts().
  std::vector<PartOff> off(const std::vector<std::string>& names) const;

  // Returns the parts of which these frames show too few edges to say whether they are off.
  std::vector<std::string> not_judged(const std::vector<std::string>& names) const;

 private:
  struct Piece {
    EdgeSample sample;
    ResidualShift rest;  // that of the piece's frame
  };
  struct Judged {
    std::size_t found = 0;  // pieces, also where the rest does not fit
    // These are of the frames in which the rest fits.
    std::size_t looked_at = 0;
    std::vector<Piece> pieces;
  };
  using JudgedParts = std::map<std::size_t, Judged>;

  // Returns the sums of all frames.
  JudgedParts judged() const;

  std::deque<JudgedParts> frames_;
};

}  // namespace previz::fit
