// Takes from the process everything that receiving from a camera does not need.
#pragma once

namespace previz::aravis {

// Lets the process end with its parent, whose id is given, and bounds its memory and descriptors.
// It leaves no core file, and the kernel ends it first if memory runs out. Returns false if the
// parent is gone already.
bool limit_resources(int parent);

// Allows from now on, in all threads: memory that is not executable, threads, UDP, and the sockets
// that are there. No file can be opened, no program run, no process made, and none but this one be
// signalled, not by way of a descriptor either. A process for cameras on the USB may also open
// files that are there below /dev/bus/usb, /sys and /run/udev, which takes a kernel with Landlock;
// and it has no IP. Throws previz::Error if the kernel refuses, or if it has no Landlock and `usb`.
void enter_sandbox(bool usb);

}  // namespace previz::aravis
