// Gives every UDP socket of this process a packet filter before it can receive anything.
#pragma once

#include "drivers/box/bpf.hpp"

namespace previz::aravis {

// Sets the filter that UDP sockets over IPv4 get from now on, in all threads and by whatever
// library they are made. It is locked: nobody can take it off or replace it. Until the first call
// such sockets drop every packet.
void admit(bpf::Program filter);

// Throws previz::Error if a socket that GIO makes, as Aravis' sockets are made, has no filter.
void check_that_sockets_are_filtered();

}  // namespace previz::aravis
