#include "tests/support/bvh_decode.hpp"

#include <bit>
#include <cmath>

#include "shaders/lib/shared.h"

namespace previz::test {
namespace {

class Visitor {
 public:
  Visitor(const scene::MeshBvh& bvh, const std::function<void(const DecodedRecord&)>& to)
      : bvh_(bvh), to_(to) {}

  std::uint32_t not_inverted = 0;

  void visit(std::uint32_t record, const scene::Aabb& bounds, std::uint32_t level) {
    DecodedRecord decoded{bounds, level, {}, {}};
    const std::uint32_t kind = texel(record, 0).z & 0xffu;
    if (kind == gpu::RECORD_PAIR) {
      add_triangles(record, decoded);
      to_(decoded);
      return;
    }
    std::array<scene::Aabb, 8> boxes;
    for (std::uint32_t slot = 0; slot < 8; ++slot) boxes[slot] = child_box(record, slot);
    const std::uint32_t first = texel(record, 0).w * 8;
    const auto filled = [&](std::uint32_t slot) {
      return (texel(first + slot, 0).z & 0xffu) != gpu::RECORD_NOTHING;
    };
    for (std::uint32_t slot = 0; slot < 8; ++slot) {
      if (filled(slot))
        decoded.children.push_back(boxes[slot]);
      else if (boxes[slot].low.x <= boxes[slot].high.x)
        ++not_inverted;
    }
    to_(decoded);
    for (std::uint32_t slot = 0; slot < 8; ++slot)
      if (filled(slot)) visit(first + slot, boxes[slot], level + 1);
  }

 private:
  const glm::uvec4& texel(std::uint32_t record, std::uint32_t i) const {
    return bvh_.texels.at(record * scene::texels_per_record + i);
  }

  scene::Aabb child_box(std::uint32_t record, std::uint32_t slot) const {
    scene::Aabb box;
    for (int axis = 0; axis < 3; ++axis) {
      const std::uint32_t word = texel(record, 0)[axis];
      const double origin = static_cast<std::int32_t>(word) >> 8;
      const int exponent = static_cast<int>(word & 0xffu) - 127;
      const glm::uvec4& planes = texel(record, 1 + static_cast<std::uint32_t>(axis));
      const std::uint32_t shift = 8 * (slot % 4);
      const auto plane = [&](std::uint32_t byte) {
        return static_cast<float>(origin + std::ldexp(byte & 0xffu, exponent));
      };
      box.low[axis] = plane(planes[static_cast<int>(slot / 4)] >> shift);
      box.high[axis] = plane(planes[static_cast<int>(2 + slot / 4)] >> shift);
    }
    return box;
  }

  void add_triangles(std::uint32_t record, DecodedRecord& decoded) const {
    std::array<glm::vec3, 4> v;
    for (std::uint32_t i = 0; i < 12; ++i)
      v[i / 3][static_cast<int>(i % 3)] =
          std::bit_cast<float>(texel(record, 1 + i / 4)[static_cast<int>(i % 4)]);
    const glm::uvec4& head = texel(record, 0);
    add_triangle(head.x, {v[0], v[1], v[2]}, decoded);
    if (v[3] != v[2]) add_triangle(head.y, {v[0], v[2], v[3]}, decoded);
  }

  static void add_triangle(std::uint32_t word, const std::array<glm::vec3, 3>& stored,
                           DecodedRecord& decoded) {
    const std::uint32_t rotation = (word & 0xffu) - gpu::RECORD_FILL;
    DecodedTriangle triangle{{}, word >> 8};
    for (std::size_t i = 0; i < 3; ++i) triangle.corners[(i + rotation) % 3] = stored[i];
    decoded.triangles.push_back(triangle);
  }

  const scene::MeshBvh& bvh_;
  const std::function<void(const DecodedRecord&)>& to_;
};

}  // namespace

std::uint32_t visit(const scene::MeshBvh& bvh,
                    const std::function<void(const DecodedRecord&)>& to) {
  Visitor visitor(bvh, to);
  visitor.visit(0, {}, 1);
  return visitor.not_inverted;
}

}  // namespace previz::test
