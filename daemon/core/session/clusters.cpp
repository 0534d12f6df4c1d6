#include "daemon/core/session/clusters.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <optional>
#include <string>

#include "daemon/core/session/crc32.hpp"
#include "drivers/error.hpp"

namespace previz::session {
namespace {

constexpr std::array<std::uint8_t, 4> cluster_id = {0x1f, 0x43, 0xb6, 0x75};
// Ids of RFC 9559 as they are in the file.
constexpr std::uint32_t timestamp_id = 0xe7, simple_block_id = 0xa3, group_id = 0xa0,
                        block_id = 0xa1, segment_end_ids = 0x10000000;

// A window on a file; looking forward through it reads the file once.
class Window {
 public:
  static constexpr std::size_t length = std::size_t{1} << 20;  // bytes

  explicit Window(const std::filesystem::path& file) : file_(file, O_RDONLY), bytes_(length) {
    size_ = std::filesystem::file_size(file);
  }

  std::uint64_t size() const { return size_; }
  const OpenFile& file() const { return file_; }
  std::uint64_t read_bytes() const { return read_; }  // so far, some of them again

  // Returns what is there from `offset` on: at least `count` bytes, or fewer at the file's end.
  std::span<const std::uint8_t> at(std::uint64_t offset, std::size_t count) {
    const std::size_t there = offset >= size_ ? 0 : std::min<std::uint64_t>(count, size_ - offset);
    if (offset < begin_ || offset + there > begin_ + filled_) {
      const std::size_t all =
          offset >= size_ ? 0 : std::min<std::uint64_t>(bytes_.size(), size_ - offset);
      filled_ = 0;
      read_ += all;
      if (!read_at(file_, offset, {bytes_.data(), all}))
        return {};  // it became shorter, or the disk fails
      begin_ = offset;
      filled_ = all;
    }
    if (there == 0) return {};
    return std::span<const std::uint8_t>(bytes_).subspan(offset - begin_,
                                                         begin_ + filled_ - offset);
  }

 private:
  OpenFile file_;
  std::vector<std::uint8_t> bytes_;
  std::uint64_t size_ = 0, begin_ = 0, read_ = 0;
  std::size_t filled_ = 0;
};

struct Element {
  std::uint32_t id = 0;
  std::uint64_t content = 0;           // offset
  std::optional<std::uint64_t> bytes;  // absent: not known, as of a cluster that is being written
};

// Reads an EBML id and size (RFC 8794, sections 4 to 6); nothing if there is neither.
std::optional<Element> element_at(Window& window, std::uint64_t offset) {
  constexpr std::size_t longest = 4 + 8;
  const std::span<const std::uint8_t> head = window.at(offset, longest);
  const auto length_of = [](std::uint8_t first) {
    std::size_t length = 1;
    for (std::uint8_t bit = 0x80; bit != 0 && (first & bit) == 0; bit >>= 1) ++length;
    return length;
  };
  if (head.empty()) return std::nullopt;
  const std::size_t id_length = length_of(head[0]);
  if (id_length > 4 || head.size() <= id_length) return std::nullopt;
  Element element;
  for (std::size_t i = 0; i < id_length; ++i) element.id = element.id << 8 | head[i];
  const std::size_t size_length = length_of(head[id_length]);
  if (size_length > 8 || head.size() < id_length + size_length) return std::nullopt;
  const std::uint64_t mark = std::uint64_t{1} << (7 * size_length);
  std::uint64_t size = 0;
  for (std::size_t i = 0; i < size_length; ++i) size = size << 8 | head[id_length + i];
  size -= mark;
  element.content = offset + id_length + size_length;
  if (size != mark - 1) element.bytes = size;
  return element;
}

class Search {
 public:
  Search(const std::filesystem::path& file, WantedPackets wanted, std::size_t most_bytes)
      : window_(file), wanted_(std::move(wanted)), most_bytes_(most_bytes) {}

  std::vector<PacketPlace> run(const std::filesystem::path& file, const std::stop_token& stop) {
    for (std::uint64_t at = 0; !wanted_.empty();) {
      if (stop.stop_requested()) throw Error(file.string() + ": reading interrupted");
      const std::span<const std::uint8_t> bytes = window_.at(at, cluster_id.size());
      if (bytes.size() < cluster_id.size()) {
        // The end, or a place that the disk cannot read; there is more behind that.
        at += Window::length;
        if (at >= window_.size()) break;
        continue;
      }
      const auto found =
          std::search(bytes.begin(), bytes.end(), cluster_id.begin(), cluster_id.end());
      const auto before = static_cast<std::uint64_t>(found - bytes.begin());
      at += found == bytes.end() ? bytes.size() - (cluster_id.size() - 1) : before;
      if (found != bytes.end()) at = std::max(at + cluster_id.size(), take_cluster(at));
    }
    return std::move(found_);
  }

 private:
  // Takes the wanted packets of the cluster at `offset`. Returns from where the search goes on.
  std::uint64_t take_cluster(std::uint64_t offset) {
    const std::optional<Element> cluster = element_at(window_, offset);
    if (!cluster) return offset;
    const std::uint64_t end = end_of(*cluster, window_.size());
    std::optional<std::uint64_t> time;
    std::uint64_t go_on = offset, at = cluster->content;
    while (at < end) {
      const std::optional<Element> element = element_at(window_, at);
      if (!element || element->id >= segment_end_ids) break;  // the next cluster, or the index
      ++elements_;
      const bool is_block = element->id == simple_block_id || element->id == block_id;
      if (element->id == timestamp_id) time = number(*element);
      const bool is_taken = is_block && time && element->bytes && take_block(*element, *time);
      at = element->id == group_id ? element->content : end_of(*element, end);
      if (is_taken) go_on = at;
    }
    return is_work_left() ? go_on : std::max(go_on, at);
  }

  // A cluster's id may lie by chance, or by intent, in the bytes of a picture, and what follows it
  // is then looked at more than once. Beyond this limit the search goes on behind what it saw, so
  // that its time grows with the file's size and not faster.
  bool is_work_left() const {
    constexpr std::uint64_t an_element = 64, at_least = std::uint64_t{64} << 20;  // bytes
    return window_.read_bytes() + checked_bytes_ + an_element * elements_ <
           4 * window_.size() + at_least;
  }

  static std::uint64_t end_of(const Element& element, std::uint64_t limit) {
    if (element.content >= limit || !element.bytes) return limit;
    return element.content + std::min(*element.bytes, limit - element.content);
  }

  std::optional<std::uint64_t> number(const Element& element) {
    const std::size_t count = element.bytes.value_or(9);
    const std::span<const std::uint8_t> bytes = window_.at(element.content, 8);
    if (count > 8 || bytes.size() < count) return std::nullopt;
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < count; ++i) value = value << 8 | bytes[i];
    constexpr std::uint64_t most = std::uint64_t{1} << 60;
    return value < most ? std::optional(value) : std::nullopt;
  }

  // Returns whether the block is of one packet that is all there and wanted.
  bool take_block(const Element& block, std::uint64_t cluster_ms) {
    constexpr std::size_t head_bytes = 4;  // track (one byte), time (two) and flags
    const std::span<const std::uint8_t> head = window_.at(block.content, head_bytes);
    const bool fits = *block.bytes > head_bytes && block.content < window_.size() &&
                      *block.bytes <= window_.size() - block.content;
    constexpr std::uint8_t lacing = 0x06;
    if (!fits || head.size() < head_bytes || (head[0] & 0x80) == 0 || (head[3] & lacing) != 0)
      return false;
    const auto relative = static_cast<std::int16_t>(head[1] << 8 | head[2]);
    PacketPlace place{static_cast<std::int64_t>(cluster_ms) + relative, 0,
                      block.content + head_bytes,
                      static_cast<std::size_t>(*block.bytes - head_bytes)};
    const auto first = wanted_.lower_bound({place.video_ms, 0});
    if (first == wanted_.end() || first->first != place.video_ms || place.bytes > most_bytes_)
      return false;
    place.crc32 = checksum(place);
    if (wanted_.erase({place.video_ms, place.crc32}) == 0) return false;
    found_.push_back(place);
    return true;
  }

  std::uint32_t checksum(const PacketPlace& place) {
    checked_bytes_ += place.bytes;
    std::uint32_t crc = 0;
    block_.resize(std::min(place.bytes, std::size_t{1} << 20));
    for (std::size_t done = 0; done < place.bytes;) {
      const std::size_t count = std::min(block_.size(), place.bytes - done);
      if (!read_at(window_.file(), place.offset + done, {block_.data(), count})) return 0;
      crc = crc32({block_.data(), count}, crc);
      done += count;
    }
    return crc;
  }

  Window window_;
  WantedPackets wanted_;
  std::size_t most_bytes_;
  std::uint64_t checked_bytes_ = 0, elements_ = 0;
  std::vector<std::uint8_t> block_;
  std::vector<PacketPlace> found_;
};

}  // namespace

bool read_at(const OpenFile& file, std::uint64_t offset, std::span<std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t count =
        ::pread(file.get(), bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(count));
    offset += static_cast<std::uint64_t>(count);
  }
  return true;
}

std::vector<PacketPlace> find_packets(const std::filesystem::path& file, WantedPackets wanted,
                                      std::size_t most_bytes, const std::stop_token& stop) {
  return Search(file, std::move(wanted), most_bytes).run(file, stop);
}

}  // namespace previz::session
