// The storm over a rig whose cameras are replayed.
#include "tests/storm/storm.hpp"

namespace previz::rig {
namespace storm_test {

TEST_F(Storm, TheRigOutlivesItAndEveryTakeIsWhole) {
  write_stormy_set();
  weather({});
}

}  // namespace storm_test
}  // namespace previz::rig
