#include "daemon/core/lighting/cube_cross.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace previz::lighting {
namespace {

namespace cube {

constexpr glm::vec3 x(1, 0, 0), y(0, 1, 0), z(0, 0, 1);
constexpr glm::vec3 minus_x(-1, 0, 0), minus_y(0, -1, 0), minus_z(0, 0, -1);
constexpr CubeFace above{z, minus_y, x, 1, 0}, left{y, x, minus_z, 0, 1},
    front{x, minus_y, minus_z, 1, 1}, right{minus_y, minus_x, minus_z, 2, 1},
    below{minus_z, minus_y, minus_x, 1, 2};
constexpr CubeFace back{minus_x, y, minus_z, 3, 1}, turned_back{minus_x, minus_y, z, 1, 3};
constexpr CubeCross crosses[] = {{3, 4, {above, left, front, right, below, turned_back}},
                                 {4, 3, {above, left, front, right, below, back}}};

}  // namespace cube

}  // namespace

const CubeFace* CubeCross::face_at(int column, int row) const {
  for (const CubeFace& face : faces)
    if (face.column == column && face.row == row) return &face;
  return nullptr;
}

const CubeCross* cross_of(const LinearPicture& picture) {
  for (const CubeCross& cross : cube::crosses)
    if (std::int64_t{picture.width} * cross.rows == std::int64_t{picture.height} * cross.columns)
      return &cross;
  return nullptr;
}

bool is_bare_beside(const CubeCross& cross, const LinearPicture& picture) {
  const int size = picture.width / cross.columns;
  for (int row = 0; row < cross.rows; ++row)
    for (int column = 0; column < cross.columns; ++column) {
      if (cross.face_at(column, row) != nullptr) continue;
      const glm::vec3& first = picture.at(column * size, row * size);
      for (int j = row * size; j < (row + 1) * size; ++j)
        for (int i = column * size; i < (column + 1) * size; ++i)
          for (int c = 0; c < 3; ++c) {
            // A hundredth is left to compressions with losses. NaN differs from nothing.
            const float value = picture.at(i, j)[c];
            if (std::abs(value - first[c]) > 0.01f * std::max(1.0f, std::abs(first[c])))
              return false;
          }
    }
  return true;
}

Cube::Cube(const CubeCross& cross, const LinearPicture& picture)
    : cross_(cross), size_(picture.width / cross.columns) {
  for (std::size_t face = 0; face < 6; ++face)
    for (int axis = 0; axis < 3; ++axis)
      if (const float along = cross.faces[face].forward[axis]; along != 0)
        of_[static_cast<std::size_t>(2 * axis + (along < 0))] = face;
  const auto side = static_cast<std::size_t>(size_ + 2);
  texels_.resize(6 * side * side);
  const auto pixel = [&](std::size_t face, int i, int j) {
    return picture.at(cross.faces[face].column * size_ + std::clamp(i, 0, size_ - 1),
                      cross.faces[face].row * size_ + std::clamp(j, 0, size_ - 1));
  };
  const auto at = [&](float s) {
    return static_cast<int>(std::floor(0.5f * (s + 1) * static_cast<float>(size_)));
  };
  for (std::size_t f = 0; f < 6; ++f) {
    const CubeFace& face = cross.faces[f];
    for (int j = -1; j <= size_; ++j)
      for (int i = -1; i <= size_; ++i) {
        if (i >= 0 && i < size_ && j >= 0 && j < size_) {
          texel(f, i, j) = pixel(f, i, j);
          continue;
        }
        const auto centre = [&](int index) {
          return static_cast<float>(2 * index + 1) / static_cast<float>(size_) - 1;
        };
        const glm::vec3 direction = face.forward + centre(i) * face.right + centre(j) * face.down;
        const std::size_t other = face_towards(direction);
        const CubeFace& there = cross.faces[other];
        const float ahead = glm::dot(direction, there.forward);
        texel(f, i, j) = pixel(other, at(glm::dot(direction, there.right) / ahead),
                               at(glm::dot(direction, there.down) / ahead));
      }
  }
}

glm::vec3 Cube::towards(const glm::vec3& direction) const {
  const std::size_t f = face_towards(direction);
  const CubeFace& face = cross_.faces[f];
  const float scale = 0.5f * static_cast<float>(size_) / glm::dot(direction, face.forward);
  // Pixel centres are at whole numbers, one more than in the picture because of the margin.
  const float half_side = 0.5f * static_cast<float>(size_ + 1),
              most = static_cast<float>(size_ + 1) - 1e-3f;
  const float i = std::clamp(half_side + scale * glm::dot(direction, face.right), 0.0f, most);
  const float j = std::clamp(half_side + scale * glm::dot(direction, face.down), 0.0f, most);
  const int column = static_cast<int>(i), row = static_cast<int>(j);
  const float s = i - static_cast<float>(column), t = j - static_cast<float>(row);
  const auto side = static_cast<std::size_t>(size_ + 2);
  const glm::vec3* above = &texels_[(f * side + static_cast<std::size_t>(row)) * side +
                                    static_cast<std::size_t>(column)];
  const glm::vec3* below = above + side;
  return (1 - t) * ((1 - s) * above[0] + s * above[1]) + t * ((1 - s) * below[0] + s * below[1]);
}

std::size_t Cube::face_towards(const glm::vec3& direction) const {
  const glm::vec3 size = glm::abs(direction);
  const int axis = size.x >= size.y ? (size.x >= size.z ? 0 : 2) : (size.y >= size.z ? 1 : 2);
  return of_[static_cast<std::size_t>(2 * axis + (direction[axis] < 0))];
}

glm::vec3& Cube::texel(std::size_t face, int i, int j) {
  const auto side = static_cast<std::size_t>(size_ + 2);
  return texels_[(face * side + static_cast<std::size_t>(j + 1)) * side +
                 static_cast<std::size_t>(i + 1)];
}

}  // namespace previz::lighting
