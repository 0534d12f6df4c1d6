#include "daemon/core/render/passes/pipelines_ahead.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <exception>
#include <string>
#include <utility>

#include "daemon/core/render/passes/passes.hpp"
#include "daemon/core/report/log.hpp"

namespace previz::render {
namespace {

constexpr int niceness = 10;  // cameras, recording and pictures go before

// Reports the first failure only: the others most often have the same cause.
class Failures {
 public:
  bool none() const { return !is_reported_; }
  void add(const std::exception& error) {
    if (std::exchange(is_reported_, true)) return;
    report::log({report::Severity::warning, "render",
                 std::string("a shader could not be compiled ahead, so that a button may hold up "
                             "the picture: ") +
                     error.what()});
  }

 private:
  bool is_reported_ = false;
};

}  // namespace

PipelinesAhead::PipelinesAhead(std::shared_ptr<Device> device,
                               std::function<std::vector<std::uint32_t>()> reachable)
    : device_(std::move(device)),
      reachable_(std::move(reachable)),
      thread_([this](const std::stop_token& stop) {
        has_all_ = work(stop);
        is_done_ = true;
      }) {}

// Returns whether all pipelines are there.
bool PipelinesAhead::work(const std::stop_token& stop) const {
  Failures failures;
  try {
    for (const std::uint32_t features : reachable_()) {
      for (const Pass& pass : passes_for(features, device_bits(*device_))) {
        if (stop.stop_requested()) return false;
        try {
          compile_ahead(*device_, pass, features);
        } catch (const std::exception& error) {
          failures.add(error);
        }
      }
      // The first picture waits for those; nobody waits for the others yet. The niceness is that of
      // this thread only, and may only be refused.
      ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), niceness);
    }
  } catch (const std::exception& error) {  // there is no memory for the list
    failures.add(error);
  }
  return failures.none();
}

}  // namespace previz::render
