#include "daemon/core/render/device/pass_clock.hpp"

#include <algorithm>

namespace previz::render {
namespace {

// A live frame of four samples at 1920x1440 had 1,376 passes on a graphics card.
// Passes that find no room are counted as not timed.
constexpr std::uint32_t most_passes = 8192;

// Timestamps are reset when they are needed, so many at once: most submissions have few passes, and
// the validation layer keeps account of every one.
constexpr std::uint32_t reset_at_once = 128;
static_assert(2 * most_passes % reset_at_once == 0);

}  // namespace

PassClock::PassClock(const vk::raii::PhysicalDevice& physical, const vk::raii::Device& device,
                     std::uint32_t queue_family, const std::string& device_name,
                     std::size_t under_way) {
  const std::uint32_t bits = physical.getQueueFamilyProperties()[queue_family].timestampValidBits;
  if (bits == 0) throw Error("Vulkan: " + device_name + " cannot time its passes");
  valid_ = bits >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1;
  ms_per_tick_ = 1e-6 * static_cast<double>(physical.getProperties().limits.timestampPeriod);
  for (std::size_t i = 0; i < under_way; ++i)
    under_way_.push_back(
        {vk::raii::QueryPool(device, {{}, vk::QueryType::eTimestamp, 2 * most_passes}), {}});
}

void PassClock::begin(std::uint64_t submission) {
  if (!is_on()) return;
  recorded_ = submission % under_way_.size();
  under_way_[recorded_].passes.clear();
  is_open_ = false;
}

void PassClock::start(const vk::raii::CommandBuffer& commands, const std::string& pass) {
  if (!is_on()) return;
  auto& [pool, passes] = under_way_[recorded_];
  if (passes.size() == most_passes) {
    ++sums_.untimed;
    return;
  }
  const auto query = static_cast<std::uint32_t>(2 * passes.size());
  if (query % reset_at_once == 0) commands.resetQueryPool(*pool, query, reset_at_once);
  const auto [place, is_new] = places_.try_emplace(pass, sums_.passes.size());
  if (is_new) sums_.passes.push_back({pass, 0, 0});
  commands.writeTimestamp2(vk::PipelineStageFlagBits2::eAllCommands, *pool, query);
  passes.push_back(place->second);
  is_open_ = true;
}

void PassClock::stop(const vk::raii::CommandBuffer& commands) {
  if (!is_open_) return;
  const auto& [pool, passes] = under_way_[recorded_];
  commands.writeTimestamp2(vk::PipelineStageFlagBits2::eAllCommands, *pool,
                           static_cast<std::uint32_t>(2 * passes.size() - 1));
  is_open_ = false;
}

void PassClock::add_wait(double ms) {
  if (is_on()) sums_.waited_ms += ms;
}

double PassClock::collect(std::uint64_t submission) {
  if (!is_on()) return 0;
  ++sums_.submissions;
  const auto& [pool, passes] = under_way_[submission % under_way_.size()];
  if (passes.empty()) return 0;
  const auto count = static_cast<std::uint32_t>(2 * passes.size());
  // The submission is done, so that all times are there, or else the driver has none: to wait for
  // them could be for ever.
  struct Timestamp {
    std::uint64_t ticks = 0, is_there = 0;
  };
  using Flag = vk::QueryResultFlagBits;
  const auto [result, times] = pool.getResults<Timestamp>(
      0, count, count * sizeof(Timestamp), sizeof(Timestamp), Flag::e64 | Flag::eWithAvailability);
  double all = 0;
  for (std::size_t i = 0; i < passes.size(); ++i) {
    const Timestamp &begin = times[2 * i], &end = times[2 * i + 1];
    if (begin.is_there == 0 || end.is_there == 0) {
      ++sums_.untimed;
      continue;
    }
    DeviceTimes::Pass& pass = sums_.passes[passes[i]];
    const double ms = ms_per_tick_ * static_cast<double>((end.ticks - begin.ticks) & valid_);
    ++pass.count;
    pass.ms += ms;
    all += ms;
  }
  return all;
}

// What is under way is still to be added, to the same places: their names stay.
DeviceTimes PassClock::take() {
  DeviceTimes taken = sums_;
  sums_ = {};
  for (const DeviceTimes::Pass& pass : taken.passes) sums_.passes.push_back({pass.name, 0, 0});
  std::erase_if(taken.passes, [](const DeviceTimes::Pass& pass) { return pass.count == 0; });
  return taken;
}

}  // namespace previz::render
