// A Vulkan layer that makes the driver below it look like a graphics card: the device has the name
// and the limits in the file that OTHER_CARD names (cards/*.txt), memory of its own that the host
// cannot map, and fresh memory that is full of 0xFF, which are NaNs where floats are read. Drivers
// for CPUs hand out zeros. Below the validation layer it makes that layer hold a program to the
// card's limits. The driver computes as before, and limits may be larger than the driver's own. See
// run.sh.
#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <map>
#include <mutex>
#include <string>
#include <string_view>

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

// What is below this layer, for an instance or for a device of it. Functions of physical devices
// are asked for as the instance is created: later, the loader of Debian 12 answers with those above
// this layer.
struct Below {
  VkInstance instance = VK_NULL_HANDLE;
  PFN_vkGetInstanceProcAddr of_instance = nullptr;
  std::map<std::string_view, PFN_vkVoidFunction> of_physical_devices;
  VkDevice device = VK_NULL_HANDLE;
  PFN_vkGetDeviceProcAddr of_device = nullptr;
};
std::mutex below_mutex;
std::map<void*, Below> below_by_key;

// The first word of every handle is the loader's, and the same for an instance and its physical
// devices.
void* key_of(const void* handle) {
  void* key = nullptr;
  std::memcpy(&key, handle, sizeof key);
  return key;
}

const Below& below(const void* handle) {
  const std::lock_guard lock(below_mutex);
  return below_by_key.at(key_of(handle));
}

void remember(const void* handle, const Below& below) {
  const std::lock_guard lock(below_mutex);
  below_by_key[key_of(handle)] = below;
}

template <class Function>
Function next(const void* handle, const char* name) {
  const Below& link = below(handle);
  if (link.device != VK_NULL_HANDLE)
    return reinterpret_cast<Function>(link.of_device(link.device, name));
  const auto found = link.of_physical_devices.find(name);
  return reinterpret_cast<Function>(found != link.of_physical_devices.end()
                                        ? found->second
                                        : link.of_instance(link.instance, name));
}

// Takes this layer's part from what the loader hands down as an instance or a device is created.
template <class LinkInfo, class CreateInfo>
auto take_link(const CreateInfo& info, VkStructureType type) {
  auto* chain = static_cast<LinkInfo*>(const_cast<void*>(info.pNext));
  while (chain->sType != type || chain->function != VK_LAYER_LINK_INFO)
    chain = static_cast<LinkInfo*>(const_cast<void*>(chain->pNext));
  const auto link = *chain->u.pLayerInfo;
  chain->u.pLayerInfo = chain->u.pLayerInfo->pNext;
  return link;
}

VkResult create_instance(const VkInstanceCreateInfo* info, const VkAllocationCallbacks* allocator,
                         VkInstance* instance) {
  const auto link =
      take_link<VkLayerInstanceCreateInfo>(*info, VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO);
  const auto create = reinterpret_cast<PFN_vkCreateInstance>(
      link.pfnNextGetInstanceProcAddr(nullptr, "vkCreateInstance"));
  const VkResult result = create(info, allocator, instance);
  if (result != VK_SUCCESS) return result;
  Below made{.instance = *instance,
             .of_instance = link.pfnNextGetInstanceProcAddr,
             .of_physical_devices = {}};
  for (const char* name :
       {"vkGetPhysicalDeviceProperties", "vkGetPhysicalDeviceProperties2",
        "vkGetPhysicalDeviceMemoryProperties", "vkGetPhysicalDeviceMemoryProperties2"})
    made.of_physical_devices[name] = made.of_instance(*instance, name);
  remember(*instance, made);
  return result;
}

VkResult create_device(VkPhysicalDevice physical, const VkDeviceCreateInfo* info,
                       const VkAllocationCallbacks* allocator, VkDevice* device) {
  const auto link =
      take_link<VkLayerDeviceCreateInfo>(*info, VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO);
  Below made = below(physical);
  const auto create = reinterpret_cast<PFN_vkCreateDevice>(
      link.pfnNextGetInstanceProcAddr(made.instance, "vkCreateDevice"));
  const VkResult result = create(physical, info, allocator, device);
  if (result != VK_SUCCESS) return result;
  made.device = *device;
  made.of_device = link.pfnNextGetDeviceProcAddr;
  remember(*device, made);
  return result;
}

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

PFN_vkVoidFunction own(std::string_view name);

PFN_vkVoidFunction device_function(VkDevice device, const char* name) {
  const PFN_vkVoidFunction mine = own(name);
  return mine != nullptr ? mine : next<PFN_vkVoidFunction>(device, name);
}

PFN_vkVoidFunction instance_function(VkInstance instance, const char* name) {
  const PFN_vkVoidFunction mine = own(name);
  if (mine != nullptr || instance == VK_NULL_HANDLE) return mine;
  return next<PFN_vkVoidFunction>(instance, name);
}

template <class Function>
PFN_vkVoidFunction untyped(Function* function) {
  return reinterpret_cast<PFN_vkVoidFunction>(function);
}

PFN_vkVoidFunction own(std::string_view name) {
  static const std::map<std::string_view, PFN_vkVoidFunction> functions = {
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
  const auto found = functions.find(name);
  return found != functions.end() ? found->second : nullptr;
}

}  // namespace

extern "C" VKAPI_ATTR VkResult VKAPI_CALL
vkNegotiateLoaderLayerInterfaceVersion(VkNegotiateLayerInterface* interface) {
  interface->loaderLayerInterfaceVersion = 2;
  interface->pfnGetInstanceProcAddr = instance_function;
  interface->pfnGetDeviceProcAddr = device_function;
  interface->pfnGetPhysicalDeviceProcAddr = nullptr;
  return VK_SUCCESS;
}
