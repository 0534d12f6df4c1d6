#include "daemon/core/tracking/tracker.hpp"

namespace previz::tracking {

const char* to_string(TrackStatus status) {
  switch (status) {
    case TrackStatus::tracked:
      return "tracked";
    case TrackStatus::ambiguous:
      return "ambiguous";
    case TrackStatus::lost:
      break;
  }
  return "lost";
}

}  // namespace previz::tracking
