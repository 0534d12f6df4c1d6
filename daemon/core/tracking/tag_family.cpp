#include "daemon/core/tracking/tag_family.hpp"

#include <apriltag/apriltag.h>
#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h10.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagCircle21h7.h>
#include <apriltag/tagCircle49h12.h>
#include <apriltag/tagCustom48h12.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>

#include <cstdlib>

#include "drivers/error.hpp"

namespace previz::tracking {
namespace {

struct KnownFamily {
  const char* name;
  apriltag_family_t* (*create)();
  void (*destroy)(apriltag_family_t*);
};

constexpr KnownFamily known_families[] = {
    {"tag36h11", tag36h11_create, tag36h11_destroy},
    {"tag25h9", tag25h9_create, tag25h9_destroy},
    {"tag16h5", tag16h5_create, tag16h5_destroy},
    {"tag36h10", tag36h10_create, tag36h10_destroy},
    {"tagStandard41h12", tagStandard41h12_create, tagStandard41h12_destroy},
    {"tagStandard52h13", tagStandard52h13_create, tagStandard52h13_destroy},
    {"tagCircle21h7", tagCircle21h7_create, tagCircle21h7_destroy},
    {"tagCircle49h12", tagCircle49h12_create, tagCircle49h12_destroy},
    {"tagCustom48h12", tagCustom48h12_create, tagCustom48h12_destroy},
};

}  // namespace

TagFamily make_tag_family(const std::string& name, const std::string& where) {
  std::string known;
  for (const KnownFamily& family : known_families) {
    if (name == family.name) return {family.create(), family.destroy};
    add_to_list(known, family.name);
  }
  throw Error(where + "\"" + name + "\" is not a tag family; known: " + known);
}

TagCells tag_cells(const std::string& family, int id) {
  const TagFamily made = make_tag_family(family);
  const int count = static_cast<int>(made->ncodes);
  if (id < 0 || id >= count)
    throw Error(family + " has no id " + std::to_string(id) + "; it has 0 to " +
                std::to_string(count - 1));
  TagCells cells{made->total_width, made->width_at_border, {}};
  image_u8_t* image = apriltag_to_image(made.get(), static_cast<std::uint32_t>(id));
  for (int row = 0; row < cells.total; ++row)
    for (int column = 0; column < cells.total; ++column)
      cells.is_black.push_back(image->buf[row * image->stride + column] == 0);
  std::free(image->buf);  // the packaged library does not export image_u8_destroy
  std::free(image);
  return cells;
}

}  // namespace previz::tracking
