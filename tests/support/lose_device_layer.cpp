// A Vulkan layer for tests: once the file named by PREVIZ_LOSE_DEVICE is there, the device that
// next submits work, or is waited for, is lost, as by its driver (Vulkan 1.3, 5.2.3): from then on
// it answers every submit and every wait with VK_ERROR_DEVICE_LOST. The file is taken away; a
// device made after that works. Where PREVIZ_HIDE_GPU names a file, the devices of the driver,
// whatever they are, say that they are GPUs, and CPU devices while the file is there: as if a GPU
// were gone and only the CPU's driver were left. While PREVIZ_HANG_DEVICE names a file that is
// there, no device is made, and who asks for one waits. Loader and layer interface, version 2.
#include <unistd.h>
#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>

#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <string_view>

namespace {

struct Below {  // the layer or driver below this one, of an instance or a device
  PFN_vkGetInstanceProcAddr instance_address = nullptr;
  PFN_vkGetDeviceProcAddr device_address = nullptr;
  VkInstance instance = VK_NULL_HANDLE;
  VkDevice device = VK_NULL_HANDLE;
  // Of an instance; they are asked for when it is made, since later the loader answers with the
  // ones of this layer.
  PFN_vkGetPhysicalDeviceProperties properties = nullptr;
  PFN_vkGetPhysicalDeviceProperties2 properties2 = nullptr;
  bool is_lost = false;
};

std::mutex mutex;
std::map<void*, Below> known;  // by the loader's dispatch table, which queue and device share

void* key_of(const void* handle) {
  void* key = nullptr;
  std::memcpy(&key, handle, sizeof key);
  return key;
}

template <class Function>
Function below(const Below& link, const char* name) {
  return reinterpret_cast<Function>(link.device != VK_NULL_HANDLE
                                        ? link.device_address(link.device, name)
                                        : link.instance_address(link.instance, name));
}

// The loader's link to what is below, advanced for the layer after this one.
template <class LinkInfo, class CreateInfo>
auto* take_link(const CreateInfo* info, VkStructureType type) {
  auto* chain = reinterpret_cast<LinkInfo*>(const_cast<void*>(info->pNext));
  while (chain != nullptr && !(chain->sType == type && chain->function == VK_LAYER_LINK_INFO))
    chain = reinterpret_cast<LinkInfo*>(const_cast<void*>(chain->pNext));
  if (chain == nullptr) std::abort();  // the loader always gives one
  auto* link = chain->u.pLayerInfo;
  chain->u.pLayerInfo = link->pNext;
  return link;
}

VKAPI_ATTR VkResult VKAPI_CALL create_instance(const VkInstanceCreateInfo* info,
                                               const VkAllocationCallbacks* allocator,
                                               VkInstance* instance) {
  const auto* link =
      take_link<VkLayerInstanceCreateInfo>(info, VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO);
  Below next;
  next.instance_address = link->pfnNextGetInstanceProcAddr;
  const auto create = below<PFN_vkCreateInstance>(next, "vkCreateInstance");
  const VkResult result = create(info, allocator, instance);
  if (result != VK_SUCCESS) return result;
  next.instance = *instance;
  next.properties = below<PFN_vkGetPhysicalDeviceProperties>(next, "vkGetPhysicalDeviceProperties");
  next.properties2 =
      below<PFN_vkGetPhysicalDeviceProperties2>(next, "vkGetPhysicalDeviceProperties2");
  const std::lock_guard lock(mutex);
  known[key_of(*instance)] = next;
  return result;
}

VKAPI_ATTR VkResult VKAPI_CALL create_device(VkPhysicalDevice physical,
                                             const VkDeviceCreateInfo* info,
                                             const VkAllocationCallbacks* allocator,
                                             VkDevice* device) {
  const char* hang = std::getenv("PREVIZ_HANG_DEVICE");
  while (hang != nullptr && access(hang, F_OK) == 0) usleep(10'000);
  const auto* link =
      take_link<VkLayerDeviceCreateInfo>(info, VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO);
  const std::lock_guard lock(mutex);
  Below next = known.at(key_of(physical));
  next.device_address = link->pfnNextGetDeviceProcAddr;
  const auto create = reinterpret_cast<PFN_vkCreateDevice>(
      link->pfnNextGetInstanceProcAddr(next.instance, "vkCreateDevice"));
  const VkResult result = create(physical, info, allocator, device);
  if (result != VK_SUCCESS) return result;
  next.device = *device;
  known[key_of(*device)] = next;
  return result;
}

// Returns the layer or driver below this one, by an instance, a device or what belongs to it.
Below below_of(const void* handle) {
  const std::lock_guard lock(mutex);
  return known.at(key_of(handle));
}

// The same of a device or its queue, which is lost now if the file is there. A lost device does no
// more work, so that what it works with may be destroyed: the driver, which knows of no loss, ends
// it before.
Below below_unless_lost(const void* handle) {
  const char* order = std::getenv("PREVIZ_LOSE_DEVICE");
  const bool is_lost_now = order != nullptr && unlink(order) == 0;
  const std::lock_guard lock(mutex);
  Below& link = known.at(key_of(handle));
  if (!is_lost_now) return link;
  link.is_lost = true;
  below<PFN_vkDeviceWaitIdle>(link, "vkDeviceWaitIdle")(link.device);
  return link;
}

VKAPI_ATTR VkResult VKAPI_CALL queue_submit(VkQueue queue, std::uint32_t count,
                                            const VkSubmitInfo* submits, VkFence fence) {
  const Below link = below_unless_lost(queue);
  if (link.is_lost) return VK_ERROR_DEVICE_LOST;
  return below<PFN_vkQueueSubmit>(link, "vkQueueSubmit")(queue, count, submits, fence);
}

VKAPI_ATTR VkResult VKAPI_CALL wait_semaphores(VkDevice device, const VkSemaphoreWaitInfo* info,
                                               std::uint64_t timeout) {
  const Below link = below_unless_lost(device);
  if (link.is_lost) return VK_ERROR_DEVICE_LOST;
  return below<PFN_vkWaitSemaphores>(link, "vkWaitSemaphores")(device, info, timeout);
}

void disguise(VkPhysicalDeviceProperties& properties) {
  const char* hidden = std::getenv("PREVIZ_HIDE_GPU");
  if (hidden == nullptr) return;
  properties.deviceType = access(hidden, F_OK) == 0 ? VK_PHYSICAL_DEVICE_TYPE_CPU
                                                    : VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU;
}

VKAPI_ATTR void VKAPI_CALL device_properties(VkPhysicalDevice physical,
                                             VkPhysicalDeviceProperties* properties) {
  below_of(physical).properties(physical, properties);
  disguise(*properties);
}

VKAPI_ATTR void VKAPI_CALL device_properties2(VkPhysicalDevice physical,
                                              VkPhysicalDeviceProperties2* properties) {
  below_of(physical).properties2(physical, properties);
  disguise(properties->properties);
}

PFN_vkVoidFunction own(const char* name);

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL device_address(VkDevice device, const char* name) {
  if (const PFN_vkVoidFunction mine = own(name)) return mine;
  return below_of(device).device_address(device, name);
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL instance_address(VkInstance instance, const char* name) {
  if (const PFN_vkVoidFunction mine = own(name)) return mine;
  if (instance == VK_NULL_HANDLE) return nullptr;
  return below_of(instance).instance_address(instance, name);
}

PFN_vkVoidFunction own(const char* name) {
  static const std::map<std::string_view, PFN_vkVoidFunction> functions = {
      {"vkGetInstanceProcAddr", reinterpret_cast<PFN_vkVoidFunction>(instance_address)},
      {"vkGetDeviceProcAddr", reinterpret_cast<PFN_vkVoidFunction>(device_address)},
      {"vkCreateInstance", reinterpret_cast<PFN_vkVoidFunction>(create_instance)},
      {"vkGetPhysicalDeviceProperties", reinterpret_cast<PFN_vkVoidFunction>(device_properties)},
      {"vkGetPhysicalDeviceProperties2", reinterpret_cast<PFN_vkVoidFunction>(device_properties2)},
      {"vkCreateDevice", reinterpret_cast<PFN_vkVoidFunction>(create_device)},
      {"vkQueueSubmit", reinterpret_cast<PFN_vkVoidFunction>(queue_submit)},
      {"vkWaitSemaphores", reinterpret_cast<PFN_vkVoidFunction>(wait_semaphores)}};
  const auto found = functions.find(name);
  return found == functions.end() ? nullptr : found->second;
}

}  // namespace

extern "C" VKAPI_ATTR VkResult VKAPI_CALL
vkNegotiateLoaderLayerInterfaceVersion(VkNegotiateLayerInterface* interface) {
  interface->loaderLayerInterfaceVersion = 2;
  interface->pfnGetInstanceProcAddr = instance_address;
  interface->pfnGetDeviceProcAddr = device_address;
  interface->pfnGetPhysicalDeviceProcAddr = nullptr;
  return VK_SUCCESS;
}
