// Runs the rig, most often on the small take, with one Hand as its crew.
#pragma once

#include <stop_token>

#include "daemon/core/session/files.hpp"
#include "daemon/core/set/actions.hpp"
#include "daemon/rig/live.hpp"
#include "tests/support/hand.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::test {

// Returns the lines of a set file that map a button to every action, named like the action.
inline std::string button_for_every_action() {
  std::string text;
  for (const set::Action& action : set::actions())
    text += std::string("[[button]]\nname = \"") + action.name + "\"\naction = \"" + action.name +
            "\"\n";
  return text;
}

// Waits until the condition holds; `news` announces its changes. `seen` describes what was there if
// it never does.
template <typename Condition, typename Seen>
void await(std::condition_variable& news, std::unique_lock<std::mutex>& lock, Condition condition,
           Seen seen) {
  if (!news.wait_for(lock, longest_wait, condition))
    throw WaitedInVain("the crew waited in vain; seen last: " + seen());
}

// Options with the buttons of this hand, for a rig whose set.toml is in `directory`.
inline rig::LiveOptions with_hand(rig::LiveOptions options, const std::filesystem::path& directory,
                                  Hand& hand, const std::stop_source& stop) {
  options.set_file = directory / "set.toml";
  options.directory = directory / "live";
  options.stop = stop.get_token();
  options.buttons = [&hand] {
    std::vector<std::unique_ptr<Buttons>> buttons;
    buttons.push_back(std::make_unique<Hand::Device>(hand));
    return buttons;
  };
  return options;
}

// Runs the rig until the script, on a thread of its own, has ended or waited in vain. set.toml is
// in `directory`; `options` may watch the shown pictures.
inline pipeline::MetricsSnapshot run_crewed(rig::LiveOptions options,
                                            const std::filesystem::path& directory, Hand& hand,
                                            const std::function<void()>& script,
                                            report::Reports& reports) {
  std::stop_source stop;
  std::jthread crew([&] {
    try {
      script();
    } catch (const WaitedInVain& what) {
      ADD_FAILURE() << what.what();
    }
    stop.request_stop();
  });
  return rig::run_live(with_hand(std::move(options), directory, hand, stop), reports);
}

// The same on a take that is looped, with the reports as lines.
inline pipeline::MetricsSnapshot run_looped(rig::LiveOptions options,
                                            const std::filesystem::path& directory, Hand& hand,
                                            const std::function<void()>& script,
                                            std::ostream& out) {
  options.loop = true;
  report::Reports reports(report::lines_to(out));
  return run_crewed(std::move(options), directory, hand, script, reports);
}

// Counts the frames that were rendered, or dropped for a counted cause. This must equal the number
// captured.
inline std::uint64_t accounted_for(const pipeline::MetricsSnapshot& metrics) {
  std::uint64_t frames = metrics.stages.at("render").frames;
  for (const char* stage : {"tracking", "render"})
    for (const auto& [cause, dropped] : metrics.stages.at(stage).dropped) frames += dropped;
  return frames;
}

}  // namespace previz::test
