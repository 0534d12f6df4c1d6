#include "daemon/tools/calibrate/sensor/paper.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "daemon/core/lighting/response.hpp"
#include "daemon/core/pipeline/preview_size.hpp"
#include "daemon/core/scene/real_world.hpp"
#include "daemon/core/tracking/tag_family.hpp"
#include "drivers/calibration/pinhole.hpp"

namespace previz::calibrate {
namespace {

constexpr double least_cell_px = 3;
constexpr std::size_t least_cells = 2;
constexpr double most_slant = 0.2;  // least cosine of a tag's normal and the way to the camera
// The paper above its tag, so that the model of what it lies on, which is off by a millimetre or
// two, does not hide it.
constexpr double above_m = 4e-3;
constexpr int rendered_px = 16;            // of a tag's picture, about
constexpr double least_seen_share = 0.25;  // share of that picture
constexpr std::size_t most_tags = 4;       // of a shot, the largest first

// A square of the tag's size with its white border.
scene::Mesh square(const set::Tag& tag, double half_m) {
  scene::Mesh mesh;
  mesh.name = paper_name;
  const glm::dvec3 normal(tag.world_from_tag[2]);
  for (const glm::dvec2 corner : {glm::dvec2(-1, -1), {1, -1}, {1, 1}, {-1, 1}}) {
    const glm::dvec4 at(half_m * corner.x, half_m * corner.y, above_m, 1);
    mesh.positions.emplace_back(tag.world_from_tag * at);
    mesh.normals.emplace_back(normal);
  }
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

ObserverCalibration cropped(ObserverCalibration camera, const glm::ivec2& low,
                            const glm::ivec2& high) {
  PinholeIntrinsics& lens = camera.intrinsics;
  lens.cx -= low.x;
  lens.cy -= low.y;
  lens.width = high.x - low.x;
  lens.height = high.y - low.y;
  return camera;
}

// A tag in a picture: its white cells' middles, and the part of the picture that it takes.
struct SeenTag {
  std::vector<glm::dvec2> white;
  glm::ivec2 low{0}, high{0};  // the end is not in it
  double cell_px = 0;
};

// Returns the rows and columns of the white cells that have the fewest black ones around them,
// which a lens blurs into them: what lies beside the paper counts as black.
std::vector<glm::ivec2> whitest(const tracking::TagCells& cells) {
  const auto is_black = [&](int row, int column) {
    return row < 0 || column < 0 || row >= cells.total || column >= cells.total ||
           cells.black(row, column);
  };
  std::vector<std::pair<int, glm::ivec2>> white;
  for (int row = 0; row < cells.total; ++row)
    for (int column = 0; column < cells.total; ++column) {
      if (is_black(row, column)) continue;
      int black = 0;
      for (int i = 0; i < 9; ++i) {
        const int y = i / 3 - 1, x = i % 3 - 1;
        if (is_black(row + y, column + x)) black += x == 0 || y == 0 ? 3 : 1;
      }
      white.emplace_back(black, glm::ivec2(row, column));
    }
  std::ranges::stable_sort(white, {}, [](const auto& cell) { return cell.first; });
  if (white.empty()) return {};
  const std::size_t enough = std::min(2 * least_cells, white.size());
  std::vector<glm::ivec2> result;
  for (const auto& [black, cell] : white)
    if (black <= white[enough - 1].first) result.push_back(cell);
  return result;
}

}  // namespace

struct Paper::Impl {
  struct Printed {
    set::Tag tag;
    tracking::TagCells cells;
    double cell_m;
  };

  Impl(const set::Set& set, const ObserverCalibration& the_camera, const scene::Scene& scene,
       const std::shared_ptr<render::Device>& device, int the_samples)
      : camera(the_camera),
        sampling(set.lighting.sampling),
        samples(the_samples),
        renderer(device, paired(set), the_camera),
        identity(device, paired(set), the_camera) {
    pixels.surfaces = {{paper_name, glm::dvec3(paper_albedo), least_cells}};
    scene::Scene the_scene = scene::real_world(scene);
    scene::Material paper;
    paper.name = paper_name;
    paper.base_color = glm::vec3(static_cast<float>(paper_albedo));
    paper.specular = 0;
    const auto material = static_cast<std::uint32_t>(the_scene.materials.size());
    the_scene.materials.push_back(paper);
    for (const set::Tag& tag : set.tracking.tags) {
      tracking::TagCells cells = tracking::tag_cells(set.tracking.family, tag.id);
      const double cell_m = tag.size_m / cells.border;
      const auto mesh = static_cast<std::uint32_t>(the_scene.meshes.size());
      the_scene.meshes.push_back(square(tag, 0.5 * cell_m * cells.total));
      the_scene.instances.push_back({.name = paper_name, .mesh = mesh, .material = material});
      printed.push_back({tag, std::move(cells), cell_m});
    }
    renderer.set_scene(the_scene);
    for (std::size_t i = 0; i < the_scene.materials.size(); ++i) {
      scene::Material& plain = the_scene.materials[i];
      plain = {};
      plain.base_color = glm::vec3(0);
      plain.specular = 0;
      if (i == material) plain.emission = glm::vec3(1);
    }
    the_scene.lights.clear();
    identity.set_scene(the_scene);
    identity.set_environment(darkness(), set::LightSampling::bsdf);
  }

  std::optional<glm::dvec2> pixel(const glm::dvec3& in_camera) const;
  std::optional<SeenTag> seen(const Printed& tag, const glm::dmat4& world_from_camera) const;
  std::optional<glm::dvec3> rendered(const SeenTag& tag, const ProbedShot& shot);
  void add(const ProbedShot& shot);

  const ObserverCalibration camera;
  const set::LightSampling sampling;
  const int samples;
  std::vector<Printed> printed;
  SurfacePixels pixels;
  bool was_large = false, was_unclipped = false;  // some tag in some picture
  render::Renderer renderer, identity;
};

std::optional<glm::dvec2> Paper::Impl::pixel(const glm::dvec3& in_camera) const {
  if (!(in_camera.z > 0)) return std::nullopt;
  const glm::dvec2 normalised = glm::dvec2(in_camera) / in_camera.z;
  const glm::dvec2 at = distort(camera.intrinsics, normalised);
  return is_unfolded(camera.intrinsics, normalised, at) ? std::optional(at) : std::nullopt;
}

// Returns nothing where the tag is not wholly in the picture, faces away or is too small.
std::optional<SeenTag> Paper::Impl::seen(const Printed& tag,
                                         const glm::dmat4& world_from_camera) const {
  const glm::dmat4 camera_from_tag = glm::inverse(world_from_camera) * tag.tag.world_from_tag;
  const auto at = [&](double row, double column) {
    const double middle = 0.5 * tag.cells.total;
    const glm::dvec4 in_tag(tag.cell_m * (column - middle), tag.cell_m * (middle - row), 0, 1);
    return pixel(glm::dvec3(camera_from_tag * in_tag));
  };
  const glm::dvec3 to_camera = -glm::normalize(glm::dvec3(camera_from_tag[3]));
  if (glm::dot(glm::normalize(glm::dvec3(camera_from_tag[2])), to_camera) < most_slant) return {};
  const double end = tag.cells.total;
  glm::dvec2 low(HUGE_VAL), high(-HUGE_VAL);
  for (const auto& [row, column] : {std::pair{0.0, 0.0}, {0.0, end}, {end, 0.0}, {end, end}}) {
    const auto corner = at(row, column);
    if (!corner) return {};
    low = glm::min(low, *corner);
    high = glm::max(high, *corner);
  }
  const PinholeIntrinsics& lens = camera.intrinsics;
  SeenTag result;
  result.low = glm::ivec2(glm::floor(low));
  result.high = glm::ivec2(glm::ceil(high)) + 1;
  if (result.low.x < 0 || result.low.y < 0 || result.high.x > lens.width ||
      result.high.y > lens.height)
    return {};
  const auto middle = at(end / 2, end / 2), right = at(end / 2, end / 2 + 1),
             down = at(end / 2 + 1, end / 2);
  if (!middle || !right || !down) return {};
  result.cell_px = std::min(glm::distance(*middle, *right), glm::distance(*middle, *down));
  if (result.cell_px < least_cell_px) return {};
  for (const glm::ivec2& cell : whitest(tag.cells))
    if (const auto centre = at(cell.x + 0.5, cell.y + 0.5)) result.white.push_back(*centre);
  return result;
}

// Returns the mean radiance of the tag's paper under the shot's light, where it is seen.
std::optional<glm::dvec3> Paper::Impl::rendered(const SeenTag& tag, const ProbedShot& shot) {
  const ObserverCalibration crop = cropped(camera, tag.low, tag.high);
  const int longest = std::max(crop.intrinsics.width, crop.intrinsics.height);
  const ObserverCalibration small =
      pipeline::scaled(crop, std::min(1.0, double(rendered_px) / longest));
  const render::FrameInput input{.exposure = 1, .world_from_camera = shot.world_from_camera};
  const auto layers_of = [&](render::Renderer& which, int count) {
    which.resize(small);
    which.begin(input);
    which.render(count);
    return which.layers();
  };
  constexpr int identity_samples = 16;
  const render::Layers paper = layers_of(identity, identity_samples);
  renderer.set_environment(shot.light->lighting.environment, sampling);
  const render::Layers lit = layers_of(renderer, samples);
  glm::dvec3 sum(0);
  std::size_t count = 0;
  for (std::size_t i = 0; i < lit.real.size(); ++i) {
    if (paper.real[i].g < 1 - 1e-3f) continue;
    sum += glm::dvec3(lit.real[i]);
    ++count;
  }
  if (double(count) < least_seen_share * double(lit.real.size())) return std::nullopt;
  return sum / double(count);
}

void Paper::Impl::add(const ProbedShot& shot) {
  std::vector<SeenTag> tags;
  for (const Printed& one : printed)
    if (auto tag = seen(one, shot.world_from_camera)) tags.push_back(*std::move(tag));
  std::ranges::sort(tags, std::greater(), &SeenTag::cell_px);
  tags.resize(std::min(tags.size(), most_tags));
  was_large = was_large || !tags.empty();

  const Plate& plate = *shot.plate;
  const lighting::Response response(camera.response, plate.bits);
  const std::uint32_t clipped = response.clipping().at;
  for (const SeenTag& tag : tags) {
    std::vector<SurfacePixel> white;
    SurfacePixel pixel;
    for (const SurfacePixel& other : pixels.pixels)
      pixel.tile = std::max(pixel.tile, other.tile + 1);
    for (const glm::dvec2& at : tag.white) {
      const auto i = std::size_t(std::lround(at.y)) * std::size_t(plate.width) +
                     std::size_t(std::lround(at.x));
      const std::uint16_t* sample = &plate.samples[3 * i];
      if (std::any_of(sample, sample + 3,
                      [&](std::uint16_t code) { return code == 0 || code >= clipped; }))
        continue;
      for (int c = 0; c < 3; ++c) pixel.plate[c] = response.inverse()[sample[c]] / shot.exposure;
      pixel.px = at;
      white.push_back(pixel);
    }
    if (white.size() < least_cells) continue;
    was_unclipped = true;
    const auto radiance = rendered(tag, shot);
    if (!radiance) continue;
    for (SurfacePixel& one : white) one.rendered = *radiance;
    pixels.pixels.insert(pixels.pixels.end(), white.begin(), white.end());
  }
}

Paper::Paper(const set::Set& set, const ObserverCalibration& camera, const scene::Scene& scene,
             const std::shared_ptr<render::Device>& device, int samples)
    : impl_(std::make_unique<Impl>(set, camera, scene, device, samples)) {}
Paper::~Paper() = default;

void Paper::look_at(const ProbedShot& shot) {
  impl_->add(shot);
}

const SurfacePixels& Paper::seen() const {
  return impl_->pixels;
}

std::string Paper::why_not() const {
  if (!impl_->pixels.pixels.empty()) return {};
  if (impl_->printed.empty()) return "the set has no tags";
  if (!impl_->was_large)
    return fmt::format(
        "no picture has a whole tag whose cells are at least {:.0f} px wide; film one from nearer",
        least_cell_px);
  if (!impl_->was_unclipped)
    return "it is overexposed wherever a tag is large enough; expose less, or film it in the shade";
  return "the model of what is real hides it wherever a tag is large enough; look whether its "
         "surfaces lie above the tags";
}

}  // namespace previz::calibrate
