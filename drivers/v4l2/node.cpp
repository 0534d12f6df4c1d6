#include "drivers/v4l2/node.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>

#include <cerrno>
#include <cstring>

#include "drivers/descriptor.hpp"
#include "drivers/error.hpp"

namespace previz::v4l2 {
namespace {

class KernelNode final : public Node {
 public:
  explicit KernelNode(const std::filesystem::path& file)
      : descriptor_(::open(file.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC)) {
    if (!descriptor_) throw Error(file.string() + ": cannot be opened: " + std::strerror(errno));
  }

  int control(unsigned long request, void* argument) override {
    int result = 0;
    do {
      result = ::ioctl(descriptor_.get(), request, argument);
    } while (result < 0 && errno == EINTR);
    return result < 0 ? errno : 0;
  }

  bool wait(std::chrono::milliseconds timeout) override {
    pollfd fd{descriptor_.get(), POLLIN | POLLPRI, 0};
    return ::poll(&fd, 1, static_cast<int>(timeout.count())) > 0;
  }

  std::span<const std::uint8_t> map(std::size_t offset, std::size_t length) override {
    void* memory = ::mmap(nullptr, length, PROT_READ, MAP_SHARED, descriptor_.get(),
                          static_cast<off_t>(offset));
    if (memory == MAP_FAILED) return {};
    return {static_cast<const std::uint8_t*>(memory), length};
  }

  void unmap(std::span<const std::uint8_t> memory) override {
    ::munmap(const_cast<std::uint8_t*>(memory.data()), memory.size());
  }

 private:
  OwnedDescriptor descriptor_;
};

}  // namespace

std::unique_ptr<Node> open_node(const std::filesystem::path& file) {
  return std::make_unique<KernelNode>(file);
}

}  // namespace previz::v4l2
