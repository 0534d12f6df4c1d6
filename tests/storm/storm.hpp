// A rig that records while everything happens to it at once: presses of every button, calls on the
// bus and restarts of it, new sets, good and bad, cameras that are unplugged, fall silent or
// deliver damage, and exceptions in every stage. PREVIZ_STORM_S says for how many seconds; 20
// without it.
#pragma once

#include "tests/support/live_rig.hpp"
#include "tests/support/private_bus.hpp"
#include "tests/support/test.hpp"

namespace previz::rig::storm_test {

// Random choices for any thread; which ones fall together is up to the threads anyway.
class Dice {
 public:
  std::size_t below(std::size_t count) {
    thread_local std::mt19937 engine(++seeds_);
    return engine() % count;
  }
  bool one_in(std::size_t count) { return below(count) == 0; }
  void rest(std::size_t most_ms);

 private:
  std::atomic<unsigned> seeds_ = 0;
};

// How often something happened to the rig.
struct Tally {
  std::atomic<int> presses = 0, answers = 0, buses = 0, sets = 0, wrong_sets = 0, exceptions = 0,
                   unplugs = 0, receivers = 0, packets = 0;
};

using Gust = std::function<void()>;

class Storm : public test::RigLive {
 protected:
  // Every storm is in a network of its own, because a process can enter one only while it has no
  // other threads.
  static void SetUpTestSuite();

  // The small take's set with a display, and with both cameras' faults.
  void write_stormy_set();
  // Replaces part of the set file and of what edit_set() writes.
  void replace(const std::string& old, const std::string& by);

  // Runs the rig through the storm, with `gusts` besides those of every storm, until it shows
  // pictures again. Then looks at what it counted and recorded, and prints it.
  void weather(const std::vector<Gust>& gusts);

  Dice dice_;
  Tally tally_;
  std::string contact_;  // what stands before an action in its button's name
  std::size_t most_ms_between_sets_ = 700;

 private:
  void push(const std::string& action);
  void edit_set();
  void throw_in_every_stage();
  std::vector<Gust> everyday(test::PrivateBus& bus);
  void blow(const std::vector<Gust>& gusts);
  void clear_up();
  void print() const;

  std::string text_;  // the set's
  std::atomic<bool> blows_ = false;
};

}  // namespace previz::rig::storm_test
