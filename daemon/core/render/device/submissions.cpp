#include "daemon/core/render/device/submissions.hpp"

#include <algorithm>
#include <chrono>

namespace previz::render {
namespace {

// Ten minutes; a batch on a slow CPU device takes seconds.
constexpr std::uint64_t timeout_ns = 600'000'000'000;

// The watchdog of amdgpu ends what takes ten seconds, others less. A submission that takes a second
// is therefore halved, and one that takes a quarter of it may be larger.
constexpr double long_ms = 1000, short_ms = 250;
constexpr std::uint64_t least_work = 1u << 16, most_work_ever = 1u << 25;

template <typename F>
void named(const std::string& device, const F& call) {
  try {
    call();
  } catch (const vk::DeviceLostError& error) {
    throw DeviceLost("Vulkan: " + device + " is lost: " + error.what());
  } catch (const vk::SystemError& error) {
    throw Error("Vulkan: " + device + ": " + error.what());
  }
}

// Lets the host write where the device has written. What it reads is copied behind a barrier of its
// own.
void barrier_to_host(const vk::raii::CommandBuffer& commands) {
  using Stage = vk::PipelineStageFlagBits2;
  const vk::MemoryBarrier2 to_host(
      Stage::eComputeShader | Stage::eCopy | Stage::eClear,
      vk::AccessFlagBits2::eShaderWrite | vk::AccessFlagBits2::eTransferWrite, Stage::eHost,
      vk::AccessFlagBits2::eHostWrite);
  commands.pipelineBarrier2(vk::DependencyInfo({}, to_host));
}

}  // namespace

Submissions::Submissions(const vk::raii::PhysicalDevice& physical, const vk::raii::Device& device,
                         std::uint32_t queue_family, Options options)
    : device_(device), options_(std::move(options)), queue_(device, queue_family, 0) {
  const vk::SemaphoreTypeCreateInfo timeline(vk::SemaphoreType::eTimeline, 0);
  vk::SemaphoreCreateInfo semaphore;
  semaphore.pNext = &timeline;
  timeline_ = vk::raii::Semaphore(device, semaphore);
  pool_ = vk::raii::CommandPool(device,
                                {vk::CommandPoolCreateFlagBits::eResetCommandBuffer, queue_family});
  vk::raii::CommandBuffers commands(device, {*pool_, vk::CommandBufferLevel::ePrimary,
                                             static_cast<std::uint32_t>(slots_.size())});
  for (std::size_t i = 0; i < slots_.size(); ++i) slots_[i].commands = std::move(commands[i]);
  if (options_.times_passes)
    clock_ = PassClock(physical, device, queue_family, options_.name, slots_.size());
}

Submissions::~Submissions() {
  try {
    await(next_ - 1);
  } catch (const vk::SystemError&) {  // it is lost: nothing is under way
  } catch (const Error&) {            // it hangs, and there is no way to stop it
  }
}

const vk::raii::CommandBuffer& Submissions::recording() {
  Slot& slot = slot_of(next_);
  if (is_recording_) return slot.commands;
  refuse_after_failure();
  if (slot.submission > done_) wait(slot.submission);
  named(options_.name, [&] {
    slot.commands.reset();
    slot.commands.begin({vk::CommandBufferUsageFlagBits::eOneTimeSubmit});
    clock_.begin(next_);
  });
  slot.work = 0;
  is_recording_ = true;
  return slot.commands;
}

void Submissions::flush() {
  if (!is_recording_) return;
  Slot& slot = slot_of(next_);
  is_recording_ = false;
  has_failed_ = true;  // unless all of this goes well: what was recorded is lost otherwise
  named(options_.name, [&] {
    if (options_.host_writes) barrier_to_host(slot.commands);
    slot.commands.end();
    const vk::CommandBuffer commands = *slot.commands;
    const vk::TimelineSemaphoreSubmitInfo values({}, next_);
    vk::SubmitInfo info({}, {}, commands, *timeline_);
    info.pNext = &values;
    queue_.submit(info);
  });
  has_failed_ = false;
  ++work.submissions;
  slot.submission = next_++;
}

void Submissions::refuse_after_failure() const {
  if (has_failed_)
    throw Error("Vulkan: " + options_.name + " did not take what it was given to do");
}

void Submissions::await(std::uint64_t submission) {
  if (device_.waitSemaphores({{}, *timeline_, submission}, timeout_ns) != vk::Result::eSuccess)
    throw Error("Vulkan: " + options_.name + " did not finish within ten minutes");
}

// The semaphore's own value is not asked for: of a device that is being lost it may be any number.
bool Submissions::is_done(std::uint64_t submission) const {
  return device_.waitSemaphores({{}, *timeline_, submission}, 0) == vk::Result::eSuccess;
}

void Submissions::wait(std::uint64_t submission) {
  const auto start = std::chrono::steady_clock::now();
  if (submission == next_) {
    flush();
    refuse_after_failure();
    submission = next_ - 1;
  }
  if (submission <= done_) return;
  ++work.waits;
  named(options_.name, [&] {
    await(submission);
    const std::chrono::duration<double, std::milli> waited =
        std::chrono::steady_clock::now() - start;
    collect(is_done(next_ - 1) ? next_ - 1 : submission, waited.count());
  });
}

void Submissions::collect(std::uint64_t done, double waited_ms) {
  clock_.add_wait(waited_ms);
  for (std::uint64_t submission = done_ + 1; submission <= done; ++submission)
    adapt(slot_of(submission), clock_.collect(submission));
  done_ = done;
  while (!kept_.empty() && kept_.front().first <= done_) kept_.pop_front();
}

void Submissions::adapt(const Slot& slot, double ms) {
  if (!options_.adapts || slot.work == 0) return;
  if (ms > long_ms)
    options_.most_work = std::max(slot.work / 2, least_work);
  else if (ms > 0 && ms < short_ms && clock_.untimed() == 0 && slot.work >= options_.most_work)
    options_.most_work = std::min(2 * options_.most_work, most_work_ever);
}

void Submissions::add_work(std::uint64_t samples) {
  if (!is_recording_) return;
  Slot& slot = slot_of(next_);
  slot.work += samples;
  if (slot.work >= options_.most_work) flush();
}

void Submissions::keep(std::shared_ptr<const void> what) {
  if (!is_idle()) kept_.emplace_back(is_recording_ ? next_ : next_ - 1, std::move(what));
}

void Submissions::barrier(const vk::raii::CommandBuffer& commands) {
  using Stage = vk::PipelineStageFlagBits2;
  using Access = vk::AccessFlagBits2;
  vk::MemoryBarrier2 everything(
      Stage::eComputeShader | Stage::eCopy | Stage::eClear,
      Access::eShaderWrite | Access::eTransferWrite,
      Stage::eComputeShader | Stage::eDrawIndirect | Stage::eCopy | Stage::eClear,
      Access::eShaderRead | Access::eShaderWrite | Access::eIndirectCommandRead |
          Access::eTransferRead | Access::eTransferWrite);
  if (options_.builds_structures) {
    const auto built =
        Access::eAccelerationStructureReadKHR | Access::eAccelerationStructureWriteKHR;
    everything.srcStageMask |= Stage::eAccelerationStructureBuildKHR;
    everything.srcAccessMask |= built;
    everything.dstStageMask |= Stage::eAccelerationStructureBuildKHR;
    everything.dstAccessMask |= built;
  }
  commands.pipelineBarrier2(vk::DependencyInfo({}, everything));
  ++work.barriers;
}

}  // namespace previz::render
