// A Vulkan layer that makes the driver below it look like a graphics card: the device has the name
// and the limits in the file that OTHER_CARD names (cards/*.txt), memory of its own that the host
// cannot map, and fresh memory that is full of 0xFF, which are NaNs where floats are read. Drivers
// for CPUs hand out zeros. Below the validation layer it makes that layer hold a program to the
// card's limits. The driver computes as before, and limits may be larger than the driver's own. See
// run.sh.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <map>
#include <string>
#include <string_view>

#include "layer.hpp"

namespace {

struct Card {
  std::string name;
  std::map<std::string, std::uint64_t, std::less<>> limits;
};

// The lines of the file are "name value"; lines that begin with # are for readers.
Card read_card() {
  const char* path = std::getenv("OTHER_CARD");
  std::ifstream file(path != nullptr ? path : "");
  Card card;
  for (std::string line; std::getline(file, line);) {
    const std::size_t space = line.find(' ');
    if (line.starts_with('#') || space == std::string::npos) continue;
    const std::string name = line.substr(0, space);
    if (name == "deviceName")
      card.name = line.substr(space + 1) + " (pretended)";
    else
      card.limits[name] = std::strtoull(line.c_str() + space, nullptr, 10);
  }
  if (!card.name.empty() && !card.limits.empty()) return card;
  std::fprintf(stderr, "OTHER_CARD: names no file that describes a card\n");
  std::abort();
}

const Card& card() {
  static const Card the_card = read_card();
  return the_card;
}

template <class T>
void set(T& limit, std::string_view name) {
  if (const auto found = card().limits.find(name); found != card().limits.end())
    limit = static_cast<T>(found->second);
}

// The driver relies on its own alignment, so it is only ever raised.
void set_alignment(VkDeviceSize& limit, std::string_view name) {
  VkDeviceSize wanted = limit;
  set(wanted, name);
  limit = std::max(limit, wanted);
}

void disguise(VkPhysicalDeviceProperties& properties) {
  properties.deviceType = VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU;
  std::snprintf(properties.deviceName, sizeof properties.deviceName, "%s", card().name.c_str());
  VkPhysicalDeviceLimits& limits = properties.limits;
  set(limits.maxStorageBufferRange, "maxStorageBufferRange");
  set(limits.maxTexelBufferElements, "maxTexelBufferElements");
  set(limits.maxPushConstantsSize, "maxPushConstantsSize");
  set(limits.maxMemoryAllocationCount, "maxMemoryAllocationCount");
  set(limits.maxPerStageDescriptorStorageBuffers, "maxPerStageDescriptorStorageBuffers");
  set(limits.maxPerStageDescriptorSampledImages, "maxPerStageDescriptorSampledImages");
  set(limits.maxPerStageResources, "maxPerStageResources");
  set(limits.maxDescriptorSetStorageBuffers, "maxDescriptorSetStorageBuffers");
  set(limits.maxDescriptorSetSampledImages, "maxDescriptorSetSampledImages");
  set(limits.maxComputeWorkGroupInvocations, "maxComputeWorkGroupInvocations");
  set(limits.maxComputeWorkGroupCount[0], "maxComputeWorkGroupCount[0]");
  set(limits.maxComputeWorkGroupCount[1], "maxComputeWorkGroupCount[1]");
  set(limits.maxComputeWorkGroupCount[2], "maxComputeWorkGroupCount[2]");
  set_alignment(limits.minStorageBufferOffsetAlignment, "minStorageBufferOffsetAlignment");
  set_alignment(limits.minTexelBufferOffsetAlignment, "minTexelBufferOffsetAlignment");
  set_alignment(limits.nonCoherentAtomSize, "nonCoherentAtomSize");
}

void disguise_chain(void* chain) {
  for (auto* next = static_cast<VkBaseOutStructure*>(chain); next != nullptr; next = next->pNext) {
    void* at = next;
    switch (next->sType) {
      case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_PROPERTIES:
        set(static_cast<VkPhysicalDeviceVulkan11Properties*>(at)->maxMemoryAllocationSize,
            "maxMemoryAllocationSize");
        break;
      case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MAINTENANCE_3_PROPERTIES:
        set(static_cast<VkPhysicalDeviceMaintenance3Properties*>(at)->maxMemoryAllocationSize,
            "maxMemoryAllocationSize");
        break;
      case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_PROPERTIES:
        set(static_cast<VkPhysicalDeviceVulkan13Properties*>(at)->maxBufferSize, "maxBufferSize");
        break;
      case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MAINTENANCE_4_PROPERTIES:
        set(static_cast<VkPhysicalDeviceMaintenance4Properties*>(at)->maxBufferSize,
            "maxBufferSize");
        break;
      default:
        break;
    }
  }
}

// Memory types 0: the card's own, which the host cannot map; 1 and 2: the host's, without and with
// cache. All are the driver's type 0.
void disguise(VkPhysicalDeviceMemoryProperties& memory) {
  constexpr VkMemoryPropertyFlags host =
      VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
  memory.memoryHeapCount = 2;
  memory.memoryHeaps[0].flags = VK_MEMORY_HEAP_DEVICE_LOCAL_BIT;
  memory.memoryHeaps[1] = {memory.memoryHeaps[0].size, 0};
  memory.memoryTypeCount = 3;
  memory.memoryTypes[0] = {VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT, 0};
  memory.memoryTypes[1] = {host, 1};
  memory.memoryTypes[2] = {host | VK_MEMORY_PROPERTY_HOST_CACHED_BIT, 1};
}
constexpr std::uint32_t all_types = 0b111;

void get_properties(VkPhysicalDevice device, VkPhysicalDeviceProperties* properties) {
  next<PFN_vkGetPhysicalDeviceProperties>(device, "vkGetPhysicalDeviceProperties")(device,
                                                                                   properties);
  disguise(*properties);
}

void get_properties2(VkPhysicalDevice device, VkPhysicalDeviceProperties2* properties) {
  next<PFN_vkGetPhysicalDeviceProperties2>(device, "vkGetPhysicalDeviceProperties2")(device,
                                                                                     properties);
  disguise(properties->properties);
  disguise_chain(properties->pNext);
}

void get_memory(VkPhysicalDevice device, VkPhysicalDeviceMemoryProperties* memory) {
  next<PFN_vkGetPhysicalDeviceMemoryProperties>(device, "vkGetPhysicalDeviceMemoryProperties")(
      device, memory);
  disguise(*memory);
}

void get_memory2(VkPhysicalDevice device, VkPhysicalDeviceMemoryProperties2* memory) {
  next<PFN_vkGetPhysicalDeviceMemoryProperties2>(device, "vkGetPhysicalDeviceMemoryProperties2")(
      device, memory);
  disguise(memory->memoryProperties);
}

void get_requirements(VkDevice device, VkBuffer buffer, VkMemoryRequirements* requirements) {
  next<PFN_vkGetBufferMemoryRequirements>(device, "vkGetBufferMemoryRequirements")(device, buffer,
                                                                                   requirements);
  requirements->memoryTypeBits = all_types;
}

void get_requirements2(VkDevice device, const VkBufferMemoryRequirementsInfo2* info,
                       VkMemoryRequirements2* requirements) {
  next<PFN_vkGetBufferMemoryRequirements2>(device, "vkGetBufferMemoryRequirements2")(device, info,
                                                                                     requirements);
  requirements->memoryRequirements.memoryTypeBits = all_types;
}

VkResult allocate(VkDevice device, const VkMemoryAllocateInfo* info,
                  const VkAllocationCallbacks* allocator, VkDeviceMemory* memory) {
  VkMemoryAllocateInfo of_driver = *info;
  of_driver.memoryTypeIndex = 0;
  const VkResult result =
      next<PFN_vkAllocateMemory>(device, "vkAllocateMemory")(device, &of_driver, allocator, memory);
  if (result != VK_SUCCESS) return result;
  void* bytes = nullptr;
  if (next<PFN_vkMapMemory>(device, "vkMapMemory")(device, *memory, 0, VK_WHOLE_SIZE, 0, &bytes) !=
      VK_SUCCESS)
    std::abort();
  std::memset(bytes, 0xFF, info->allocationSize);
  next<PFN_vkUnmapMemory>(device, "vkUnmapMemory")(device, *memory);
  return result;
}

const Functions& own_functions() {
  static const Functions functions = {
      {"vkGetInstanceProcAddr", untyped(instance_function)},
      {"vkGetDeviceProcAddr", untyped(device_function)},
      {"vkCreateInstance", untyped(create_instance)},
      {"vkCreateDevice", untyped(create_device)},
      {"vkGetPhysicalDeviceProperties", untyped(get_properties)},
      {"vkGetPhysicalDeviceProperties2", untyped(get_properties2)},
      {"vkGetPhysicalDeviceMemoryProperties", untyped(get_memory)},
      {"vkGetPhysicalDeviceMemoryProperties2", untyped(get_memory2)},
      {"vkGetBufferMemoryRequirements", untyped(get_requirements)},
      {"vkGetBufferMemoryRequirements2", untyped(get_requirements2)},
      {"vkAllocateMemory", untyped(allocate)},
  };
  return functions;
}

}  // namespace
