// Reads radiance by direction from a picture of an unfolded cube, as HDRShop and others write it.
#pragma once

#include <array>
#include <optional>

#include "daemon/core/lighting/linear_picture.hpp"

namespace previz::lighting {

// A face as it lies in the picture. The direction of the point (s, t) of it, from -1 to 1
// rightwards and downwards, is forward + s right + t down.
struct CubeFace {
  glm::vec3 forward, right, down;
  int column, row;  // place in the picture, counted in faces
};

// An unfolded cube as one sees it from inside. The face in its middle is +X, as the middle of a
// latitude-longitude picture is; +Y is to its left, -Y to its right, +Z above and -Z below. -X is
// upside down below -Z in a vertical cross, and at the right end of a horizontal one.
struct CubeCross {
  int columns, rows;  // of the picture, in faces
  std::array<CubeFace, 6> faces;

  const CubeFace* face_at(int column, int row) const;  // null: no face is there
};

// Returns the cross that has this picture's aspect, 3:4 or 4:3; null if none has.
const CubeCross* cross_of(const LinearPicture& picture);
// Returns whether the parts of the picture that are no face are of one colour each, which tells a
// cross from a photograph of the same aspect.
bool is_bare_beside(const CubeCross& cross, const LinearPicture& picture);

// The faces, each with a margin of a pixel from its neighbours, so that light is continuous over
// the cube's edges.
class Cube {
 public:
  Cube(const CubeCross& cross, const LinearPicture& picture);

  // Returns radiance, bilinear between pixel centres, by a direction of any length.
  glm::vec3 towards(const glm::vec3& direction) const;

 private:
  std::size_t face_towards(const glm::vec3& direction) const;
  glm::vec3& texel(std::size_t face, int x, int y);

  const CubeCross& cross_;
  int size_;                       // pixels on the side of a face
  std::array<std::size_t, 6> of_;  // the face by axis and sign: +X, -X, +Y, ...
  std::vector<glm::vec3> texels_;
};

}  // namespace previz::lighting
