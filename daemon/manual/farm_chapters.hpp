// Has the chapters of previz-farm(1) that were written by hand.
#pragma once

#include <vector>

#include "daemon/manual/man_page.hpp"

namespace previz::manual {

// Returns them in the order of the page, from how a job goes to what else to read.
std::vector<Chapter> farm_chapters();

}  // namespace previz::manual
