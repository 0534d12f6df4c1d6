// What `previzd check` asks each room of a set: problems, remarks, and a paragraph of facts. The
// rooms' own questions are in the check.hpp of each.
#pragma once

#include <cstdint>
#include <functional>
#include <iosfwd>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "daemon/core/set/set.hpp"

namespace previz::set {

// A set with the calibrations in force put into it, and further facts about it.
struct CheckedSet {
  Set set;
  bool has_track = false;          // the session has poses
  bool is_take = false;            // its cameras are recorded
  std::optional<double> exposure;  // of the film camera's first frame, where it is known
};

struct Findings {
  std::vector<std::string> problems;  // for which a live set, or rendering a take, would be refused
  std::vector<std::string> remarks;   // on settings that are allowed but unusual

  // Runs `work`; a previz::Error becomes a problem.
  void attempt(const std::function<void()>& work);
};

// Writes digits in groups of three: "1 234 567"; plural() with a noun: "1 tag", "1 200 tags".
std::string grouped(std::uint64_t number);
std::string plural(std::uint64_t number, const std::string& noun);

// Returns the parts one after the other; numbers with 6 digits.
template <class... Parts>
std::string words(const Parts&... parts) {
  std::ostringstream text;
  text.precision(6);
  (text << ... << parts);
  return text.str();
}

// Returns the exposure that the set gives the film camera, itself or by its shutter time and gain;
// nothing where only the frames know it.
std::optional<double> stated_exposure(const Set& set);

// Finds cameras that are set to another size than they are calibrated for, and remarks on what is
// implausible (implausible.hpp) or has to come with the session.
void check_cameras(const CheckedSet& checked, Findings& findings);
void remark_on_cameras(const CheckedSet& checked, Findings& findings);

// Print the cameras with their lenses, and how pictures are estimated.
void describe_cameras(const Set& set, std::ostream& out);
void describe_estimator(const Set& set, std::ostream& out);

}  // namespace previz::set
