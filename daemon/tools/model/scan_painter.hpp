// Draws a scan as its own colours show it, in parallel projection: what a camera far away would see
// of it in even light.
#pragma once

#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include "daemon/tools/model/embree_surface.hpp"
#include "daemon/tools/model/scan_file.hpp"
#include "drivers/frame.hpp"

namespace previz::model {

// Lengths are in the scan's unit. With `right` turned round the picture is mirrored.
struct ScanView {
  glm::dvec3 corner{0};       // where the centre of the top left pixel looks from
  glm::dvec3 right{1, 0, 0};  // unit vectors
  glm::dvec3 down{0, 1, 0};
  glm::dvec3 forward{0, 0, 1};
  double pixel = 1;
  int width = 0, height = 0;

  glm::dvec3 origin(glm::dvec2 px) const { return corner + pixel * (px.x * right + px.y * down); }
};

class ScanPainter {
 public:
  // The scan must have colours, and must outlive this.
  explicit ScanPainter(const ScanFile& scan);

  // Returns the size of the colours' pixels on the surface, the median over its area: of a texture,
  // or of the triangles between coloured vertices. Zero: no face has coordinates on a texture.
  double grain() const { return grain_; }

  // Draws the front sides of faces, sRGB-encoded; where nothing is, it is grey.
  Frame draw(const ScanView& view) const;

  // Returns where the surface is at a place in the picture; nothing if there is none.
  std::optional<glm::dvec3> surface_at(const ScanView& view, glm::dvec2 px) const;

 private:
  struct Halved {  // a picture, and its halves, quarters, ...
    const ScanPicture* whole = nullptr;
    std::vector<ScanPicture> smaller;
    double grain = 1;
  };
  struct Hit {
    double distance = 0, u = 0, v = 0;
    std::size_t triangle = 0;
  };
  void measure_grain();
  // Returns how many pixels of its texture a triangle covers; 0 where that makes no sense.
  double texels_on(std::size_t triangle, const ScanPicture& picture) const;
  std::optional<Hit> hit(const ScanView& view, glm::dvec2 px) const;
  // Returns each picture halved until its pixels are about as large as these.
  std::vector<const ScanPicture*> pictures_for(double pixel) const;
  double luma(const Hit& hit, const std::vector<const ScanPicture*>& pictures) const;

  const ScanFile& scan_;
  EmbreeSurface surface_;
  std::vector<Halved> pictures_;
  double grain_ = 0;
};

}  // namespace previz::model
