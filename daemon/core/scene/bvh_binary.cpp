#include "daemon/core/scene/bvh_binary.hpp"

#include <algorithm>
#include <memory>
#include <new>
#include <numeric>
#include <string>
#include <type_traits>

#include "drivers/embree.hpp"
#include "drivers/error.hpp"

namespace previz::scene {
namespace {

// A node that Embree's callbacks allocate; it is freed with Embree's tree.
struct BuiltNode {
  BuiltNode* children[2];
  RTCBuildPrimitive* primitives;  // of a leaf; null for an inner node
  std::size_t count;
};

Aabb bounds_of(const RTCBuildPrimitive& p) {
  return {{p.lower_x, p.lower_y, p.lower_z}, {p.upper_x, p.upper_y, p.upper_z}};
}

void set_bounds(RTCBounds& out, const Aabb& box) {
  out = {box.low.x, box.low.y, box.low.z, 0, box.high.x, box.high.y, box.high.z, 0};
}

void* create_node(RTCThreadLocalAllocator allocator, unsigned, void*) {
  void* memory = rtcThreadLocalAlloc(allocator, sizeof(BuiltNode), 16);
  return new (memory) BuiltNode{};
}

void* create_leaf(RTCThreadLocalAllocator allocator, const RTCBuildPrimitive* primitives,
                  std::size_t count, void*) {
  auto* copy = static_cast<RTCBuildPrimitive*>(
      rtcThreadLocalAlloc(allocator, count * sizeof(RTCBuildPrimitive), 32));
  std::copy_n(primitives, count, copy);
  void* memory = rtcThreadLocalAlloc(allocator, sizeof(BuiltNode), 16);
  return new (memory) BuiltNode{{}, copy, count};
}

void set_children(void* node, void** children, unsigned count, void*) {
  for (unsigned i = 0; i < count; ++i)
    static_cast<BuiltNode*>(node)->children[i] = static_cast<BuiltNode*>(children[i]);
}

void ignore_bounds(void*, const RTCBounds**, unsigned, void*) {}  // computed from the leaves later

void split_primitive(const RTCBuildPrimitive* primitive, unsigned axis, float position,
                     RTCBounds* left, RTCBounds* right, void* user) {
  Aabb left_box, right_box;
  (*static_cast<const SplitPrimitive*>(user))(primitive->primID, bounds_of(*primitive),
                                              static_cast<int>(axis), position, left_box,
                                              right_box);
  set_bounds(*left, left_box);
  set_bounds(*right, right_box);
}

struct Reference {
  Aabb bounds;
  std::uint32_t primitive = 0;
};

std::uint32_t append_balanced(std::vector<BinaryNode>& nodes, std::span<Reference> references) {
  const auto index = static_cast<std::uint32_t>(nodes.size());
  BinaryNode& node = nodes.emplace_back();
  if (references.size() == 1) {
    node = {references[0].bounds, 0, 0, references[0].primitive};
    return index;
  }
  Aabb centres;
  const auto centre = [](const Reference& r) { return r.bounds.low + r.bounds.high; };
  for (const Reference& r : references) {
    centres.low = glm::min(centres.low, centre(r));
    centres.high = glm::max(centres.high, centre(r));
  }
  const glm::vec3 size = centres.high - centres.low;
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  const auto half = static_cast<std::ptrdiff_t>(references.size() / 2);
  std::nth_element(references.begin(), references.begin() + half, references.end(),
                   [&](const Reference& a, const Reference& b) {
                     return centre(a)[axis] != centre(b)[axis] ? centre(a)[axis] < centre(b)[axis]
                                                               : a.primitive < b.primitive;
                   });
  const auto left = append_balanced(nodes, references.first(static_cast<std::size_t>(half)));
  const auto right = append_balanced(nodes, references.subspan(static_cast<std::size_t>(half)));
  nodes[index] = {merged(nodes[left].bounds, nodes[right].bounds), left, right, 0};
  return index;
}

std::uint32_t append(std::vector<BinaryNode>& nodes, const BuiltNode& built) {
  if (built.primitives != nullptr) {
    std::vector<Reference> references;
    for (std::size_t i = 0; i < built.count; ++i)
      references.push_back({bounds_of(built.primitives[i]), built.primitives[i].primID});
    return append_balanced(nodes, references);
  }
  const auto index = static_cast<std::uint32_t>(nodes.size());
  nodes.emplace_back();
  const auto left = append(nodes, *built.children[0]);
  const auto right = append(nodes, *built.children[1]);
  nodes[index] = {merged(nodes[left].bounds, nodes[right].bounds), left, right, 0};
  return index;
}

RTCBuildQuality embree_quality(BvhQuality quality) {
  switch (quality) {
    case BvhQuality::low:
      return RTC_BUILD_QUALITY_LOW;
    case BvhQuality::medium:
      return RTC_BUILD_QUALITY_MEDIUM;
    case BvhQuality::high:
      return RTC_BUILD_QUALITY_HIGH;
  }
  return RTC_BUILD_QUALITY_MEDIUM;
}

using DevicePtr = std::unique_ptr<std::remove_pointer_t<RTCDevice>, decltype(&rtcReleaseDevice)>;
using BvhPtr = std::unique_ptr<std::remove_pointer_t<RTCBVH>, decltype(&rtcReleaseBVH)>;

}  // namespace

std::vector<BinaryNode> build_binary_tree(std::span<const Aabb> boxes, BvhQuality quality,
                                          const SplitPrimitive& split) {
  std::vector<RTCBuildPrimitive> primitives(boxes.size());
  for (std::uint32_t i = 0; i < boxes.size(); ++i)
    primitives[i] = {boxes[i].low.x,  boxes[i].low.y,  boxes[i].low.z,  0,
                     boxes[i].high.x, boxes[i].high.y, boxes[i].high.z, i};
  // The array needs room for the references that spatial splits add.
  if (quality == BvhQuality::high) primitives.resize(boxes.size() * 2);

  const DevicePtr device(rtcNewDevice(nullptr), rtcReleaseDevice);
  if (!device) throw Error("scene: Embree cannot create a device");
  const BvhPtr bvh(rtcNewBVH(device.get()), rtcReleaseBVH);
  RTCBuildArguments arguments = rtcDefaultBuildArguments();
  arguments.buildQuality = embree_quality(quality);
  arguments.maxDepth = 48;
  arguments.maxLeafSize = 1;
  arguments.bvh = bvh.get();
  arguments.primitives = primitives.data();
  arguments.primitiveCount = boxes.size();
  arguments.primitiveArrayCapacity = primitives.size();
  arguments.createNode = create_node;
  arguments.setNodeChildren = set_children;
  arguments.setNodeBounds = ignore_bounds;
  arguments.createLeaf = create_leaf;
  arguments.splitPrimitive = split_primitive;
  arguments.userPtr = const_cast<SplitPrimitive*>(&split);
  const auto* root = static_cast<const BuiltNode*>(rtcBuildBVH(&arguments));
  // Embree fails on trees that grow too deep, but such a scene still has to be drawn.
  if (root == nullptr) {
    if (rtcGetDeviceError(device.get()) == RTC_ERROR_OUT_OF_MEMORY)
      throw Error("scene: out of memory while building a BVH over " + std::to_string(boxes.size()) +
                  " boxes");
    return build_balanced_tree(boxes);
  }
  std::vector<BinaryNode> nodes;
  nodes.reserve(2 * boxes.size());
  append(nodes, *root);
  return nodes;
}

std::vector<BinaryNode> build_balanced_tree(std::span<const Aabb> boxes) {
  std::vector<Reference> references(boxes.size());
  for (std::uint32_t i = 0; i < boxes.size(); ++i) references[i] = {boxes[i], i};
  std::vector<BinaryNode> nodes;
  nodes.reserve(2 * boxes.size());
  append_balanced(nodes, references);
  return nodes;
}

}  // namespace previz::scene
