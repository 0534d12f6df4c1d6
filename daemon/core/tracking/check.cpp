#include "daemon/core/tracking/check.hpp"

#include <cmath>
#include <ostream>

#include "daemon/core/tracking/trackers.hpp"

namespace previz::tracking {

using set::plural;
using set::words;

void check(const set::CheckedSet& checked, set::Findings& findings) {
  const set::Tracking& tracking = checked.set.tracking;
  const auto& calibration = checked.set.observer.calibration;
  if (tracking.enabled && tracking.tags.empty())
    findings.remarks.push_back("tracking is on but there is no [[tag]]: no pose can be found");
  if (!tracking.enabled && !checked.has_track)
    findings.remarks.push_back("tracking is off: only a session with recorded poses can be used");
  if (tracking.enabled && calibration)
    findings.attempt([&] { make_tracker(checked.set, *calibration, nullptr); });
}

void describe(const set::Tracking& tracking, std::ostream& out) {
  out << "\ntracking\n  ";
  if (!tracking.enabled) {
    out << "off: uses the poses recorded in the session\n";
    return;
  }
  out << plural(tracking.tags.size(), "tag") << " of family " << tracking.family;
  const char* separator = ": ";
  for (const auto& tag : tracking.tags) {
    out << separator << words(tag.id, " (", std::round(tag.size_m * 1e4) / 10, " mm)");
    separator = ", ";
  }
  out << '\n';
  for (const set::Carrier& carrier : tracking.carriers) {
    out << "  carrier " << carrier.name << ": " << plural(carrier.tags.size(), "tag");
    separator = ": ";
    for (const auto& tag : carrier.tags) {
      out << separator << words(tag.id, " (", std::round(tag.size_m * 1e4) / 10, " mm)");
      separator = ", ";
    }
    out << '\n';
  }
}

}  // namespace previz::tracking
