// The compute passes that were compiled for a device, kept as long as they may be wanted again.
// Internal to the render room.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "daemon/core/render/device/pipeline_cache.hpp"

namespace previz::render {

struct Program;  // a compute pass compiled for a device: daemon/core/render/device/kernel.hpp

class Programs {
 public:
  using Ptr = std::shared_ptr<const Program>;
  using Compile = std::function<Ptr()>;
  static constexpr std::size_t most = 256;

  // Returns what `compile` made for the same SPIR-V and constants before, or calls it: compiling
  // may take longer than a picture, and a renderer that is made anew mostly wants what the last one
  // had. What another thread is compiling is waited for, and tried again if that failed. The `most`
  // programs that were wanted last are kept; a reopened device has none. `spirv` is known by its
  // address and must stay there. This and ahead() may be called on any thread while the device is
  // open; `compile` too is called by several threads at once.
  Ptr get(const std::uint32_t* spirv, std::span<const std::uint32_t> constants,
          const Compile& compile);
  // Does the same before the program is needed, and waits for no other thread.
  void ahead(const std::uint32_t* spirv, std::span<const std::uint32_t> constants,
             const Compile& compile);

  void open(PipelineCache cache) { cache_ = std::move(cache); }
  void close();
  const PipelineCache& cache() const { return cache_; }
  // Keeps what was compiled since the last call for the next start.
  void save();

  // Since the device was first opened: all, those that something waited for, and those that were
  // made before anything asked for them.
  std::uint64_t made() const { return made_; }
  std::uint64_t awaited() const { return awaited_; }
  std::uint64_t made_ahead() const { return made_ahead_; }

 private:
  struct Compiled {
    const std::uint32_t* spirv;
    std::vector<std::uint32_t> constants;
    std::shared_future<Ptr> program;  // null: it could not be compiled

    bool is(const std::uint32_t* other_spirv, std::span<const std::uint32_t> others) const;
  };
  struct Wanted {
    std::shared_future<Ptr> program;
    std::optional<std::promise<Ptr>> to_make;  // absent: another one makes or has made it
  };

  Wanted want(const std::uint32_t* spirv, std::span<const std::uint32_t> constants);
  Ptr make(const std::uint32_t* spirv, std::span<const std::uint32_t> constants,
           std::promise<Ptr> promise, const Compile& compile);

  PipelineCache cache_;
  std::atomic<std::uint64_t> made_ = 0, awaited_ = 0, made_ahead_ = 0;
  std::uint64_t saved_ = 0;  // of made_
  std::mutex mutex_;
  std::vector<Compiled> compiled_;  // in the order in which they were last wanted
};

}  // namespace previz::render
