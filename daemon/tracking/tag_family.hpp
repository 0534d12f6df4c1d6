// Makes libapriltag's families of tags by their names.
#pragma once

#include <memory>
#include <string>

struct apriltag_family;  // libapriltag's: its cells and codes

namespace previz::tracking {

using TagFamily = std::unique_ptr<apriltag_family, void (*)(apriltag_family*)>;

// Returns a family of its own. Throws previz::Error that begins with `where` and names the families
// if `name` is none of set::tag_families.
TagFamily make_tag_family(const std::string& name, const std::string& where = "");

}  // namespace previz::tracking
