// Stands in for a receiver of an Aravis camera that was taken over: it answers no request, sends
// what nobody asked for as fast as it is taken, and passes descriptors along.
#include "drivers/aravis/child_process.hpp"
#include "drivers/aravis/protocol.hpp"

int main() {
  using namespace previz::aravis;
  const int driver = ChildProcess::its_socket;
  while (send(driver, Kind::pulse, Writer()(Pulse()), driver, true)) {
  }
}
