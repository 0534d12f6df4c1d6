// Makes texts fit for a terminal that come from files or names: a job's folder may come from
// elsewhere, and its messages and names are data.
#pragma once

#include <string>

namespace previz::farm {

// Returns `text` on one line: line breaks and tabs as spaces, none at the end, and as \xNN the
// other control characters (also those of C1), the marks that turn the direction of writing, and
// bytes that are not UTF-8.
std::string on_one_line(const std::string& text);

}  // namespace previz::farm
