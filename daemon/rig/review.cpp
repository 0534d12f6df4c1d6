#include "daemon/rig/review.hpp"

#include <stop_token>
#include <utility>

#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/pipeline/take_shots.hpp"
#include "drivers/error.hpp"

namespace previz::rig {

using report::Reports;
using report::Severity;

namespace {

void play(const std::stop_token& stop, const std::filesystem::path& directory, const LoadedSet& set,
          pipeline::Mailbox<pipeline::Shot>& out, Reports& reports) {
  pipeline::Take take = pipeline::open_take(directory, {}, false, stop);
  if (take.set_text != set.text)
    throw Error(directory.string() +
                ": was recorded with another set file; run that one to review it");
  for (const std::string& what : take.session.missing)
    reports(report::once({Severity::warning, directory.string(), what}));
  if (!take.session.track.empty()) take.set.tracking.enabled = false;
  pipeline::TakeShotsOptions options;
  options.speed = 1;
  options.note = [&](const std::string& what) {
    reports(report::once({Severity::warning, "review", what}));
  };
  options.stop = stop;
  options.scene = &set.scene;
  for (pipeline::Shot& shot : pipeline::TakeShots(take, options)) out.push(std::move(shot));
}

}  // namespace

Review::Review(std::filesystem::path take, const LoadedSet& set,
               pipeline::Mailbox<pipeline::Shot>& out, live::Inbox& inbox, Reports& reports)
    : thread_([take = std::move(take), &set, &out, &inbox, &reports,
               this](const std::stop_token& stop) {
        try {
          play(stop, take, set, out, reports);
        } catch (const std::exception& error) {
          if (!stop.stop_requested()) reports({Severity::error, "review", error.what()});
        }
        if (!stop.stop_requested()) inbox.post(live::Event::review_ended);
        done_ = true;
      }) {}

}  // namespace previz::rig
