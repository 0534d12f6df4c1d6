#include "daemon/tools/model/edges.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <optional>

#include "daemon/core/fit/light_edge.hpp"
#include "daemon/core/tracking/photometry.hpp"
#include "daemon/tools/model/tag_papers.hpp"

namespace previz::model {
namespace {

// Returns whether walls may end this plane. Which of its corners is which then depends on where
// they are.
bool may_be_cut(const Parts& parts, const PlanePart& plane) {
  return !plane.upright_on.empty() ||
         std::ranges::find(parts.planes, plane.name, &PlanePart::upright_on) != parts.planes.end();
}

// Returns whether light changes where this face ends. The rectangle of a plane ends anywhere, and a
// cylinder is round. Where a box stands on something its shadow begins, which moves the edge of
// light by half a pixel and more.
bool has_edges(const Parts& parts, const std::string& name, const std::string& face) {
  const auto plane = std::ranges::find(parts.planes, name, &PlanePart::name);
  if (plane != parts.planes.end()) return !plane->outline.empty() && !may_be_cut(parts, *plane);
  const auto box = std::ranges::find(parts.boxes, name, &BoxPart::name);
  if (box != parts.boxes.end()) return box->on.empty() || face != "bottom";
  return std::ranges::find(parts.cylinders, name, &CylinderPart::name) == parts.cylinders.end();
}

// Edges this near a tag's paper are those of the paper, or are moved by them: the depth that is
// looked at, and the reach.
constexpr double near_paper_px = fit::depth_px + 2;

using Quad = std::array<glm::dvec3, 4>;

// Returns the corners of the papers of all tags, in the world.
std::vector<Quad> papers_of(const Parts& parts, const Layout& layout, const Views& views,
                            const Shape& shape) {
  std::vector<Quad> papers;
  for (const FlatTag& flat : layout.tags) {
    const glm::dvec2 half =
        half_paper(flat, tracking::tag_cells(views.family, flat.tag->id), parts);
    const Plane ground = ground_of(flat, shape);
    const auto corner = [&](double x, double y) {
      return above_ground(flat, ground, half * glm::dvec2(x, y), flat.thickness_m);
    };
    papers.push_back({corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)});
  }
  return papers;
}

double distance_px(const glm::dvec2& point, const glm::dvec2& a, const glm::dvec2& b) {
  const glm::dvec2 along = b - a;
  const double share =
      std::clamp(glm::dot(point - a, along) / std::max(glm::dot(along, along), 1e-12), 0.0, 1.0);
  return glm::distance(point, a + share * along);
}

class Finder {
 public:
  Finder(const Views& views, const std::vector<Solid>& solids, const std::vector<Quad>& papers,
         std::size_t view, const tracking::CameraFromWorld& pose, const ResponseCurve& response)
      : views_(views),
        solids_(solids),
        papers_(papers),
        view_(view),
        pose_(pose),
        eye_(tracking::world_from_camera(pose)[3]),
        photometry_(response) {}

  // An edge that two faces share is looked for once.
  void find(const Parts& parts, std::vector<EdgePiece>& pieces) const {
    for (std::size_t s = 0; s < solids_.size(); ++s)
      for (std::size_t f = 0; f < solids_[s].faces.size(); ++f) {
        if (!has_edges(parts, solids_[s].name, solids_[s].faces[f].name)) continue;
        for (std::size_t e = 0; e < solids_[s].faces[f].outline.size(); ++e)
          if (is_first(solids_[s], f, e)) find_pieces(s, f, e, pieces);
      }
  }

 private:
  static std::pair<glm::dvec3, glm::dvec3> ends(const Face& face, std::size_t edge) {
    return {face.outline[edge], face.outline[(edge + 1) % face.outline.size()]};
  }

  // Returns whether no earlier face of the solid has this edge, the other way round. A box's bottom
  // comes first, so that what it shares with the sides is looked for there or not at all.
  static bool is_first(const Solid& solid, std::size_t face, std::size_t edge) {
    const auto [a, b] = ends(solid.faces[face], edge);
    for (std::size_t f = 0; f < face; ++f)
      for (std::size_t e = 0; e < solid.faces[f].outline.size(); ++e) {
        const auto [c, d] = ends(solid.faces[f], e);
        if (glm::distance(a, d) < 1e-9 && glm::distance(b, c) < 1e-9) return false;
      }
    return true;
  }

  void find_pieces(std::size_t s, std::size_t f, std::size_t e,
                   std::vector<EdgePiece>& pieces) const {
    const auto [a, b] = ends(solids_[s].faces[f], e);
    const auto pa = on_pinhole(a), pb = on_pinhole(b);
    if (!pa || !pb) return;
    // Shares of the edge in the world are not those in the picture; over one piece they nearly are.
    for (const fit::Share& share : fit::cut(glm::distance(*pa, *pb), fit::corner_px)) {
      EdgePiece piece{view_, s, f, e, share.from, share.to, {}, {}, 0};
      if (find_light(piece, a + share.from * (b - a), a + share.to * (b - a)))
        pieces.push_back(piece);
    }
  }

  std::optional<glm::dvec2> on_pinhole(const glm::dvec3& p) const {
    return fit::on_pinhole(views_.lens, pose_.rotation * p + pose_.translation);
  }

  bool is_near_paper(const glm::dvec2& point) const {
    for (const Quad& paper : papers_) {
      const glm::dvec3 normal = glm::cross(paper[1] - paper[0], paper[3] - paper[0]);
      if (glm::dot(eye_ - paper[0], normal) <= 0) continue;  // it faces away
      for (std::size_t i = 0; i < paper.size(); ++i) {
        const auto a = on_pinhole(paper[i]), b = on_pinhole(paper[(i + 1) % paper.size()]);
        if (a && b && distance_px(point, *a, *b) < near_paper_px) return true;
      }
    }
    return false;
  }

  bool find_light(EdgePiece& piece, const glm::dvec3& a, const glm::dvec3& b) const {
    const auto pa = on_pinhole(a), pb = on_pinhole(b);
    if (!pa || !pb || !fit::pixel_of(views_.lens, *pa) || !fit::pixel_of(views_.lens, *pb))
      return false;
    if (glm::distance(*pa, *pb) < fit::shortest_px) return false;
    for (const double share : {0.02, 0.5, 0.98})
      if (is_hidden(solids_, eye_, a + share * (b - a)) || is_near_paper(*pa + share * (*pb - *pa)))
        return false;
    const Frame& frame = *views_.views[view_].frame;
    const auto luminance = [&](int x, int y) { return photometry_.luminance(frame, x, y); };
    const auto light = fit::find_light(luminance, views_.lens, *pa, *pb);
    if (!light) return false;
    piece.a = light->a;
    piece.b = light->b;
    piece.variance_px2 = std::max(light->var_a, light->var_b);
    return true;
  }

  const Views& views_;
  const std::vector<Solid>& solids_;
  const std::vector<Quad>& papers_;
  std::size_t view_;
  tracking::CameraFromWorld pose_;
  glm::dvec3 eye_;
  tracking::Photometry photometry_;
};

}  // namespace

std::vector<EdgePiece> find_edges(const Parts& parts, const Layout& layout, const Views& views,
                                  const Shape& shape, const ResponseCurve& response) {
  const std::vector<Solid> solids = solids_of(parts, layout, shape);
  const std::vector<Quad> papers = papers_of(parts, layout, views, shape);
  std::vector<EdgePiece> pieces;
  for (std::size_t v = 0; v < views.views.size(); ++v)
    if (views.views[v].frame)
      Finder(views, solids, papers, v, adjusted_pose(views.views[v], shape.cameras_off[v]),
             response)
          .find(parts, pieces);
  return pieces;
}

glm::dvec2 edge_off(const EdgePiece& piece, const Views& views, const Shape& shape,
                    const std::vector<Solid>& solids) {
  const Face& face = solids[piece.solid].faces[piece.face];
  const glm::dvec3 &a = face.outline[piece.edge],
                   &b = face.outline[(piece.edge + 1) % face.outline.size()];
  const tracking::CameraFromWorld pose =
      adjusted_pose(views.views[piece.view], shape.cameras_off[piece.view]);
  const glm::dvec2 along = glm::normalize(piece.b - piece.a);
  const auto off = [&](double share) {
    const auto px =
        fit::on_pinhole(views.lens, pose.rotation * (a + share * (b - a)) + pose.translation);
    if (!px) return std::numeric_limits<double>::quiet_NaN();
    return along.x * (*px - piece.a).y - along.y * (*px - piece.a).x;
  };
  return {off(piece.from), off(piece.to)};
}

}  // namespace previz::model
