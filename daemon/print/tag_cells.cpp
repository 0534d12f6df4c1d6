#include "daemon/print/tag_cells.hpp"

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
#include <memory>

#include "drivers/error.hpp"

namespace previz::print {
namespace {

struct PrintedFamily {
  const char* name;
  apriltag_family_t* (*create)();
  void (*destroy)(apriltag_family_t*);
};

constexpr PrintedFamily printed_families[] = {
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

using OwnedFamily = std::unique_ptr<apriltag_family_t, void (*)(apriltag_family_t*)>;

OwnedFamily make_family(const std::string& name) {
  std::string known;
  for (const PrintedFamily& family : printed_families) {
    if (name == family.name) return {family.create(), family.destroy};
    add_to_list(known, family.name);
  }
  throw Error("\"" + name + "\" is not a tag family; known: " + known);
}

}  // namespace

FamilyShape family_shape(const std::string& family) {
  const OwnedFamily made = make_family(family);
  return {made->total_width, made->width_at_border, int(made->ncodes)};
}

void add_tag_cells(const std::string& family, int id, double x, double y, double cell,
                   Drawing& drawing) {
  const OwnedFamily made = make_family(family);
  if (id < 0 || id >= int(made->ncodes))
    throw Error(family + " has no id " + std::to_string(id) + "; it has 0 to " +
                std::to_string(made->ncodes - 1));
  image_u8_t* image = apriltag_to_image(made.get(), std::uint32_t(id));
  for (int row = 0; row < made->total_width; ++row)
    for (int column = 0; column < made->total_width; ++column) {
      const auto black = [&](int at) { return image->buf[row * image->stride + at] == 0; };
      if (!black(column)) continue;
      int end = column;  // neighbours in a row are one rectangle
      while (end < made->total_width && black(end)) ++end;
      drawing.black.push_back({x + column * cell, y + row * cell, (end - column) * cell, cell});
      column = end;
    }
  std::free(image->buf);  // the packaged library does not export image_u8_destroy
  std::free(image);
}

}  // namespace previz::print
