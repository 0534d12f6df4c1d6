#include "daemon/tools/model/tag_papers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <optional>

#include "daemon/core/lighting/response.hpp"
#include "drivers/plate.hpp"

namespace previz::model {
namespace {

// A tag is at least so far above what it lies on, which would hide it.
constexpr double least_above_m = 5e-5;
constexpr double least_cell_px = 3;
// The surface beside a paper is looked at so far from its middle, over half of its width.
constexpr double beside_from = 1.12, beside_to = 1.3;
constexpr int beside_a_side = 8;

std::string paper_of(const FlatTag& flat) {
  return fmt::format("tag {} paper", flat.tag->id);
}
std::string print_of(const FlatTag& flat) {
  return fmt::format("tag {} print", flat.tag->id);
}

// Returns a point of the tag's frame in the world.
glm::dvec3 in_world(const FlatTag& flat, double x, double y) {
  return glm::dvec3(flat.tag->world_from_tag * glm::dvec4(x, y, 0, 1));
}

// The cell at `row` and `column` of the printed tag; fractions are within cells.
glm::dvec2 in_tag(const FlatTag& flat, const tracking::TagCells& cells, double row, double column) {
  const double cell = flat.tag->size_m / cells.border;
  return {cell * (column - 0.5 * cells.total), cell * (0.5 * cells.total - row)};
}

// Returns half of the width of a tag with its white border.
double half_tag(const FlatTag& flat, const tracking::TagCells& cells) {
  return 0.5 * cells.total * flat.tag->size_m / cells.border;
}

// Adds what the paper has around the tag, which is `inner` from its middle.
template <class Above>
void add_border(const glm::dvec2& half, double inner, const Above& above, Solid& paper) {
  const auto add = [&](const glm::dvec2& low, const glm::dvec2& high) {
    if (high.x - low.x > 1e-9 && high.y - low.y > 1e-9)
      paper.faces.push_back({"face",
                             {above({low.x, low.y}), above({high.x, low.y}),
                              above({high.x, high.y}), above({low.x, high.y})}});
  };
  add({-half.x, -half.y}, {half.x, -inner});
  add({-half.x, inner}, {half.x, half.y});
  add({-half.x, -inner}, {-inner, inner});
  add({inner, -inner}, {half.x, inner});
}

void add_tag(const FlatTag& flat, const tracking::TagCells& cells, const Plane& ground,
             const glm::dvec2& half_paper_m, std::vector<Solid>& solids) {
  const auto above_m = [&](const glm::dvec2& at) {
    return above_ground(flat, ground, at, std::max(flat.thickness_m, least_above_m));
  };
  const auto above = [&](double row, double column) {
    return above_m(in_tag(flat, cells, row, column));
  };
  Solid paper{paper_of(flat), {}}, print{print_of(flat), {}};
  for (int row = 0; row < cells.total; ++row)
    for (int column = 0; column < cells.total;) {
      const bool black = cells.black(row, column);
      int end = column;  // neighbours in a row are one face
      while (end < cells.total && cells.black(row, end) == black) ++end;
      (black ? print : paper)
          .faces.push_back(
              {"face",
               {above(row + 1, column), above(row + 1, end), above(row, end), above(row, column)}});
      column = end;
    }
  add_border(half_paper_m, half_tag(flat, cells), above_m, paper);
  solids.push_back(std::move(paper));
  solids.push_back(std::move(print));
}

// Linear signals of a picture.
class Signals {
 public:
  Signals(const Frame& frame, const ResponseCurve& response)
      : plate_(to_plate(frame)), response_(response, plate_.bits), clipped_(response_.clipping()) {}

  // Returns the nearest pixel's; nothing outside of the picture, and where a channel is clipped.
  std::optional<glm::dvec3> at(const glm::dvec2& px) const {
    const double x = std::round(px.x), y = std::round(px.y);
    if (!(x >= 0 && y >= 0 && x < plate_.width && y < plate_.height)) return {};
    const std::uint16_t* codes =
        &plate_.samples[3 * (std::size_t(y) * std::size_t(plate_.width) + std::size_t(x))];
    glm::dvec3 signal;
    for (glm::length_t c = 0; c < 3; ++c) {
      if (codes[c] >= clipped_.from) return {};
      signal[c] = response_.inverse()[codes[c]];
    }
    return signal;
  }

 private:
  Plate plate_;
  lighting::Response response_;
  lighting::Clipping clipped_;
};

using Values = std::vector<glm::dvec3>;

// Returns the median of each channel.
glm::dvec3 median_of(Values values) {
  glm::dvec3 median;
  for (glm::length_t c = 0; c < 3; ++c) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::ranges::nth_element(values, middle, {}, [c](const glm::dvec3& v) { return v[c]; });
    median[c] = (*middle)[c];
  }
  return median;
}

// The light of the cells of a tag over that of the surface beside it, a value for each picture.
struct Ratios {
  Values paper, print;
};

class TagColours {
 public:
  TagColours(const std::string& family, const Views& views, const Shape& shape,
             const std::vector<Solid>& solids, const ResponseCurve& response)
      : family_(family), views_(views), solids_(solids) {
    for (std::size_t v = 0; v < views.views.size(); ++v) {
      signals_.emplace_back(*views.views[v].frame, response);
      poses_.push_back(adjusted_pose(views.views[v], shape.cameras_off[v]));
    }
  }

  Ratios of(const FlatTag& flat) const {
    const tracking::TagCells cells = tracking::tag_cells(family_, flat.tag->id);
    Ratios ratios;
    for (std::size_t v = 0; v < signals_.size(); ++v) add_view(v, flat, cells, ratios);
    return ratios;
  }

 private:
  glm::dvec2 pixel(std::size_t view, const FlatTag& flat, const glm::dvec2& at) const {
    const tracking::CameraFromWorld& pose = poses_[view];
    return projected(views_.lens, pose.rotation * in_world(flat, at.x, at.y) + pose.translation);
  }

  void add_view(std::size_t v, const FlatTag& flat, const tracking::TagCells& cells,
                Ratios& ratios) const {
    const auto px = [&](double row, double column) {
      return pixel(v, flat, in_tag(flat, cells, row, column));
    };
    const double middle = 0.5 * cells.total;
    const glm::dvec2 down = px(middle + 0.5, middle) - px(middle - 0.5, middle);
    const glm::dvec2 right = px(middle, middle + 0.5) - px(middle, middle - 0.5);
    // Below 0 where the tag faces away.
    const double narrowest =
        (right.x * down.y - right.y * down.x) / std::max(glm::length(down), glm::length(right));
    if (!(narrowest >= least_cell_px) || is_hidden_in(v, flat, cells)) return;
    Values beside, paper, print;
    const auto add = [&](const glm::dvec2& at, Values& values) {
      if (const auto signal = signals_[v].at(at)) values.push_back(*signal);
    };
    for (int row = 0; row < cells.total; ++row)
      for (int column = 0; column < cells.total; ++column)
        add(px(row + 0.5, column + 0.5), cells.black(row, column) ? print : paper);
    for (const double out : {beside_from, beside_to})
      for (int i = 0; i < beside_a_side; ++i) {
        const double along = middle * out * (2.0 * i / beside_a_side - 1), off = middle * out;
        for (const glm::dvec2 at : {glm::dvec2(along, -off), glm::dvec2(off, along),
                                    glm::dvec2(-along, off), glm::dvec2(-off, -along)})
          add(px(middle + at.x, middle + at.y), beside);
      }
    if (beside.empty()) return;
    const glm::dvec3 ground = median_of(beside);
    if (!(ground.r > 0 && ground.g > 0 && ground.b > 0)) return;
    if (!paper.empty()) ratios.paper.push_back(median_of(paper) / ground);
    if (!print.empty()) ratios.print.push_back(median_of(print) / ground);
  }

  bool is_hidden_in(std::size_t view, const FlatTag& flat, const tracking::TagCells& cells) const {
    const glm::dvec3 eye(tracking::world_from_camera(poses_[view])[3]);
    const double end = cells.total;
    for (const auto& [row, column] :
         {std::pair{0.0, 0.0}, {0.0, end}, {end, 0.0}, {end, end}, {end / 2, end / 2}}) {
      const glm::dvec2 at = in_tag(flat, cells, row, column);
      // The map of tags may have a corner below what the tag lies on.
      const glm::dvec3 above = 1e-3 * glm::dvec3(flat.tag->world_from_tag[2]);
      if (is_hidden(solids_, eye, in_world(flat, at.x, at.y) + above)) return true;
    }
    return false;
  }

  std::string family_;
  const Views& views_;
  const std::vector<Solid>& solids_;
  std::vector<Signals> signals_;
  std::vector<tracking::CameraFromWorld> poses_;
};

}  // namespace

glm::dvec3 above_ground(const FlatTag& flat, const Plane& ground, const glm::dvec2& in_tag,
                        double height_m) {
  const glm::dvec3 p = in_world(flat, in_tag.x, in_tag.y);
  return p + (height_m - glm::dot(p - ground.at, ground.normal)) * ground.normal;
}

FaceBelow face_below(const FlatTag& flat, const Plane& ground, const std::vector<Solid>& solids) {
  constexpr double same_m = 1e-3, same_cosine = 1 - 1e-6;
  const glm::dvec3 middle = above_ground(flat, ground, glm::dvec2(0), 0);
  FaceBelow nearest;
  double nearest_m = same_m;
  for (const Solid& solid : solids)
    for (const Face& face : solid.faces) {
      const double off_m = std::abs(glm::dot(face.outline[0] - ground.at, ground.normal));
      if (off_m >= nearest_m || !is_in(face, middle) ||
          glm::dot(normal_of(face), ground.normal) <= same_cosine)
        continue;
      nearest = {&solid, &face};
      nearest_m = off_m;
    }
  return nearest;
}

glm::dvec2 half_paper(const FlatTag& flat, const tracking::TagCells& cells, const Parts& parts) {
  const auto& paper =
      flat.is_on_box ? parts.boxes[flat.part].tag_paper_m : parts.planes[flat.part].tag_paper_m;
  const glm::dvec2 least(half_tag(flat, cells));
  return paper ? glm::max(least, 0.5 * glm::dvec2((*paper)[0], (*paper)[1])) : least;
}

std::vector<Solid> tag_solids(const std::string& family, const Layout& layout, const Parts& parts,
                              const Shape& shape) {
  std::vector<Solid> solids;
  for (const FlatTag& flat : layout.tags) {
    const tracking::TagCells cells = tracking::tag_cells(family, flat.tag->id);
    add_tag(flat, cells, ground_of(flat, shape), half_paper(flat, cells, parts), solids);
  }
  return solids;
}

std::map<std::string, Colour> tag_colours(const std::string& family, const Layout& layout,
                                          const Views& views, const Shape& shape,
                                          const std::vector<Solid>& solids,
                                          const ResponseCurve& response,
                                          const std::map<std::string, Colour>& surfaces) {
  const TagColours all(family, views, shape, solids, response);
  std::map<std::string, Colour> colours;
  const auto add = [&](const FlatTag& flat) {
    const FaceBelow below = face_below(flat, ground_of(flat, shape), solids);
    const auto surface = below.solid ? surfaces.find(below.solid->name) : surfaces.end();
    if (surface == surfaces.end()) return;
    const Ratios ratios = all.of(flat);
    const auto put = [&](const std::string& name, const Values& values) {
      if (values.empty()) return;
      const glm::dvec3 ratio = median_of(values);
      glm::dvec3 off(0);  // what one picture has, beside the median
      for (const glm::dvec3& value : values) off = glm::max(off, glm::abs(value - ratio));
      colours[name] = {surface->second.albedo * ratio, surface->second.albedo * off, values.size()};
    };
    put(paper_of(flat), ratios.paper);
    put(print_of(flat), ratios.print);
  };
  for (const FlatTag& flat : layout.tags) add(flat);
  return colours;
}

std::map<std::string, glm::dvec3> usual_tag_colours(const Layout& layout) {
  constexpr double paper = 0.8, print = 0.04;  // office paper and toner
  std::map<std::string, glm::dvec3> colours;
  for (const FlatTag& flat : layout.tags) {
    colours[paper_of(flat)] = glm::dvec3(paper);
    colours[print_of(flat)] = glm::dvec3(print);
  }
  return colours;
}

}  // namespace previz::model
