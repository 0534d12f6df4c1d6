// What every layer needs: its place in the chain between the program and the driver. A layer is one
// file that includes this one and defines own_functions().
#pragma once

#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>

#include <cstring>
#include <map>
#include <mutex>
#include <string_view>

namespace {

// The next layer's or the driver's functions, of an instance or of a device of it. Those of
// physical devices are asked for as the instance is created: later, the loader of Debian 12 answers
// with those above this layer.
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

using Functions = std::map<std::string_view, PFN_vkVoidFunction>;
const Functions& own_functions();

PFN_vkVoidFunction own(std::string_view name) {
  const auto found = own_functions().find(name);
  return found != own_functions().end() ? found->second : nullptr;
}

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

}  // namespace

extern "C" VKAPI_ATTR VkResult VKAPI_CALL
vkNegotiateLoaderLayerInterfaceVersion(VkNegotiateLayerInterface* interface) {
  interface->loaderLayerInterfaceVersion = 2;
  interface->pfnGetInstanceProcAddr = instance_function;
  interface->pfnGetDeviceProcAddr = device_function;
  interface->pfnGetPhysicalDeviceProcAddr = nullptr;
  return VK_SUCCESS;
}
