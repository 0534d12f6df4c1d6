// Compiles the modules of write_modules.cpp by the first Vulkan driver that is there, and prints
// what that says of the code that it made (VK_KHR_pipeline_executable_properties). Nothing is run,
// so that the driver may be one for a card that is not there.
//   gpu_code_compile GPU FOLDER      a line for each module, with tabs between:
//     GPU  features  pass  registers  spills  scratch  lanes  instructions  seconds
// registers: of a thread. spills: loads and stores of registers that did not fit; -1: the driver
// does not count them. scratch: bytes of memory a thread, for spills and for private arrays. lanes:
// how many threads a SIMD of AMD holds (of 1024), how many an instruction of Intel has, how many
// warps the registers of an SM of NVIDIA hold (of 48, as of Ada). seconds: to compile it.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>
#include <vulkan/vulkan_raii.hpp>

namespace {

namespace fs = std::filesystem;

std::vector<std::uint32_t> read_words(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  const std::vector<char> bytes(std::istreambuf_iterator<char>(in), {});
  std::vector<std::uint32_t> words(bytes.size() / sizeof(std::uint32_t));
  std::memcpy(words.data(), bytes.data(), words.size() * sizeof(std::uint32_t));
  return words;
}

std::vector<vk::DescriptorSetLayoutBinding> read_bindings(const fs::path& file) {
  std::vector<vk::DescriptorSetLayoutBinding> bindings;
  std::ifstream in(file);
  std::uint32_t number = 0;
  for (std::string type; in >> number >> type;)
    bindings.emplace_back(number,
                          type == "storage"   ? vk::DescriptorType::eStorageBuffer
                          : type == "uniform" ? vk::DescriptorType::eUniformBuffer
                          : type == "texels"  ? vk::DescriptorType::eUniformTexelBuffer
                                              : vk::DescriptorType::eAccelerationStructureKHR,
                          1, vk::ShaderStageFlagBits::eCompute);
  return bindings;
}

constexpr const char* ray_extensions[] = {VK_KHR_RAY_QUERY_EXTENSION_NAME,
                                          VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
                                          VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME};

bool traces_rays(const vk::raii::PhysicalDevice& physical) {
  return std::ranges::any_of(
      physical.enumerateDeviceExtensionProperties(), [](const vk::ExtensionProperties& extension) {
        return std::string_view(extension.extensionName) == VK_KHR_RAY_QUERY_EXTENSION_NAME;
      });
}

// What a driver says of one program, by names of its own.
class Statistics {
 public:
  Statistics(const vk::raii::Device& device, vk::Pipeline pipeline) {
    const auto executables = device.getPipelineExecutablePropertiesKHR({pipeline});
    if (executables.empty()) throw std::runtime_error("the driver says nothing of its code");
    // Intel's lists a program for each width that it has tried; the last is the widest.
    const auto last = static_cast<std::uint32_t>(executables.size() - 1);
    width_ = executables[last].subgroupSize;
    values_ = device.getPipelineExecutableStatisticsKHR({pipeline, last});
  }

  // Returns the sum of what is called by these names; `otherwise` if nothing is.
  double sum(std::initializer_list<const char*> names, double otherwise) const {
    bool is_there = false;
    double sum = 0;
    for (const vk::PipelineExecutableStatisticKHR& each : values_)
      for (const char* name : names)
        if (std::strcmp(each.name, name) == 0) {
          is_there = true;
          sum += each.format == vk::PipelineExecutableStatisticFormatKHR::eFloat64
                     ? each.value.f64
                     : static_cast<double>(each.value.u64);
        }
    return is_there ? sum : otherwise;
  }
  double lanes() const {
    constexpr double lanes_counted = 32;  // RADV counts a wave of 64 lanes as two
    const double of_amd = sum({"Subgroups per SIMD"}, 0) * lanes_counted;
    if (of_amd > 0) return of_amd;
    // An SM has four parts of 16384 registers; a warp of 32 gets a multiple of 8 for each thread.
    const double of_nvidia = std::ceil(sum({"Number of GPRs"}, 0) / 8) * 8;
    return of_nvidia > 0 ? std::min(4 * std::floor(16384 / (32 * of_nvidia)), 48.0) : width_;
  }

 private:
  double width_ = 0;
  std::vector<vk::PipelineExecutableStatisticKHR> values_;
};

vk::raii::Device open(const vk::raii::PhysicalDevice& physical) {
  const float priority = 1;
  const vk::DeviceQueueCreateInfo queue({}, 0, 1, &priority);
  vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR told(VK_TRUE);
  vk::PhysicalDeviceVulkan13Features features13;
  features13.synchronization2 = features13.maintenance4 = VK_TRUE;
  features13.pNext = &told;
  vk::PhysicalDeviceShaderSubgroupUniformControlFlowFeaturesKHR uniform(VK_TRUE);
  told.pNext = &uniform;
  vk::PhysicalDeviceVulkan12Features features12;
  features12.scalarBlockLayout = features12.timelineSemaphore = VK_TRUE;
  features12.pNext = &features13;
  std::vector extensions = {VK_KHR_PIPELINE_EXECUTABLE_PROPERTIES_EXTENSION_NAME,
                            VK_KHR_SHADER_SUBGROUP_UNIFORM_CONTROL_FLOW_EXTENSION_NAME};
  vk::PhysicalDeviceRayQueryFeaturesKHR queries(VK_TRUE);
  vk::PhysicalDeviceAccelerationStructureFeaturesKHR structures(VK_TRUE);
  if (traces_rays(physical)) {
    extensions.insert(extensions.end(), std::begin(ray_extensions), std::end(ray_extensions));
    features12.bufferDeviceAddress = VK_TRUE;
    uniform.pNext = &structures;
    structures.pNext = &queries;
  }
  vk::DeviceCreateInfo info({}, queue, {}, extensions);
  info.pNext = &features12;
  return {physical, info};
}

void compile(const vk::raii::Device& device, const std::string& gpu, const fs::path& file) {
  const std::vector<std::uint32_t> words = read_words(file);
  const auto bindings = read_bindings(fs::path(file).replace_extension(".bindings"));
  const vk::raii::DescriptorSetLayout set(device, {{}, bindings});
  const vk::PushConstantRange push(vk::ShaderStageFlagBits::eCompute, 0, 128);
  const vk::raii::PipelineLayout layout(device, {{}, *set, push});
  const vk::raii::ShaderModule module(device, {{}, words});
  const vk::PipelineShaderStageCreateInfo stage({}, vk::ShaderStageFlagBits::eCompute, *module,
                                                "main");
  const auto start = std::chrono::steady_clock::now();
  const vk::raii::Pipeline pipeline(
      device, nullptr,
      vk::ComputePipelineCreateInfo(vk::PipelineCreateFlagBits::eCaptureStatisticsKHR, stage,
                                    *layout));
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  const Statistics told(device, *pipeline);
  const std::string stem = file.stem();
  const std::size_t dot = stem.find('.');
  std::printf(
      "%s\t%s\t%s\t%.0f\t%.0f\t%.0f\t%.0f\t%.0f\t%.2f\n", gpu.c_str(), stem.substr(0, dot).c_str(),
      stem.substr(dot + 1).c_str(),
      told.sum({"VGPRs", "Max live registers", "Number of GPRs", "Register Count"}, -1),
      told.sum(
          {"Spilled VGPRs", "Spill Count", "Fill Count", "Spills to memory", "Fills from memory"},
          -1),
      told.sum({"Scratch size", "Scratch Memory Size", "SLM Size", "SLM size"}, -1), told.lanes(),
      told.sum({"Instructions", "Instruction Count", "Instruction count"}, -1), seconds.count());
}

void compile_all(const std::string& gpu, const fs::path& folder) {
  const vk::raii::Context context;
  const vk::ApplicationInfo application("previzd", 1, "previzd", 1, VK_API_VERSION_1_3);
  const vk::raii::Instance instance(context, vk::InstanceCreateInfo({}, &application));
  const vk::raii::PhysicalDevices devices(instance);
  if (devices.empty()) throw std::runtime_error("no Vulkan device");
  const vk::raii::PhysicalDevice& physical = devices.front();
  std::fprintf(stderr, "%s: %s\n", gpu.c_str(), physical.getProperties().deviceName.data());
  const vk::raii::Device device = open(physical);
  std::vector<fs::path> modules;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder))
    if (entry.path().extension() == ".spv") modules.push_back(entry.path());
  std::ranges::sort(modules);
  const bool has_queries = traces_rays(physical);
  for (const fs::path& module : modules)
    if (has_queries || !module.stem().string().ends_with("_query")) compile(device, gpu, module);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc != 3) throw std::runtime_error("gpu_code_compile GPU FOLDER");
    compile_all(argv[1], argv[2]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "gpu_code_compile: %s\n", error.what());
    return 1;
  }
  return 0;
}
