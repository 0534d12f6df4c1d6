#include "daemon/tools/model/fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <limits>
#include <opencv2/core.hpp>
#include <utility>

#include "daemon/core/tracking/least_squares.hpp"
#include "daemon/tools/model/solids.hpp"
#include "daemon/tools/model/unknowns.hpp"
#include "drivers/error.hpp"

namespace previz::model {
namespace {

// A point that lies on a plane may be so far off it: no table is flatter.
constexpr double flatness_m = 2e-4;
// Derivatives are central differences over so many metres or radians either way.
constexpr double step = 1e-6;
// The share of the information that its least known direction must have to be known at all.
constexpr double least_information = 1e-12;

// Residuals, in standard deviations, of a settled shape.
using Residuals = std::vector<double>;
struct Observation {
  std::size_t count = 0;
  std::function<void(const Shape&, double*)> residuals;
};

// Returns what a ray that is marked shows of a place: of a rim, the point that is nearest to it.
glm::dvec3 shown_place(const Shape& s, const Place& place, const Ray& ray) {
  const bool is_upper = place.kind == Place::Kind::upper_rim;
  if (is_upper || place.kind == Place::Kind::lower_rim)
    return rim_point(s.cylinders[place.part], is_upper, ray.origin, ray.direction);
  return place_of(s, place);
}

// A mark of a point that belongs to a part.
struct UsedMark {
  std::size_t view = 0;
  const Mark* mark = nullptr;
  Place place;
  glm::dvec3 direction{0, 0, 1};  // in the camera's axes
};

std::vector<UsedMark> used_marks(const Views& views, const Layout& layout) {
  std::vector<UsedMark> used;
  for (std::size_t v = 0; v < views.views.size(); ++v)
    for (const Mark& mark : views.views[v].marks)
      if (const auto place = layout.places.find(mark.point); place != layout.places.end())
        used.push_back(
            {v, &mark, place->second,
             views.views[v].pose.pose.rotation * ray_of(views, views.views[v], mark).direction});
  return used;
}

// Returns measured less projected, px.
glm::dvec2 mark_off(const Views& views, const UsedMark& used, const Shape& s) {
  const tracking::CameraFromWorld pose =
      adjusted_pose(views.views[used.view], s.cameras_off[used.view]);
  const glm::dmat4 camera = tracking::world_from_camera(pose);
  const Ray ray{glm::dvec3(camera[3]), glm::dmat3(camera) * used.direction};
  return used.mark->px -
         projected(views.lens, pose.rotation * shown_place(s, used.place, ray) + pose.translation);
}

void observe_marks(const Parts& parts, const Views& views, const Layout& layout,
                   std::vector<Observation>& all) {
  for (const UsedMark& used : used_marks(views, layout))
    all.push_back({2, [&views, used, sigma = parts.mark_px](const Shape& s, double* out) {
                     const glm::dvec2 off = mark_off(views, used, s) / sigma;
                     out[0] = off.x, out[1] = off.y;
                   }});
}

// Returns the inverse of a square root of the covariance: W with W^T W = C^-1.
cv::Matx66d whitening(const std::array<double, 36>& covariance) {
  cv::Matx66d root = cv::Matx66d::zeros();  // Cholesky's lower factor
  for (int r = 0; r < 6; ++r)
    for (int c = 0; c <= r; ++c) {
      double sum = covariance[std::size_t(6 * r + c)];
      for (int k = 0; k < c; ++k) sum -= root(r, k) * root(c, k);
      root(r, c) = r == c ? std::sqrt(std::max(sum, 1e-20)) : sum / root(c, c);
    }
  return root.inv();
}

void observe_cameras(const Views& views, std::vector<Observation>& all) {
  for (std::size_t v = 0; v < views.views.size(); ++v)
    all.push_back(
        {6, [v, white = whitening(views.views[v].pose.covariance)](const Shape& s, double* out) {
           const cv::Matx61d off = white * cv::Matx61d(s.cameras_off[v].data());
           std::copy_n(off.val, 6, out);
         }});
}

void observe_tags(const Layout& layout, std::vector<Observation>& all) {
  for (const FlatTag& flat : layout.tags)
    all.push_back({4, [flat, at = corners_of(*flat.tag)](const Shape& s, double* out) {
                     const Plane ground = ground_of(flat, s);
                     for (std::size_t i = 0; i < 4; ++i)
                       out[i] = (glm::dot(at[i] - ground.at, ground.normal) - flat.thickness_m) /
                                tag_sigma_m;
                   }});
}

void observe_on_plane(std::size_t plane, const Place& place, std::vector<Observation>& all) {
  all.push_back({1, [plane, place](const Shape& s, double* out) {
                   const Plane& on = s.planes[plane];
                   out[0] = glm::dot(place_of(s, place) - on.at, on.normal) / flatness_m;
                 }});
}

void observe_points(const Parts& parts, const Layout& layout, std::vector<Observation>& all) {
  for (std::size_t p = 0; p < parts.planes.size(); ++p) {
    for (const std::string& name : points_on(parts.planes[p]))
      observe_on_plane(p, layout.places.at(name), all);
    for (const std::string& name : parts.planes[p].foot)
      observe_on_plane(*layout.plane_on[p], layout.places.at(name), all);
  }
}

// All pieces are one observation, so that the solids are made once.
void observe_edges(const Parts& parts, const Views& views, const Layout& layout,
                   const std::vector<EdgePiece>& pieces, std::vector<Observation>& all) {
  if (pieces.empty()) return;
  all.push_back({2 * pieces.size(), [&](const Shape& s, double* out) {
                   std::vector<Solid> solids;
                   try {
                     solids = solids_of(parts, layout, s);
                   } catch (const Error&) {  // a step that goes too far is not taken
                     std::fill_n(out, 2 * pieces.size(), std::numeric_limits<double>::quiet_NaN());
                     return;
                   }
                   for (const EdgePiece& piece : pieces) {
                     const double sigma =
                         std::sqrt(piece.variance_px2 + edge_sigma_px * edge_sigma_px);
                     const glm::dvec2 off = edge_off(piece, views, s, solids) / sigma;
                     *out++ = off.x;
                     *out++ = off.y;
                   }
                 }});
}

class Problem {
 public:
  struct Equations {
    double cost = 0;
    Residuals residuals;
    cv::Mat1d jacobian, information, gradient;
  };

  Problem(const Parts& parts, const Views& views, const Start& start,
          const std::vector<EdgePiece>& edges)
      : layout_(start.layout), unknowns_(unknowns_of(parts, start)) {
    observe_marks(parts, views, layout_, observations_);
    observe_cameras(views, observations_);
    observe_tags(layout_, observations_);
    observe_points(parts, layout_, observations_);
    observe_edges(parts, views, layout_, edges, observations_);
    for (const Observation& o : observations_) rows_ += o.count;
  }

  const std::vector<Unknown>& unknowns() const { return unknowns_; }
  std::size_t rows() const { return rows_; }

  Residuals residuals(Shape shape) const {
    settle(layout_, shape);
    Residuals all(rows_);
    std::size_t row = 0;
    for (const Observation& o : observations_) {
      o.residuals(shape, &all[row]);
      row += o.count;
    }
    return all;
  }

  // Returns d(values)/d(unknown) of values that are computed of a shape.
  template <class Values>
  std::vector<double> slope(const Shape& at, std::size_t unknown, const Values& values) const {
    Shape less = at, more = at;
    unknowns_[unknown].move(less, -step);
    unknowns_[unknown].move(more, step);
    settle(layout_, less);
    settle(layout_, more);
    std::vector<double> a = values(less);
    const std::vector<double> b = values(more);
    for (std::size_t i = 0; i < a.size(); ++i) a[i] = (b[i] - a[i]) / (2 * step);
    return a;
  }

  Equations evaluate(const Shape& shape) const {
    Equations e;
    e.residuals = residuals(shape);
    for (const double r : e.residuals) e.cost += 0.5 * r * r;
    return e;
  }

  void linearise(const Shape& shape, Equations& e) const {
    const int n = int(unknowns_.size());
    cv::Mat1d& jacobian = e.jacobian;
    jacobian.create(int(rows_), n);
    for (int u = 0; u < n; ++u) {
      // Residuals are measured less predicted.
      const auto column =
          slope(shape, std::size_t(u), [&](const Shape& s) { return residuals(s); });
      for (int r = 0; r < jacobian.rows; ++r) jacobian(r, u) = -column[std::size_t(r)];
    }
    e.information = jacobian.t() * jacobian;
    e.gradient = jacobian.t() * cv::Mat1d(e.residuals, true);
  }

  std::optional<Shape> stepped(const Shape& from, const Equations& e, double damping) const {
    const auto by = tracking::damped_step(e.information, e.gradient, damping);
    if (!by) return {};
    Shape to = from;
    for (std::size_t u = 0; u < unknowns_.size(); ++u) unknowns_[u].move(to, (*by)(int(u)));
    settle(layout_, to);
    return to;
  }

 private:
  const Layout& layout_;
  std::vector<Unknown> unknowns_;
  std::vector<Observation> observations_;
  std::size_t rows_ = 0;
};

// Throws where a direction of the unknowns changes nothing that was observed.
void insist_on_information(const Parts& parts, const Problem& problem,
                           const cv::Mat1d& information) {
  const auto units = tracking::units_of(information);
  cv::Mat1d values, vectors;
  cv::eigen(tracking::in_units(information, units), values, vectors);
  for (int u = 0; u < information.rows; ++u)
    if (!(information(u, u) > 0))
      throw Error(
          fmt::format("{}: nothing that is marked shows where \"{}\" is; mark more of its points",
                      parts.file.string(), problem.unknowns()[std::size_t(u)].part));
  const int last = values.rows - 1;
  if (values(last) > least_information * values(0)) return;
  int most = 0;
  for (int u = 0; u < vectors.cols; ++u)
    if (std::abs(vectors(last, u)) > std::abs(vectors(last, most))) most = u;
  throw Error(fmt::format(
      "{}: what is marked leaves open how \"{}\" lies; mark more of its points, in pictures from "
      "other sides",
      parts.file.string(), problem.unknowns()[std::size_t(most)].part));
}

std::vector<MarkResidual> mark_residuals(const Views& views, const Layout& layout,
                                         const Shape& shape) {
  std::vector<MarkResidual> all;
  for (const UsedMark& used : used_marks(views, layout))
    all.push_back(
        {views.views[used.view].name, used.mark->point, glm::length(mark_off(views, used, shape))});
  return all;
}

// A mark on a rim says how far the rim is, and nothing about where on it the mark is.
std::size_t rim_marks(const Views& views, const Layout& layout) {
  return static_cast<std::size_t>(
      std::ranges::count_if(used_marks(views, layout), [](const UsedMark& used) {
        return used.place.kind == Place::Kind::upper_rim ||
               used.place.kind == Place::Kind::lower_rim;
      }));
}

// Returns what a mark that is far off may be owed to: in a box, the order of the corners as well.
std::string likely_faults(const Parts& parts, const std::string& point) {
  for (const BoxPart& box : parts.boxes)
    for (const auto* corners : {&box.top, &box.bottom})
      if (std::ranges::find(*corners, point) != corners->end())
        return fmt::format(
            "check that top and bottom of \"{}\" list its corners in order around, that the same "
            "corner is meant in all pictures, and this mark",
            box.name);
  return "check this mark, that the same point is meant in all pictures, and that it belongs to "
         "the right part";
}

void insist_on_marks(const Parts& parts, const std::vector<MarkResidual>& marks) {
  const auto worst = std::ranges::max_element(marks, {}, &MarkResidual::off_px);
  if (worst == marks.end() || worst->off_px <= most_off * parts.mark_px) return;
  throw Error(
      fmt::format("{}: point \"{}\" in {} is {:.1f} px from where the other marks put it; {}",
                  parts.file.string(), worst->point, worst->picture, worst->off_px,
                  likely_faults(parts, worst->point)));
}

// Returns how far the corners of each face lie along its normal as it is now.
std::vector<double> heights_of(const std::vector<Solid>& reference,
                               const std::vector<Solid>& solids) {
  std::vector<double> heights;
  for (std::size_t s = 0; s < reference.size(); ++s)
    for (std::size_t f = 0; f < reference[s].faces.size(); ++f) {
      const glm::dvec3 normal = normal_of(reference[s].faces[f]);
      for (const glm::dvec3& p : reference[s].faces[f].outline) {
        // The distance of the other face's plane from this corner.
        const Face& other = solids[s].faces[f];
        const glm::dvec3 its_normal = normal_of(other);
        heights.push_back(glm::dot(other.outline.front() - p, its_normal) /
                          glm::dot(normal, its_normal));
      }
    }
  return heights;
}

std::vector<FaceAccuracy> accuracies(const Parts& parts, const Layout& layout,
                                     const Problem& problem, const Shape& shape,
                                     const cv::Mat1d& covariance) {
  const std::vector<Solid> solids = solids_of(parts, layout, shape);
  std::vector<std::vector<double>> slopes;
  for (std::size_t u = 0; u < problem.unknowns().size(); ++u)
    slopes.push_back(problem.slope(
        shape, u, [&](const Shape& s) { return heights_of(solids, solids_of(parts, layout, s)); }));
  std::vector<FaceAccuracy> all;
  std::size_t row = 0;
  for (const Solid& solid : solids)
    for (const Face& face : solid.faces) {
      double most = 0;
      for (std::size_t i = 0; i < face.outline.size(); ++i, ++row) {
        cv::Mat1d by(1, int(slopes.size()));
        for (int u = 0; u < by.cols; ++u) by(u) = slopes[std::size_t(u)][row];
        most = std::max(most, cv::Mat1d(by * covariance * by.t())(0));
      }
      all.push_back({solid.name, face.name, std::sqrt(most)});
    }
  return all;
}

// Returns how many of the first rows of residuals are left to show the noise, which are those that
// the unknowns do not follow: rows less the trace of J C J^T.
double redundancy_of(const cv::Mat1d& jacobian, const cv::Mat1d& covariance, int rows) {
  if (rows == 0) return 0;
  const cv::Mat1d j = jacobian.rowRange(0, rows);
  return rows - cv::sum((j * covariance).mul(j))[0];
}

}  // namespace

Fit adjust(const Parts& parts, const Views& views, const Start& start,
           const std::vector<EdgePiece>& edges) {
  const Problem problem(parts, views, start, edges);
  if (problem.unknowns().empty()) {  // scans only, which their tags place
    Fit fit;
    fit.shape = start.shape;
    return fit;
  }
  const auto found = tracking::least_squares(problem, start.shape, {200, 1e-3, 1e-12});
  if (found.why == tracking::Stopped::outside)
    throw Error(parts.file.string() +
                ": a part lies behind a camera that has it marked; check that the same "
                "points are meant in all pictures");
  Problem::Equations at = problem.evaluate(found.at);
  problem.linearise(found.at, at);
  Fit fit;
  fit.shape = found.at;
  fit.marks = mark_residuals(views, start.layout, fit.shape);
  insist_on_marks(parts, fit.marks);
  insist_on_information(parts, problem, at.information);
  const std::vector<Solid> solids = solids_of(parts, start.layout, fit.shape);
  for (const EdgePiece& piece : edges) {
    const glm::dvec2 off = edge_off(piece, views, fit.shape, solids);
    fit.edges_off_px.push_back(0.5 * (std::abs(off.x) + std::abs(off.y)));
  }
  double squares = 0;
  for (const MarkResidual& mark : fit.marks) squares += mark.off_px * mark.off_px;
  fit.rms_px = fit.marks.empty() ? 0 : std::sqrt(squares / double(fit.marks.size()));
  const double rims = double(rim_marks(views, start.layout));
  const double freedom = double(problem.rows()) - rims - double(problem.unknowns().size());
  fit.noise_factor = freedom > 0 ? std::sqrt(std::max(1.0, 2 * at.cost / freedom)) : 1;
  if (const auto covariance = tracking::inverse_of(at.information)) {
    const double redundancy =
        redundancy_of(at.jacobian, *covariance, 2 * int(fit.marks.size())) - rims;
    if (redundancy > 0.5) fit.mark_factor = std::sqrt(squares / redundancy) / parts.mark_px;
    fit.noise_factor = std::max(fit.noise_factor, fit.mark_factor);
    fit.faces = accuracies(parts, start.layout, problem, fit.shape,
                           fit.noise_factor * fit.noise_factor * *covariance);
  }
  return fit;
}

Fit adjust_to_edges(const Parts& parts, const Views& views, const Start& start,
                    const ResponseCurve& response) {
  constexpr int rounds = 3;
  Fit fit = adjust(parts, views, start);
  for (int round = 0; round < rounds; ++round) {
    std::vector<EdgePiece> edges = find_edges(parts, start.layout, views, fit.shape, response);
    if (edges.empty()) return fit;
    Fit next = adjust(parts, views, {start.layout, fit.shape}, edges);
    std::vector<double> sorted = next.edges_off_px;
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::ranges::nth_element(sorted, middle);
    const double most = std::max(4 * edge_sigma_px, 4 * *middle);
    std::vector<EdgePiece> kept;
    for (std::size_t i = 0; i < edges.size(); ++i)
      if (next.edges_off_px[i] <= most) kept.push_back(edges[i]);
    fit = adjust(parts, views, {start.layout, next.shape}, kept);
  }
  return fit;
}

}  // namespace previz::model
