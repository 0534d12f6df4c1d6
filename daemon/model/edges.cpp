#include "daemon/model/edges.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <optional>

#include "daemon/tracking/edge.hpp"
#include "daemon/tracking/photometry.hpp"

namespace previz::model {
namespace {

constexpr double longest_px = 40, shortest_px = 12;
// So much of an edge is left out at either end, where other edges meet it.
constexpr double corner_px = 4;
// The areas beside an edge must be plain so far.
constexpr double depth_px = 4;
// An edge is found in a wrong place where the areas beside it are not plain: the largest residual
// of a fit, rms over the contrast.
constexpr double most_noise = 0.1;

// Returns where a pinhole shows a point of the camera's axes; nothing behind it.
std::optional<glm::dvec2> on_pinhole(const PinholeIntrinsics& lens, const glm::dvec3& p) {
  if (!(p.z > 0)) return {};
  return glm::dvec2(lens.fx * p.x / p.z + lens.cx, lens.fy * p.y / p.z + lens.cy);
}

bool is_in_picture(const PinholeIntrinsics& lens, const glm::dvec2& px) {
  return px.x > depth_px && px.y > depth_px && px.x < lens.width - 1 - depth_px &&
         px.y < lens.height - 1 - depth_px;
}

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

class Finder {
 public:
  Finder(const Views& views, const std::vector<Solid>& solids, std::size_t view,
         const tracking::CameraFromWorld& pose, const ResponseCurve& response)
      : views_(views),
        solids_(solids),
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
    const auto pa = on_pinhole(views_.lens, pose_.rotation * a + pose_.translation);
    const auto pb = on_pinhole(views_.lens, pose_.rotation * b + pose_.translation);
    if (!pa || !pb) return;
    const double length = glm::distance(*pa, *pb);
    if (length < shortest_px + 2 * corner_px) return;
    // Shares of the edge in the world are not those in the picture; over one piece they nearly are.
    const int count = static_cast<int>(std::ceil((length - 2 * corner_px) / longest_px));
    const double margin = corner_px / length, each = (1 - 2 * margin) / count;
    for (int i = 0; i < count; ++i) {
      EdgePiece piece{view_, s, f, e, margin + i * each, margin + (i + 1) * each, {}, {}, 0};
      if (find_light(piece, a + piece.from * (b - a), a + piece.to * (b - a)))
        pieces.push_back(piece);
    }
  }

  bool find_light(EdgePiece& piece, const glm::dvec3& a, const glm::dvec3& b) const {
    const auto pa = on_pinhole(views_.lens, pose_.rotation * a + pose_.translation);
    const auto pb = on_pinhole(views_.lens, pose_.rotation * b + pose_.translation);
    if (!pa || !pb || !is_in_picture(views_.lens, *pa) || !is_in_picture(views_.lens, *pb))
      return false;
    if (glm::distance(*pa, *pb) < shortest_px) return false;
    for (const double share : {0.02, 0.5, 0.98})
      if (is_hidden(solids_, eye_, a + share * (b - a))) return false;
    const glm::dvec2 along = glm::normalize(*pb - *pa), across(-along.y, along.x);
    const Frame& frame = *views_.views[view_].frame;
    const auto luminance = [&](int x, int y) { return photometry_.luminance(frame, x, y); };
    std::optional<tracking::EdgeFit> best;
    for (const double side : {-1.0, 1.0}) {
      const tracking::EdgeGuess guess{*pa, *pb, *pa + side * depth_px * across, depth_px, depth_px};
      const char* why = nullptr;
      const auto fit = tracking::fit_edge(luminance, views_.lens, guess, &why);
      if (fit && (!best || fit->noise / fit->contrast < best->noise / best->contrast)) best = fit;
    }
    if (!best || best->noise > most_noise * best->contrast) return false;
    piece.a = best->a;
    piece.b = best->b;
    piece.variance_px2 = std::max(best->var_a, best->var_b);
    return true;
  }

  const Views& views_;
  const std::vector<Solid>& solids_;
  std::size_t view_;
  tracking::CameraFromWorld pose_;
  glm::dvec3 eye_;
  tracking::Photometry photometry_;
};

}  // namespace

std::vector<EdgePiece> find_edges(const Parts& parts, const Layout& layout, const Views& views,
                                  const Shape& shape, const ResponseCurve& response) {
  const std::vector<Solid> solids = solids_of(parts, layout, shape);
  std::vector<EdgePiece> pieces;
  for (std::size_t v = 0; v < views.views.size(); ++v)
    if (views.views[v].frame)
      Finder(views, solids, v, adjusted_pose(views.views[v], shape.cameras_off[v]), response)
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
        on_pinhole(views.lens, pose.rotation * (a + share * (b - a)) + pose.translation);
    if (!px) return std::numeric_limits<double>::quiet_NaN();
    return along.x * (*px - piece.a).y - along.y * (*px - piece.a).x;
  };
  return {off(piece.from), off(piece.to)};
}

}  // namespace previz::model
