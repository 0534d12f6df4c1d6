#include "daemon/core/render/device/programs.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

namespace previz::render {

bool Programs::Compiled::is(const std::uint32_t* other_spirv,
                            std::span<const std::uint32_t> others) const {
  return spirv == other_spirv && std::ranges::equal(constants, others);
}

Programs::Wanted Programs::want(const std::uint32_t* spirv,
                                std::span<const std::uint32_t> constants) {
  const std::lock_guard lock(mutex_);
  const auto found = std::ranges::find_if(
      compiled_, [&](const Compiled& each) { return each.is(spirv, constants); });
  if (found != compiled_.end()) {
    std::rotate(found, found + 1, compiled_.end());
    return {compiled_.back().program, std::nullopt};
  }
  std::promise<Ptr> promise;
  compiled_.push_back({spirv, {constants.begin(), constants.end()}, promise.get_future().share()});
  if (compiled_.size() > most) compiled_.erase(compiled_.begin());
  return {compiled_.back().program, std::move(promise)};
}

// Compiles without the lock, so that nobody waits who wants another program.
Programs::Ptr Programs::make(const std::uint32_t* spirv, std::span<const std::uint32_t> constants,
                             std::promise<Ptr> promise, const Compile& compile) {
  try {
    Ptr made = compile();
    ++made_;
    promise.set_value(made);
    return made;
  } catch (...) {
    {
      const std::lock_guard lock(mutex_);
      std::erase_if(compiled_, [&](const Compiled& each) { return each.is(spirv, constants); });
    }
    promise.set_value(nullptr);
    throw;
  }
}

Programs::Ptr Programs::get(const std::uint32_t* spirv, std::span<const std::uint32_t> constants,
                            const Compile& compile) {
  for (;;) {
    Wanted wanted = want(spirv, constants);
    const bool is_there =
        wanted.program.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
    if (!is_there) ++awaited_;
    if (wanted.to_make) return make(spirv, constants, *std::move(wanted.to_make), compile);
    if (Ptr program = wanted.program.get()) return program;
  }
}

void Programs::ahead(const std::uint32_t* spirv, std::span<const std::uint32_t> constants,
                     const Compile& compile) {
  Wanted wanted = want(spirv, constants);
  if (!wanted.to_make) return;
  make(spirv, constants, *std::move(wanted.to_make), compile);
  ++made_ahead_;
}

void Programs::save() {
  const std::uint64_t made = made_;
  if (saved_ != made && cache_.save()) saved_ = made;
}

void Programs::close() {
  compiled_.clear();
  cache_ = {};
}

}  // namespace previz::render
