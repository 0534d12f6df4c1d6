#include "daemon/tracking/apriltag_tracker.hpp"
