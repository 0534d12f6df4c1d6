#include "daemon/core/render/device/device.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <utility>

#include "daemon/core/render/device/graphics_cards.hpp"
#include "daemon/core/report/log.hpp"
#include "drivers/error.hpp"

namespace previz::render {
namespace {

// Samples of a pixel that a submission may have: on a card at first, of which nobody knows yet how
// fast it is, and on a CPU device, where nothing ends what takes long: a frame of 1920x1080
// with 16.
constexpr std::uint64_t first_work = 1u << 21, cpu_work = 1u << 25;

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
  if (!features.get<vk::PhysicalDeviceVulkan12Features>().timelineSemaphore)
    return "no timelineSemaphore";
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

bool can_export_pictures(const vk::raii::PhysicalDevice& physical) {
  const vk::PhysicalDeviceExternalImageFormatInfo shared(
      vk::ExternalMemoryHandleTypeFlagBits::eOpaqueFd);
  vk::PhysicalDeviceImageFormatInfo2 image(card_picture_format, vk::ImageType::e2D,
                                           vk::ImageTiling::eOptimal, card_picture_usage);
  image.pNext = &shared;
  try {
    const auto properties =
        physical.getImageFormatProperties2<vk::ImageFormatProperties2,
                                           vk::ExternalImageFormatProperties>(image);
    return static_cast<bool>(properties.get<vk::ExternalImageFormatProperties>()
                                 .externalMemoryProperties.externalMemoryFeatures &
                             vk::ExternalMemoryFeatureFlagBits::eExportable);
  } catch (const vk::SystemError&) {  // no such images, shared or not
    return false;
  }
}

bool has_extension(const vk::raii::PhysicalDevice& physical, std::string_view name) {
  return std::ranges::any_of(physical.enumerateDeviceExtensionProperties(),
                             [&](const vk::ExtensionProperties& extension) {
                               return std::string_view(extension.extensionName) == name;
                             });
}

bool has_uniform_subgroups(const vk::raii::PhysicalDevice& physical) {
  if (!has_extension(physical, VK_KHR_SHADER_SUBGROUP_UNIFORM_CONTROL_FLOW_EXTENSION_NAME))
    return false;
  using Feature = vk::PhysicalDeviceShaderSubgroupUniformControlFlowFeaturesKHR;
  return physical.getFeatures2<vk::PhysicalDeviceFeatures2, Feature>()
      .get<Feature>()
      .shaderSubgroupUniformControlFlow;
}

constexpr const char* ray_extensions[] = {VK_KHR_RAY_QUERY_EXTENSION_NAME,
                                          VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
                                          VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME};

bool has_ray_queries(const vk::raii::PhysicalDevice& physical) {
  if (!std::ranges::all_of(ray_extensions,
                           [&](const char* name) { return has_extension(physical, name); }))
    return false;
  using Structures = vk::PhysicalDeviceAccelerationStructureFeaturesKHR;
  using Queries = vk::PhysicalDeviceRayQueryFeaturesKHR;
  const auto features =
      physical.getFeatures2<vk::PhysicalDeviceFeatures2, vk::PhysicalDeviceVulkan12Features,
                            Structures, Queries>();
  return features.get<vk::PhysicalDeviceVulkan12Features>().bufferDeviceAddress &&
         features.get<Structures>().accelerationStructure && features.get<Queries>().rayQuery;
}

// Returns what names the device for OpenGL ES, if images that it makes can be shared with that.
std::optional<CardIdentity> card_of(const vk::raii::PhysicalDevice& physical) {
  if (!has_extension(physical, VK_KHR_EXTERNAL_MEMORY_FD_EXTENSION_NAME) ||
      !can_export_pictures(physical))
    return std::nullopt;
  const auto ids =
      physical.getProperties2<vk::PhysicalDeviceProperties2, vk::PhysicalDeviceIDProperties>()
          .get<vk::PhysicalDeviceIDProperties>();
  CardIdentity card;
  std::ranges::copy(ids.deviceUUID, card.device.begin());
  std::ranges::copy(ids.driverUUID, card.driver.begin());
  return card;
}

// Returns the family whose queues compute and do not draw, if there is one: the display's pictures
// need not wait for ours there, and some drivers let its work take longer. Otherwise one that
// computes.
auto compute_family(const std::vector<vk::QueueFamilyProperties>& families) {
  using Flag = vk::QueueFlagBits;
  const auto computes = [](const vk::QueueFamilyProperties& family) {
    return static_cast<bool>(family.queueFlags & Flag::eCompute);
  };
  const auto only = std::ranges::find_if(families, [&](const vk::QueueFamilyProperties& family) {
    return computes(family) && !(family.queueFlags & Flag::eGraphics);
  });
  return only != families.end() ? only : std::ranges::find_if(families, computes);
}

}  // namespace

Device::Device(DeviceOptions options) : options_(std::move(options)) {
  open(true);
}

Device::Device(DeviceOptions options, Awaited awaited)
    : options_(std::move(options)), had_gpu_(awaited.gpu) {}

Device::~Device() {
  try {
    keep_programs();
  } catch (const vk::SystemError&) {  // it is lost, and its next start compiles anew
  }
}

void Device::keep_programs() {
  if (is_open()) programs_.save();
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
  keep_programs();
  programs_.close();
  memory_.close();
  submissions_.reset();
  device_.clear();
  physical_.clear();
  messenger_.clear();
  instance_.clear();
}

DeviceWork Device::work() const {
  DeviceWork work = submissions_->work;
  work.pipelines_awaited = programs_.awaited();
  work.pipelines_ahead = programs_.made_ahead();
  return work;
}

void Device::open(bool cpu_too) {
  try {
    create_instance();
    pick_physical_device(options_.name, cpu_too);
    create_device();
    publish({name_, is_cpu_, is_cpu_ && had_gpu_});
    had_gpu_ |= !is_cpu_;
  } catch (const vk::SystemError& error) {
    // Without any driver there is not even an instance.
    if (!*instance_) note_missing_drivers({});
    throw Error(std::string("Vulkan: ") + error.what() + missing_lines());
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
  // In C's structure, since the C++ one has another type of function in each version.
  VkDebugUtilsMessengerCreateInfoEXT info{};
  info.sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT;
  info.messageSeverity = VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT |
                         VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
  info.messageType =
      VK_DEBUG_UTILS_MESSAGE_TYPE_GENERAL_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT;
  info.pfnUserCallback = &on_message;
  info.pUserData = &validation_messages_;
  messenger_ =
      vk::raii::DebugUtilsMessengerEXT(instance_, vk::DebugUtilsMessengerCreateInfoEXT(info));
}

void Device::pick_physical_device(const std::string& wanted_name, bool cpu_too) {
  std::string found;
  std::vector<std::uint32_t> vendors;
  bool is_integrated = false;
  int best = 1000;
  for (auto& physical : vk::raii::PhysicalDevices(instance_)) {
    const auto properties = physical.getProperties();
    const std::string name = properties.deviceName;
    std::string lack = lacks(physical);
    const bool is_cpu = properties.deviceType == vk::PhysicalDeviceType::eCpu;
    if (lack.empty() && is_cpu && !cpu_too) lack = "a CPU; waiting for a GPU";
    found += "\n  " + name + (lack.empty() ? "" : " (" + lack + ")");
    if (!is_cpu) vendors.push_back(properties.vendorID);
    if (!lack.empty() || name.find(wanted_name) == std::string::npos) continue;
    if (rank(properties.deviceType) >= best) continue;
    best = rank(properties.deviceType);
    physical_ = std::move(physical);
    name_ = name;
    limits_ = properties.limits;
    is_cpu_ = is_cpu;
    is_integrated = properties.deviceType == vk::PhysicalDeviceType::eIntegratedGpu;
  }
  note_missing_drivers(vendors);
  if (best == 1000)
    throw Error("Vulkan: no usable device" +
                (wanted_name.empty() ? "" : " named \"" + wanted_name + "\"") +
                "; found:" + (found.empty() ? " none" : found) + missing_lines());
  memory_.open(physical_, name_, is_cpu_,
               !shares_host_memory() && (is_integrated || options_.as_integrated));
}

void Device::note_missing_drivers(std::span<const std::uint32_t> vendors) {
  missing_drivers_ = drivers_missing(graphics_cards(options_.sys), vendors);
  if (!options_.name.empty() || std::exchange(missing_is_said_, true)) return;
  for (const std::string& missing : missing_drivers_)
    report::log({report::Severity::warning, "render", missing});
}

std::string Device::missing_lines() const {
  std::string lines;
  for (const std::string& missing : missing_drivers_) lines += "\n  " + missing;
  return lines;
}

void Device::choose_rays() {
  scratch_alignment_ = 0;
  if (!options_.hardware_rays.value_or(!is_cpu_)) return;
  if (has_ray_queries(physical_)) {
    using Properties = vk::PhysicalDeviceAccelerationStructurePropertiesKHR;
    scratch_alignment_ = physical_.getProperties2<vk::PhysicalDeviceProperties2, Properties>()
                             .get<Properties>()
                             .minAccelerationStructureScratchOffsetAlignment;
  } else if (options_.hardware_rays) {
    report::log({report::Severity::warning, "render",
                 name_ + ": cannot trace rays in hardware, because its driver lacks "
                         "VK_KHR_ray_query; compute shaders trace them, more slowly. Update the "
                         "driver, or leave out --hardware-rays"});
  }
}

void Device::create_device() {
  const auto families = physical_.getQueueFamilyProperties();
  const auto family = compute_family(families);
  if (family == families.end()) throw Error("Vulkan: " + name_ + " has no compute queue");
  queue_family_ = static_cast<std::uint32_t>(family - families.begin());
  allows_ = limits_of(physical_);
  choose_rays();

  const float priority = 1.0f;
  const vk::DeviceQueueCreateInfo queue({}, queue_family_, 1, &priority);
  vk::PhysicalDeviceVulkan13Features features13;
  features13.synchronization2 = VK_TRUE;
  features13.maintenance4 = VK_TRUE;  // for LocalSizeId, which glslang emits for Vulkan 1.3
  vk::PhysicalDeviceVulkan12Features features12;
  features12.scalarBlockLayout = VK_TRUE;
  features12.timelineSemaphore = VK_TRUE;
  features12.pNext = &features13;
  vk::DeviceCreateInfo info({}, queue);
  info.pNext = &features12;
  std::vector<const char*> extensions;
  card_ = shares_host_memory() ? std::nullopt : card_of(physical_);
  if (card_) extensions.push_back(VK_KHR_EXTERNAL_MEMORY_FD_EXTENSION_NAME);
  imports_host_memory_ =
      shares_host_memory() && has_extension(physical_, VK_EXT_EXTERNAL_MEMORY_HOST_EXTENSION_NAME);
  if (imports_host_memory_) extensions.push_back(VK_EXT_EXTERNAL_MEMORY_HOST_EXTENSION_NAME);
  vk::PhysicalDeviceShaderSubgroupUniformControlFlowFeaturesKHR uniform(VK_TRUE);
  lanes_meet_ = has_uniform_subgroups(physical_);
  if (lanes_meet_) {
    extensions.push_back(VK_KHR_SHADER_SUBGROUP_UNIFORM_CONTROL_FLOW_EXTENSION_NAME);
    features13.pNext = &uniform;
  }
  vk::PhysicalDeviceRayQueryFeaturesKHR queries(VK_TRUE);
  vk::PhysicalDeviceAccelerationStructureFeaturesKHR structures(VK_TRUE);
  if (traces_in_hardware()) {
    for (const char* const extension : ray_extensions) extensions.push_back(extension);
    features12.bufferDeviceAddress = VK_TRUE;
    queries.pNext = std::exchange(features13.pNext, &structures);
    structures.pNext = &queries;
  }
  info.setPEnabledExtensionNames(extensions);
  device_ = vk::raii::Device(physical_, info);
  programs_.open(PipelineCache(physical_, device_, options_.cache));
  // How much a card gets at once depends on how long it takes.
  const bool can_time = !is_cpu_ && families[queue_family_].timestampValidBits > 0;
  submissions_.emplace(physical_, device_, queue_family_,
                       Submissions::Options{.name = name_,
                                            .times_passes = options_.times_passes || can_time,
                                            .most_work = is_cpu_ ? cpu_work : first_work,
                                            .adapts = !is_cpu_,
                                            .host_writes = memory_.mapped_types() != 0,
                                            .builds_structures = traces_in_hardware()});
}

std::string Device::driver() const {
  const auto properties =
      physical_.getProperties2<vk::PhysicalDeviceProperties2, vk::PhysicalDeviceDriverProperties>();
  const auto& driver = properties.get<vk::PhysicalDeviceDriverProperties>();
  const std::string name = driver.driverName, info = driver.driverInfo;
  return info.starts_with(name) ? info : name + " " + info;
}

void Device::record(const std::function<void(const vk::raii::CommandBuffer&)>& record) {
  record(submissions_->recording());
  if (shares_host_memory()) submissions_->finish();
}

DeviceOptions options_for(DeviceOptions options, bool hardware_rays) {
  if (!options.hardware_rays && !hardware_rays) options.hardware_rays = false;
  return options;
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

DeviceFacts facts_of(const Device& device) {
  return {.name = device.name(),
          .driver = device.driver(),
          .is_gpu = !device.is_cpu(),
          .memory_bytes = device.memory().bytes(),
          .shares_host_memory = device.shares_host_memory(),
          .traces_in_hardware = device.traces_in_hardware(),
          .missing_drivers = device.missing_drivers()};
}
void use_scratch(Device& device, std::shared_ptr<Scratch> scratch) {
  device.use_scratch(std::move(scratch));
}
const std::shared_ptr<Scratch>& scratch_of(const Device& device) {
  return device.scratch();
}
void keep_programs(Device& device) {
  device.keep_programs();
}

PictureMemory memory_of(const Device& device) {
  const DeviceLimits& allows = device.allows();
  return {.bytes = device.memory().bytes(),
          .pixels = device.reads_storage() ? allows.storage_bytes / whole_pixel_bytes
                                           : allows.texels / 3 * 2,
          .read_back = device.shares_host_memory(),
          .in_scratch = device.scratch() && device.imports_host_memory()};
}

DeviceTimes take_times(Device& device) {
  return device.clock().take();
}
DeviceWork work_of(const Device& device) {
  return device.work();
}
std::uint64_t validation_messages(const Device& device) {
  return device.validation_messages();
}

}  // namespace previz::render
