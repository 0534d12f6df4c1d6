#include "daemon/render/pass_clock.hpp"

#include <utility>

namespace previz::render {
namespace {

// A live frame of four samples at 1920x1440 had 1,376 passes in 34 submissions on a graphics card.
// Passes that find no room are counted as not timed.
constexpr std::uint32_t most_passes = 8192;

}  // namespace

PassClock::PassClock(const vk::raii::PhysicalDevice& physical, const vk::raii::Device& device,
                     std::uint32_t queue_family, const std::string& device_name) {
  const std::uint32_t bits = physical.getQueueFamilyProperties()[queue_family].timestampValidBits;
  if (bits == 0) throw Error("Vulkan: " + device_name + " cannot time its passes");
  valid_ = bits >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1;
  ms_per_tick_ = 1e-6 * static_cast<double>(physical.getProperties().limits.timestampPeriod);
  pool_ = vk::raii::QueryPool(device, {{}, vk::QueryType::eTimestamp, 2 * most_passes});
}

void PassClock::begin(const vk::raii::CommandBuffer& commands) {
  if (!is_on()) return;
  recorded_.clear();
  is_open_ = false;
  commands.resetQueryPool(*pool_, 0, 2 * most_passes);
}

void PassClock::start(const vk::raii::CommandBuffer& commands, const std::string& pass) {
  if (!is_on()) return;
  if (recorded_.size() == most_passes) {
    ++sums_.untimed;
    return;
  }
  const auto [place, is_new] = places_.try_emplace(pass, sums_.passes.size());
  if (is_new) sums_.passes.push_back({pass, 0, 0});
  commands.writeTimestamp2(vk::PipelineStageFlagBits2::eAllCommands, *pool_,
                           static_cast<std::uint32_t>(2 * recorded_.size()));
  recorded_.push_back(place->second);
  is_open_ = true;
}

void PassClock::stop(const vk::raii::CommandBuffer& commands) {
  if (!is_open_) return;
  commands.writeTimestamp2(vk::PipelineStageFlagBits2::eAllCommands, *pool_,
                           static_cast<std::uint32_t>(2 * recorded_.size() - 1));
  is_open_ = false;
}

void PassClock::collect(double waited_ms) {
  if (!is_on()) return;
  ++sums_.submissions;
  sums_.waited_ms += waited_ms;
  if (recorded_.empty()) return;
  const auto count = static_cast<std::uint32_t>(2 * recorded_.size());
  const auto [result, ticks] = pool_.getResults<std::uint64_t>(
      0, count, count * sizeof(std::uint64_t), sizeof(std::uint64_t),
      vk::QueryResultFlagBits::e64 | vk::QueryResultFlagBits::eWait);
  for (std::size_t i = 0; i < recorded_.size(); ++i) {
    DeviceTimes::Pass& pass = sums_.passes[recorded_[i]];
    ++pass.count;
    pass.ms += ms_per_tick_ * static_cast<double>((ticks[2 * i + 1] - ticks[2 * i]) & valid_);
  }
}

DeviceTimes PassClock::take() {
  places_.clear();
  recorded_.clear();
  return std::exchange(sums_, {});
}

}  // namespace previz::render
