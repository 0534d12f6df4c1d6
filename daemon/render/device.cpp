#include "daemon/render/device.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <utility>

#include "daemon/report/log.hpp"
#include "drivers/error.hpp"

namespace previz::render {
namespace {

constexpr std::uint64_t gpu_timeout_ns =
    600'000'000'000;  // 10 minutes; a batch on a slow CPU device takes seconds

VKAPI_ATTR VkBool32 VKAPI_CALL on_message(VkDebugUtilsMessageSeverityFlagBitsEXT severity,
                                          VkDebugUtilsMessageTypeFlagsEXT,
                                          const VkDebugUtilsMessengerCallbackDataEXT* data,
                                          void* user) {
  if (severity >= VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT) {
    static_cast<std::atomic<std::uint64_t>*>(user)->fetch_add(1);
    report::log({report::Severity::error, "vulkan validation", data->pMessage});
  }
  return VK_FALSE;
}

bool has_extension(const vk::raii::Context& context, const char* name) {
  const auto extensions = context.enumerateInstanceExtensionProperties();
  return std::any_of(extensions.begin(), extensions.end(), [&](const auto& extension) {
    return std::strcmp(extension.extensionName, name) == 0;
  });
}

bool has_layer(const vk::raii::Context& context, const char* name) {
  const auto layers = context.enumerateInstanceLayerProperties();
  return std::any_of(layers.begin(), layers.end(), [&](const vk::LayerProperties& layer) {
    return std::strcmp(layer.layerName, name) == 0;
  });
}

// Ranks device types; the lowest rank is preferred.
int rank(vk::PhysicalDeviceType type) {
  switch (type) {
    case vk::PhysicalDeviceType::eDiscreteGpu:
      return 0;
    case vk::PhysicalDeviceType::eIntegratedGpu:
      return 1;
    case vk::PhysicalDeviceType::eVirtualGpu:
      return 2;
    default:
      return 3;
  }
}

// Says what the device lacks to run the renderer; empty if it lacks nothing.
std::string lacks(const vk::raii::PhysicalDevice& physical) {
  if (physical.getProperties().apiVersion < VK_API_VERSION_1_3) return "no Vulkan 1.3";
  const auto features =
      physical.getFeatures2<vk::PhysicalDeviceFeatures2, vk::PhysicalDeviceVulkan12Features,
                            vk::PhysicalDeviceVulkan13Features>();
  if (!features.get<vk::PhysicalDeviceVulkan12Features>().scalarBlockLayout)
    return "no scalarBlockLayout";
  if (!features.get<vk::PhysicalDeviceVulkan13Features>().maintenance4) return "no maintenance4";
  if (!features.get<vk::PhysicalDeviceVulkan13Features>().synchronization2)
    return "no synchronization2";
  const auto subgroup =
      physical.getProperties2<vk::PhysicalDeviceProperties2, vk::PhysicalDeviceVulkan11Properties>()
          .get<vk::PhysicalDeviceVulkan11Properties>();
  if (!(subgroup.subgroupSupportedOperations & vk::SubgroupFeatureFlagBits::eBallot))
    return "no subgroup ballot";
  return {};
}

}  // namespace

Device::Device(DeviceOptions options) : options_(std::move(options)) {
  open(true);
}

void Device::reopen(bool cpu_instead) {
  close();
  open(cpu_instead || !had_gpu_);
}

void Device::publish(Drawing drawing) {
  const std::lock_guard lock(drawing_mutex_);
  drawing_ = std::move(drawing);
}

// The instance is closed too: a card that was gone has another physical device when it is back.
void Device::close() {
  publish({});
  programs_.clear();
  clock_ = {};
  fence_.clear();
  commands_.clear();
  pool_.clear();
  queue_.clear();
  device_.clear();
  physical_.clear();
  messenger_.clear();
  instance_.clear();
}

std::shared_ptr<const Program> Device::program(
    const std::uint32_t* spirv, std::span<const std::uint32_t> constants,
    const std::function<std::shared_ptr<const Program>()>& compile) {
  const std::lock_guard lock(programs_mutex_);
  const auto found = std::ranges::find_if(programs_, [&](const Compiled& each) {
    return each.spirv == spirv && std::ranges::equal(each.constants, constants);
  });
  if (found != programs_.end()) {
    std::rotate(found, found + 1, programs_.end());
  } else {
    ++made_programs_;
    programs_.push_back({spirv, {constants.begin(), constants.end()}, compile()});
    if (programs_.size() > most_programs) programs_.erase(programs_.begin());
  }
  return programs_.back().program;
}

void Device::open(bool cpu_too) {
  try {
    create_instance();
    pick_physical_device(options_.name, cpu_too);
    create_device();
    publish({name_, is_cpu_, is_cpu_ && had_gpu_});
    had_gpu_ |= !is_cpu_;
  } catch (const vk::SystemError& error) {
    throw Error(std::string("Vulkan: ") + error.what());
  }
}

void Device::create_instance() {
  static constexpr const char* layer = "VK_LAYER_KHRONOS_validation";
  if (context_.enumerateInstanceVersion() < VK_API_VERSION_1_3)
    throw Error("Vulkan: the loader is older than 1.3");
  std::vector<const char*> layers;
  std::vector<const char*> extensions;
  if (options_.validation) {
    if (!has_layer(context_, layer))
      throw Error("Vulkan: validation was requested, but the layer " + std::string(layer) +
                  " is not installed (package vulkan-validationlayers)");
    layers.push_back(layer);
    if (options_.synchronization) extensions.push_back(VK_EXT_VALIDATION_FEATURES_EXTENSION_NAME);
  }
  has_labels_ = options_.validation || has_extension(context_, VK_EXT_DEBUG_UTILS_EXTENSION_NAME);
  if (has_labels_) extensions.push_back(VK_EXT_DEBUG_UTILS_EXTENSION_NAME);
  const vk::ApplicationInfo application("previzd", 1, "previzd", 1, VK_API_VERSION_1_3);
  const vk::ValidationFeatureEnableEXT hazards =
      vk::ValidationFeatureEnableEXT::eSynchronizationValidation;
  const vk::ValidationFeaturesEXT features(hazards);
  vk::InstanceCreateInfo create({}, &application, layers, extensions);
  if (options_.validation && options_.synchronization) create.pNext = &features;
  instance_ = vk::raii::Instance(context_, create);
  if (!options_.validation) return;
  using Severity = vk::DebugUtilsMessageSeverityFlagBitsEXT;
  using Type = vk::DebugUtilsMessageTypeFlagBitsEXT;
  vk::DebugUtilsMessengerCreateInfoEXT info({}, Severity::eWarning | Severity::eError,
                                            Type::eGeneral | Type::eValidation, &on_message,
                                            &validation_messages_);
  messenger_ = vk::raii::DebugUtilsMessengerEXT(instance_, info);
}

void Device::pick_physical_device(const std::string& wanted_name, bool cpu_too) {
  std::string found;
  int best = 1000;
  for (auto& physical : vk::raii::PhysicalDevices(instance_)) {
    const auto properties = physical.getProperties();
    const std::string name = properties.deviceName;
    std::string lack = lacks(physical);
    const bool is_cpu = properties.deviceType == vk::PhysicalDeviceType::eCpu;
    if (lack.empty() && is_cpu && !cpu_too) lack = "a CPU; waiting for a GPU";
    found += "\n  " + name + (lack.empty() ? "" : " (" + lack + ")");
    if (!lack.empty() || name.find(wanted_name) == std::string::npos) continue;
    if (rank(properties.deviceType) >= best) continue;
    best = rank(properties.deviceType);
    physical_ = std::move(physical);
    name_ = name;
    limits_ = properties.limits;
    is_cpu_ = is_cpu;
  }
  if (best == 1000)
    throw Error("Vulkan: no usable device" +
                (wanted_name.empty() ? "" : " named \"" + wanted_name + "\"") +
                "; found:" + (found.empty() ? " none" : found));
}

void Device::create_device() {
  const auto families = physical_.getQueueFamilyProperties();
  const auto family = std::find_if(families.begin(), families.end(), [](const auto& properties) {
    return static_cast<bool>(properties.queueFlags & vk::QueueFlagBits::eCompute);
  });
  if (family == families.end()) throw Error("Vulkan: " + name_ + " has no compute queue");
  queue_family_ = static_cast<std::uint32_t>(family - families.begin());
  allows_ = limits_of(physical_);

  const float priority = 1.0f;
  const vk::DeviceQueueCreateInfo queue({}, queue_family_, 1, &priority);
  vk::PhysicalDeviceVulkan13Features features13;
  features13.synchronization2 = VK_TRUE;
  features13.maintenance4 = VK_TRUE;  // for LocalSizeId, which glslang emits for Vulkan 1.3
  vk::PhysicalDeviceVulkan12Features features12;
  features12.scalarBlockLayout = VK_TRUE;
  features12.pNext = &features13;
  vk::DeviceCreateInfo info({}, queue);
  info.pNext = &features12;
  device_ = vk::raii::Device(physical_, info);
  queue_ = vk::raii::Queue(device_, queue_family_, 0);
  pool_ = vk::raii::CommandPool(
      device_, {vk::CommandPoolCreateFlagBits::eResetCommandBuffer, queue_family_});
  commands_ = std::move(
      vk::raii::CommandBuffers(device_, {*pool_, vk::CommandBufferLevel::ePrimary, 1}).front());
  fence_ = vk::raii::Fence(device_, vk::FenceCreateInfo{});
  if (options_.times_passes) clock_ = PassClock(physical_, device_, queue_family_, name_);
}

std::uint32_t Device::memory_type(std::uint32_t allowed_bits, vk::MemoryPropertyFlags wanted,
                                  vk::MemoryPropertyFlags preferred) const {
  const auto properties = physical_.getMemoryProperties();
  for (const auto flags : {wanted | preferred, wanted}) {
    for (std::uint32_t i = 0; i < properties.memoryTypeCount; ++i) {
      const bool has_flags = (properties.memoryTypes[i].propertyFlags & flags) == flags;
      if ((allowed_bits & (1u << i)) != 0 && has_flags) return i;
    }
  }
  throw Error("Vulkan: " + name_ + " has no suitable memory type");
}

std::uint64_t Device::memory_bytes() const {
  // Lavapipe's heap is 2 GiB whatever the computer has.
  if (is_cpu_)
    return static_cast<std::uint64_t>(sysconf(_SC_PHYS_PAGES)) *
           static_cast<std::uint64_t>(sysconf(_SC_PAGE_SIZE));
  std::uint64_t most = 0;
  const auto properties = physical_.getMemoryProperties();
  for (std::uint32_t i = 0; i < properties.memoryHeapCount; ++i)
    if (properties.memoryHeaps[i].flags & vk::MemoryHeapFlagBits::eDeviceLocal)
      most = std::max<std::uint64_t>(most, properties.memoryHeaps[i].size);
  return most;
}

void Device::submit(const std::function<void(const vk::raii::CommandBuffer&)>& record) {
  try {
    ++submissions_;
    commands_.reset();  // it still holds a recording that threw
    commands_.begin({vk::CommandBufferUsageFlagBits::eOneTimeSubmit});
    clock_.begin(commands_);
    record(commands_);
    commands_.end();
    const vk::CommandBuffer raw = *commands_;
    const auto start = std::chrono::steady_clock::now();
    queue_.submit(vk::SubmitInfo({}, {}, raw), *fence_);
    if (device_.waitForFences(*fence_, VK_TRUE, gpu_timeout_ns) != vk::Result::eSuccess)
      throw Error("Vulkan: " + name_ + " did not finish within ten minutes");
    device_.resetFences(*fence_);
    clock_.collect(
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
            .count());
  } catch (const vk::DeviceLostError& error) {
    throw DeviceLost("Vulkan: " + name_ + " is lost: " + error.what());
  } catch (const vk::SystemError& error) {
    throw Error("Vulkan: " + name_ + ": " + error.what());
  }
}

namespace {

// Throws previz::Error where the device does not allow so large a buffer.
void check_buffer(const Device& device, const BufferNeed& need) {
  if (const auto past = past_limits(device.allows(), need))
    throw Error("Vulkan: the scene or the picture needs a buffer of " + past->asked + ", but " +
                device.name() + " allows " + std::to_string(past->allowed) +
                ". Fewer triangles, smaller textures or a smaller picture need less");
}

Buffer create_buffer(Device& device, vk::DeviceSize size, vk::BufferUsageFlags usage,
                     vk::MemoryPropertyFlags wanted, vk::MemoryPropertyFlags preferred) {
  using Usage = vk::BufferUsageFlagBits;
  Buffer result;
  result.size = std::max<vk::DeviceSize>((size + 15) / 16 * 16, 16);
  usage |= Usage::eTransferSrc | Usage::eTransferDst;
  try {
    result.buffer = vk::raii::Buffer(device.vk(), {{}, result.size, usage});
    const auto requirements = result.buffer.getMemoryRequirements();
    const auto type = device.memory_type(requirements.memoryTypeBits, wanted, preferred);
    result.memory = vk::raii::DeviceMemory(device.vk(), {requirements.size, type});
    result.buffer.bindMemory(*result.memory, 0);
  } catch (const vk::DeviceLostError&) {
    throw;
  } catch (const vk::SystemError& error) {
    const bool is_full = error.code() == vk::Result::eErrorOutOfDeviceMemory;
    throw Error("Vulkan: " + device.name() + (is_full ? " is out of memory" : " has no room") +
                " for a buffer of " + std::to_string(result.size) + " bytes" +
                (is_full ? "" : std::string(": ") + error.what()));
  }
  return result;
}

using Memory = vk::MemoryPropertyFlagBits;

// Where the host works in the device's memory, it is mapped and no staging is needed.
Buffer create_device_buffer(Device& device, vk::DeviceSize size, vk::BufferUsageFlags usage) {
  device.count_buffer();
  const vk::MemoryPropertyFlags host = Memory::eHostVisible | Memory::eHostCoherent;
  if (!device.shares_host_memory())
    return create_buffer(device, size, usage, Memory::eDeviceLocal, {});
  Buffer result = create_buffer(device, size, usage, host, Memory::eDeviceLocal);
  result.mapped = result.memory.mapMemory(0, VK_WHOLE_SIZE);
  return result;
}

Buffer create_staging_buffer(Device& device, vk::DeviceSize size) {
  Buffer result = create_buffer(device, size, {}, Memory::eHostVisible | Memory::eHostCoherent,
                                Memory::eHostCached);
  result.mapped = result.memory.mapMemory(0, VK_WHOLE_SIZE);
  return result;
}

}  // namespace

Buffer create_storage_buffer(Device& device, vk::DeviceSize size) {
  check_buffer(device, {size, 0, true});
  return create_device_buffer(device, size, vk::BufferUsageFlagBits::eStorageBuffer);
}

Buffer create_indirect_buffer(Device& device, vk::DeviceSize size) {
  return create_device_buffer(
      device, size,
      vk::BufferUsageFlagBits::eStorageBuffer | vk::BufferUsageFlagBits::eIndirectBuffer);
}

namespace {

vk::DeviceSize texel_bytes_of(vk::Format format) {
  switch (format) {
    case vk::Format::eR32Sfloat:
      return 4;
    case vk::Format::eR32G32Sfloat:
    case vk::Format::eR32G32Uint:
    case vk::Format::eR16G16B16A16Sfloat:
      return 8;
    case vk::Format::eR32G32B32A32Sfloat:
    case vk::Format::eR32G32B32A32Uint:
      return 16;
    default:
      throw Error("Vulkan: no texel buffer of format " + vk::to_string(format));
  }
}

}  // namespace

Buffer create_texel_buffer(Device& device, vk::DeviceSize size, vk::Format format,
                           bool is_storage) {
  using Usage = vk::BufferUsageFlagBits;
  check_buffer(device, {size, size / texel_bytes_of(format), is_storage});
  Buffer result =
      create_device_buffer(device, size, Usage::eUniformTexelBuffer | Usage::eStorageBuffer);
  result.view = vk::raii::BufferView(device.vk(), {{}, *result.buffer, format, 0, VK_WHOLE_SIZE});
  return result;
}

void upload_bytes(Device& device, Buffer& buffer, std::span<const std::byte> bytes,
                  vk::DeviceSize offset) {
  if (bytes.empty()) return;
  if (offset + bytes.size() > buffer.size) throw Error("Vulkan: upload past a buffer's end");
  if (buffer.mapped) {
    std::memcpy(static_cast<std::byte*>(buffer.mapped) + offset, bytes.data(), bytes.size());
    return;
  }
  Buffer staging = create_staging_buffer(device, bytes.size());
  std::memcpy(staging.mapped, bytes.data(), bytes.size());
  device.submit([&](const vk::raii::CommandBuffer& commands) {
    device.clock().start(commands, "copy up");
    commands.copyBuffer(*staging.buffer, *buffer.buffer, vk::BufferCopy(0, offset, bytes.size()));
    device.clock().stop(commands);
    barrier(commands);
  });
}

void read_bytes(Device& device, const Buffer& buffer, vk::DeviceSize size,
                const std::function<void(const std::byte*)>& visit) {
  if (size == 0) return;
  if (buffer.mapped) {
    visit(static_cast<const std::byte*>(buffer.mapped));
    return;
  }
  Buffer staging = create_staging_buffer(device, size);
  device.submit([&](const vk::raii::CommandBuffer& commands) {
    barrier(commands);
    device.clock().start(commands, "copy down");
    commands.copyBuffer(*buffer.buffer, *staging.buffer, vk::BufferCopy(0, 0, size));
    device.clock().stop(commands);
    vk::MemoryBarrier2 to_host(vk::PipelineStageFlagBits2::eCopy,
                               vk::AccessFlagBits2::eTransferWrite,
                               vk::PipelineStageFlagBits2::eHost, vk::AccessFlagBits2::eHostRead);
    commands.pipelineBarrier2(vk::DependencyInfo({}, to_host));
  });
  visit(static_cast<const std::byte*>(staging.mapped));
}

void download_bytes(Device& device, const Buffer& buffer, std::span<std::byte> bytes) {
  read_bytes(device, buffer, bytes.size(),
             [&](const std::byte* from) { std::memcpy(bytes.data(), from, bytes.size()); });
}

void barrier(const vk::raii::CommandBuffer& commands) {
  using Stage = vk::PipelineStageFlagBits2;
  using Access = vk::AccessFlagBits2;
  const vk::MemoryBarrier2 everything(
      Stage::eComputeShader | Stage::eCopy | Stage::eClear,
      Access::eShaderWrite | Access::eTransferWrite,
      Stage::eComputeShader | Stage::eDrawIndirect | Stage::eCopy | Stage::eClear,
      Access::eShaderRead | Access::eShaderWrite | Access::eIndirectCommandRead |
          Access::eTransferRead | Access::eTransferWrite);
  commands.pipelineBarrier2(vk::DependencyInfo({}, everything));
}

void record_clear(const vk::raii::CommandBuffer& commands,
                  std::initializer_list<const Buffer*> buffers) {
  for (const Buffer* buffer : buffers) commands.fillBuffer(*buffer->buffer, 0, VK_WHOLE_SIZE, 0);
  barrier(commands);
}

void record_clear(const vk::raii::CommandBuffer& commands, const Buffer& buffer,
                  vk::DeviceSize bytes) {
  commands.fillBuffer(*buffer.buffer, 0, bytes, 0);
  barrier(commands);
}

std::shared_ptr<Device> open_device(const DeviceOptions& options) {
  return std::make_shared<Device>(options);
}
std::shared_ptr<Device> awaited_gpu(const DeviceOptions& options) {
  return std::make_shared<Device>(options, Device::Awaited{.gpu = true});
}
std::shared_ptr<Device> awaited_device(const DeviceOptions& options) {
  return std::make_shared<Device>(options, Device::Awaited{.gpu = false});
}
void reopen_device(Device& device, bool cpu_instead) {
  device.reopen(cpu_instead);
}
bool is_open(const Device& device) {
  return device.is_open();
}
bool is_gpu(const Device& device) {
  return device.is_open() && !device.is_cpu();
}
// Drivers add to a name in parentheses what nobody looks for on a screen: "llvmpipe (LLVM 15,
// ...)".
std::string drawing_device(const Device& device) {
  const Device::Drawing drawing = device.drawing();
  const std::string name = drawing.name.substr(0, drawing.name.find(" ("));
  return name + (drawing.is_cpu ? " (CPU)" : "");
}
bool cpu_stands_in(const Device& device) {
  return device.drawing().stands_in;
}
std::string device_name(const Device& device) {
  return device.name();
}

PictureMemory memory_of(const Device& device) {
  return {.bytes = device.memory_bytes(),
          .texels = device.limits().maxTexelBufferElements,
          .read_back = device.shares_host_memory()};
}

DeviceTimes take_times(Device& device) {
  return device.clock().take();
}
std::uint64_t validation_messages(const Device& device) {
  return device.validation_messages();
}

}  // namespace previz::render
