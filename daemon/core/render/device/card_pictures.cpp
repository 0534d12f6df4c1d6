#include "daemon/core/render/device/card_pictures.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

#include "drivers/error.hpp"

namespace previz::render {
namespace {

constexpr auto handle_type = vk::ExternalMemoryHandleTypeFlagBits::eOpaqueFd;

std::uint64_t next_number() {
  static std::atomic<std::uint64_t> last = 0;
  return ++last;
}

bool fits(const CardMemory& memory, int width, int height) {
  return memory.width == width && memory.height == height;
}

}  // namespace

// Adds memory for one picture. Returns false where the device has none.
bool CardPictures::create(int width, int height) {
  Slot slot;
  slot.shared = {new Shared, Retire<Shared>{&device_}};
  const auto [columns, rows] =
      std::pair(static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height));
  const vk::ExternalMemoryImageCreateInfo external(handle_type);
  vk::ImageCreateInfo image({}, vk::ImageType::e2D, card_picture_format, {columns, rows, 1}, 1, 1,
                            vk::SampleCountFlagBits::e1, vk::ImageTiling::eOptimal,
                            card_picture_usage);
  image.pNext = &external;
  try {
    slot.shared->image = vk::raii::Image(device_.vk(), image);
    const auto requirements = slot.shared->image.getMemoryRequirements();
    const vk::MemoryDedicatedAllocateInfo dedicated(*slot.shared->image);
    vk::ExportMemoryAllocateInfo exported(handle_type);
    exported.pNext = &dedicated;
    vk::MemoryAllocateInfo allocation(
        requirements.size, device_.memory().type(requirements.memoryTypeBits,
                                                 vk::MemoryPropertyFlagBits::eDeviceLocal, {}));
    allocation.pNext = &exported;
    slot.shared->memory = vk::raii::DeviceMemory(device_.vk(), allocation);
    slot.shared->image.bindMemory(*slot.shared->memory, 0);
    auto memory = std::make_shared<CardMemory>();
    memory->card = *device_.card();
    memory->id = next_number();
    memory->bytes = requirements.size;
    memory->width = width;
    memory->height = height;
    memory->descriptor =
        OwnedDescriptor(device_.vk().getMemoryFdKHR({*slot.shared->memory, handle_type}));
    slot.memory = std::move(memory);
  } catch (const vk::DeviceLostError&) {
    throw;
  } catch (const vk::SystemError&) {
    return false;
  } catch (const Error&) {  // no such memory
    return false;
  }
  slot.is_held = std::make_shared<std::atomic<bool>>(false);
  ++device_.submissions().work.allocations;
  slots_.push_back(std::move(slot));
  return true;
}

CardPictures::Lent CardPictures::lend(int width, int height) {
  const std::uint32_t longest = device_.limits().maxImageDimension2D;
  if (!device_.card() || static_cast<std::uint32_t>(std::max(width, height)) > longest) return {};
  std::erase_if(slots_, [&](const Slot& slot) {
    return !fits(*slot.memory, width, height) && !slot.is_held->load();
  });
  auto free = std::ranges::find_if(slots_, [&](const Slot& slot) {
    return fits(*slot.memory, width, height) && !slot.is_held->load();
  });
  if (free == slots_.end()) {
    if (slots_.size() >= most || !create(width, height)) return {};
    free = std::prev(slots_.end());
  }
  free->is_held->store(true);
  return {CardPicturePtr(new CardPicture{free->memory, next_number()},
                         [is_held = free->is_held](const CardPicture* back) {
                           delete back;
                           is_held->store(false);
                         }),
          *free->shared->image};
}

}  // namespace previz::render
