// A loopback network of the test's own, so that fixed ports do not meet those of other processes.
#pragma once

namespace previz::test {

// Moves the calling thread, and those it starts from now on, into a network of which they see
// nothing but an own loopback device. Once a process; to be called before other threads run. False
// where the kernel does not allow it: everything stays as it is, and a fixed port may be another
// process's. Where it is true all ports are free, and one that is not is a failure.
[[nodiscard]] bool enter_private_network();

}  // namespace previz::test
