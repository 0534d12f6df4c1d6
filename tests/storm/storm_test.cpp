// The storm over a rig whose cameras are replayed.
#include "tests/storm/storm.hpp"

namespace previz::rig::storm_test {

TEST_F(Storm, TheRigOutlivesItAndEveryTakeIsWhole) {
  write_stormy_set();
  weather({});
}

}  // namespace previz::rig::storm_test
