// A Vulkan layer that puts each buffer between memory that nobody may touch. A shader that reads or
// writes before a buffer or past it ends the program, and a line says in which pass. It needs a
// driver for CPUs that does not check where shaders read and write, and so runs above SwiftShader
// (run.sh): Mesa's reads zeros there, and drops what is written.
//
// A buffer that shares its memory with others is guarded only where that memory ends.
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "layer.hpp"

namespace {

// An index has 32 bits, and the driver's offsets in a buffer no more than that: nothing gets past
// these.
constexpr std::size_t guard_bytes = std::size_t{4} << 30;

struct Guarded {
  std::byte* all = nullptr;  // the guard before the memory
  std::size_t bytes = 0;     // as asked for
  std::size_t pages = 0;     // what the driver knows of, in bytes; the memory is its end
  std::byte* begin() const { return all + guard_bytes + pages - bytes; }
  std::size_t all_bytes() const { return pages + 2 * guard_bytes; }
};
std::mutex guarded_mutex;
std::map<VkDeviceMemory, Guarded> guarded;

// Each command buffer says where the device is: it writes the number of a pass here before it
// begins.
alignas(65536) volatile std::uint32_t pass_at[16384];
std::vector<std::string> pass_names = {"none"};
std::map<void*, VkBuffer> pass_buffers;  // of a device's key: pass_at

const char* access_of([[maybe_unused]] const void* context) {
#ifdef __x86_64__
  const auto& registers = static_cast<const ucontext_t*>(context)->uc_mcontext.gregs;
  return (registers[REG_ERR] & 2) != 0 ? "wrote" : "read";
#else
  return "read or wrote";
#endif
}

// Takes a lock and prints, as handlers of asynchronous signals may not: this one is raised by a
// shader or a copy of bytes, whose thread holds no lock of ours and prints nothing.
void on_fault(int signal, siginfo_t* info, void* context) {
  std::signal(signal, SIG_DFL);  // what was wrong happens again, without this
  const auto* at = static_cast<const std::byte*>(info->si_addr);
  const std::lock_guard lock(guarded_mutex);
  for (const auto& [memory, each] : guarded)
    if (at >= each.all && at < each.all + each.all_bytes())
      std::fprintf(
          stderr, "guard_pages: %s byte %td of a buffer of %zu in pass \"%s\" or a copy after it\n",
          access_of(context), at - each.begin(), each.bytes, pass_names[pass_at[0]].c_str());
}

VkResult import_memory(VkDevice device, const VkMemoryAllocateInfo& info, void* bytes,
                       std::size_t size, const VkAllocationCallbacks* allocator,
                       VkDeviceMemory* memory) {
  VkImportMemoryHostPointerInfoEXT import = {};
  import.sType = VK_STRUCTURE_TYPE_IMPORT_MEMORY_HOST_POINTER_INFO_EXT;
  import.pNext = info.pNext;
  import.handleType = VK_EXTERNAL_MEMORY_HANDLE_TYPE_HOST_ALLOCATION_BIT_EXT;
  import.pHostPointer = bytes;
  VkMemoryAllocateInfo of_driver = info;
  of_driver.pNext = &import;
  of_driver.allocationSize = size;
  return next<PFN_vkAllocateMemory>(device, "vkAllocateMemory")(device, &of_driver, allocator,
                                                                memory);
}

VkResult create_buffer(VkDevice device, const VkBufferCreateInfo* info,
                       const VkAllocationCallbacks* allocator, VkBuffer* buffer) {
  VkExternalMemoryBufferCreateInfo external = {};
  external.sType = VK_STRUCTURE_TYPE_EXTERNAL_MEMORY_BUFFER_CREATE_INFO;
  external.pNext = info->pNext;
  external.handleTypes = VK_EXTERNAL_MEMORY_HANDLE_TYPE_HOST_ALLOCATION_BIT_EXT;
  VkBufferCreateInfo of_driver = *info;
  of_driver.pNext = &external;
  return next<PFN_vkCreateBuffer>(device, "vkCreateBuffer")(device, &of_driver, allocator, buffer);
}

// The driver's objects live as long as the process.
VkBuffer make_pass_buffer(VkDevice device) {
  VkBufferCreateInfo info = {};
  info.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO;
  info.size = sizeof pass_at;
  info.usage = VK_BUFFER_USAGE_TRANSFER_DST_BIT;
  VkMemoryAllocateInfo allocate = {};
  allocate.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO;
  VkBuffer buffer = VK_NULL_HANDLE;
  VkDeviceMemory memory = VK_NULL_HANDLE;
  void* bytes = const_cast<std::uint32_t*>(pass_at);
  if (create_buffer(device, &info, nullptr, &buffer) != VK_SUCCESS ||
      import_memory(device, allocate, bytes, sizeof pass_at, nullptr, &memory) != VK_SUCCESS ||
      next<PFN_vkBindBufferMemory>(device, "vkBindBufferMemory")(device, buffer, memory, 0) !=
          VK_SUCCESS)
    std::abort();
  return buffer;
}

VkResult create_guarded_device(VkPhysicalDevice physical, const VkDeviceCreateInfo* info,
                               const VkAllocationCallbacks* allocator, VkDevice* device) {
  std::vector<const char*> extensions(info->ppEnabledExtensionNames,
                                      info->ppEnabledExtensionNames + info->enabledExtensionCount);
  extensions.push_back(VK_EXT_EXTERNAL_MEMORY_HOST_EXTENSION_NAME);
  VkDeviceCreateInfo of_driver = *info;
  of_driver.enabledExtensionCount = static_cast<std::uint32_t>(extensions.size());
  of_driver.ppEnabledExtensionNames = extensions.data();
  const VkResult result = create_device(physical, &of_driver, allocator, device);
  if (result != VK_SUCCESS) return result;
  struct sigaction action = {};
  action.sa_sigaction = on_fault;
  action.sa_flags = SA_SIGINFO;
  sigaction(SIGSEGV, &action, nullptr);
  const VkBuffer pass_buffer = make_pass_buffer(*device);
  const std::lock_guard lock(guarded_mutex);
  pass_buffers[key_of(*device)] = pass_buffer;
  return result;
}

bool is_exported(const VkMemoryAllocateInfo& info) {
  for (const auto* each = static_cast<const VkBaseInStructure*>(info.pNext); each != nullptr;
       each = each->pNext)
    if (each->sType == VK_STRUCTURE_TYPE_EXPORT_MEMORY_ALLOCATE_INFO) return true;
  return false;
}

VkResult allocate(VkDevice device, const VkMemoryAllocateInfo* info,
                  const VkAllocationCallbacks* allocator, VkDeviceMemory* memory) {
  if (is_exported(*info))
    return next<PFN_vkAllocateMemory>(device, "vkAllocateMemory")(device, info, allocator, memory);
  const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  Guarded made{.bytes = info->allocationSize,
               .pages = (info->allocationSize + page - 1) / page * page};
  void* all = mmap(nullptr, made.all_bytes(), PROT_NONE,
                   MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (all == MAP_FAILED) return VK_ERROR_OUT_OF_DEVICE_MEMORY;
  made.all = static_cast<std::byte*>(all);
  std::byte* begin = made.all + guard_bytes;
  VkResult result = VK_ERROR_OUT_OF_DEVICE_MEMORY;
  if (mprotect(begin, made.pages, PROT_READ | PROT_WRITE) == 0)
    result = import_memory(device, *info, begin, made.pages, allocator, memory);
  if (result != VK_SUCCESS) {
    munmap(all, made.all_bytes());
    return result;
  }
  const std::lock_guard lock(guarded_mutex);
  guarded[*memory] = made;
  return result;
}

// Returns where the memory begins in that which the driver knows of.
VkDeviceSize begin_of(VkDeviceMemory memory) {
  const std::lock_guard lock(guarded_mutex);
  const auto found = guarded.find(memory);
  return found != guarded.end() ? found->second.pages - found->second.bytes : 0;
}

VkResult bind(VkDevice device, VkBuffer buffer, VkDeviceMemory memory, VkDeviceSize offset) {
  return next<PFN_vkBindBufferMemory>(device, "vkBindBufferMemory")(device, buffer, memory,
                                                                    begin_of(memory) + offset);
}

VkResult map(VkDevice device, VkDeviceMemory memory, VkDeviceSize offset, VkDeviceSize size,
             VkMemoryMapFlags flags, void** bytes) {
  return next<PFN_vkMapMemory>(device, "vkMapMemory")(device, memory, begin_of(memory) + offset,
                                                      size, flags, bytes);
}

// The driver may hand the same handle out as soon as it is free.
Guarded take_guarded(VkDeviceMemory memory) {
  const std::lock_guard lock(guarded_mutex);
  const auto node = guarded.extract(memory);
  return node.empty() ? Guarded{} : node.mapped();
}

void free_memory(VkDevice device, VkDeviceMemory memory, const VkAllocationCallbacks* allocator) {
  const Guarded freed = take_guarded(memory);
  next<PFN_vkFreeMemory>(device, "vkFreeMemory")(device, memory, allocator);
  if (freed.all != nullptr) munmap(freed.all, freed.all_bytes());
}

std::uint32_t number_of(const char* name) {
  const auto found = std::find(pass_names.begin(), pass_names.end(), name);
  const auto number = static_cast<std::uint32_t>(found - pass_names.begin());
  if (found == pass_names.end()) pass_names.emplace_back(name);
  return number;
}

void begin_label(VkCommandBuffer commands, const VkDebugUtilsLabelEXT* label) {
  VkBuffer buffer = VK_NULL_HANDLE;
  std::uint32_t number = 0;
  {
    const std::lock_guard lock(guarded_mutex);
    buffer = pass_buffers.at(key_of(commands));
    number = number_of(label->pLabelName);
  }
  next<PFN_vkCmdUpdateBuffer>(commands, "vkCmdUpdateBuffer")(commands, buffer, 0, sizeof number,
                                                             &number);
  next<PFN_vkCmdBeginDebugUtilsLabelEXT>(commands, "vkCmdBeginDebugUtilsLabelEXT")(commands, label);
}

const Functions& own_functions() {
  static const Functions functions = {
      {"vkGetInstanceProcAddr", untyped(instance_function)},
      {"vkGetDeviceProcAddr", untyped(device_function)},
      {"vkCreateInstance", untyped(create_instance)},
      {"vkCreateDevice", untyped(create_guarded_device)},
      {"vkCreateBuffer", untyped(create_buffer)},
      {"vkAllocateMemory", untyped(allocate)},
      {"vkBindBufferMemory", untyped(bind)},
      {"vkMapMemory", untyped(map)},
      {"vkFreeMemory", untyped(free_memory)},
      {"vkCmdBeginDebugUtilsLabelEXT", untyped(begin_label)},
  };
  return functions;
}

}  // namespace
