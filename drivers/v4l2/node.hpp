// Makes a video node's system calls: an interface only because a test must stand in for the kernel.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>

namespace previz::v4l2 {

class Node {
 public:
  virtual ~Node() = default;

  // Calls ioctl(2), and again while signals interrupt it. Returns 0 or an errno.
  virtual int control(unsigned long request, void* argument) = 0;

  // Waits until a buffer or an event can be dequeued, or something is wrong; returns false after
  // the time-out.
  virtual bool wait(std::chrono::milliseconds timeout) = 0;

  // Maps a buffer for reading, until unmap() or the node's end. Returns nothing, with errno set, on
  // failure.
  virtual std::span<const std::uint8_t> map(std::size_t offset, std::size_t length) = 0;
  virtual void unmap(std::span<const std::uint8_t> memory) = 0;
};

// Throws previz::Error that names the file.
std::unique_ptr<Node> open_node(const std::filesystem::path& file);

}  // namespace previz::v4l2
