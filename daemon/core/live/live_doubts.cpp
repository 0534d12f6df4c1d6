#include "daemon/core/live/live_doubts.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <string>
#include <utility>

#include "daemon/core/report/report.hpp"
#include "daemon/core/tracking/pose_judgement.hpp"
#include "drivers/error.hpp"

namespace previz::live {
namespace {

constexpr const char* source = "camera pose";
constexpr int niceness = 19;  // whatever else wants a core comes first

}  // namespace

LiveDoubts::LiveDoubts(const set::Tracking& tracking, const ObserverCalibration& camera,
                       report::Reports& reports, std::chrono::milliseconds interval)
    : tracking_(tracking), camera_(camera), reports_(reports), interval_(interval) {
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

void LiveDoubts::add(const tracking::Track& track) {
  if (track.observations.empty()) return;
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock) return;  // the thread takes over what there is: this frame may be missing
  if (std::exchange(forgets_, false)) tracks_.clear();
  tracks_.push_back(track);
  if (tracks_.size() > frames_judged) tracks_.pop_front();
}

void LiveDoubts::run(const std::stop_token& stop) {
  ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), niceness);  // of this thread only
  std::unique_lock lock(mutex_);
  for (;;) {
    stopped_.wait_for(lock, stop, interval_, [] { return false; });
    if (stop.stop_requested()) return;
    if (tracks_.size() < frames_judged) continue;
    const std::deque<tracking::Track> tracks = std::exchange(tracks_, {});
    lock.unlock();
    try {
      judge(tracks, stop);
    } catch (const std::exception& error) {  // there is no memory for it: the next time, perhaps
      reports_(report::once({report::Severity::warning, source, reason_of(error)}));
    }
    lock.lock();
  }
}

void LiveDoubts::judge(const std::deque<tracking::Track>& tracks, const std::stop_token& stop) {
  tracking::PoseJudgement judgement(tracking_, camera_);
  for (const tracking::Track& track : tracks) {
    if (stop.stop_requested()) return;
    judgement.add(nullptr, track);  // pictures are kept of frames without tags only
  }
  std::string text;
  for (const std::string& doubt :
       {judgement.doubt_about_residuals(stop), judgement.doubt_about_lost(stop)})
    if (!doubt.empty()) add_to_list(text, doubt, "; ");
  if (stop.stop_requested()) return;
  if (text.empty()) return reports_.settle(source);
  report::Report report{report::Severity::warning, source, text};
  report.notice = report::Notice{report::Severity::warning, source, text, true};
  reports_(report::once(std::move(report)));
}

}  // namespace previz::live
