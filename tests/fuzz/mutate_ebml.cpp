// Matroska's elements (RFC 8794 and RFC 9559): an id, the size of what follows, and that: a value
// or further elements.
#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "tests/fuzz/mutators.hpp"

namespace previz::fuzz {
namespace mutate_ebml_cpp {

constexpr std::uint64_t unknown = std::numeric_limits<std::uint64_t>::max();
constexpr std::uint64_t largest = (std::uint64_t{1} << 56) - 2;
constexpr std::uint32_t ebml_head = 0x1a45dfa3;
constexpr int deepest = 16;

struct Element {
  std::uint32_t id = 0;  // with its marker; 0 for bytes that are no element, kept as they are
  bool has_children = false;
  std::vector<Element> children;
  std::string payload;                // where there are no children
  int size_width = 1;                 // bytes that its size is written in, if the size fits
  std::optional<std::uint64_t> told;  // a size in place of the right one, or `unknown`
};

// The elements that hold others, of those that libav reads.
constexpr std::array<std::uint32_t, 30> holders = {
    ebml_head, 0x18538067, 0x114d9b74, 0x4dbb, 0x1549a966, 0x1654ae6b, 0xae,       0xe0,
    0x55b0,    0x55d0,     0xe1,       0x6d80, 0x6240,     0x5034,     0x1f43b675, 0xa0,
    0x75a1,    0xa6,       0x1c53bb6b, 0xbb,   0xb7,       0x1254c367, 0x7373,     0x63c0,
    0x67c8,    0x1043a770, 0x45b9,     0xb6,   0x1941a469, 0x61a7};

// ---- reading

struct Number {
  std::uint64_t value = 0;
  int width = 0;  // bytes, 1 to 8
};

// Reads a number whose leading zeros count its bytes, with the marker after them or without.
std::optional<Number> take_number(Bytes& bytes, int most_width, bool with_marker) {
  if (bytes.empty()) return std::nullopt;
  const int width = std::countl_zero(bytes[0]) + 1;
  if (width > most_width || static_cast<std::size_t>(width) > bytes.size()) return std::nullopt;
  Number number{with_marker ? bytes[0] : bytes[0] & 0xffu >> width, width};
  for (int i = 1; i < width; ++i)
    number.value = number.value << 8 | bytes[static_cast<std::size_t>(i)];
  bytes = bytes.subspan(static_cast<std::size_t>(width));
  return number;
}

std::uint64_t all_ones(int width) {
  return (std::uint64_t{1} << 7 * width) - 1;
}

std::vector<Element> elements_of(Bytes bytes, int depth);

// Takes an element from the beginning. One that claims to be longer than what is left ends there.
std::optional<Element> take_element(Bytes& bytes, int depth) {
  Bytes left = bytes;
  const std::optional<Number> id = take_number(left, 4, true);
  const std::optional<Number> size = id ? take_number(left, 8, false) : std::nullopt;
  if (!size) return std::nullopt;
  Element element;
  element.id = static_cast<std::uint32_t>(id->value);
  element.size_width = size->width;
  if (size->value == all_ones(size->width))
    element.told = unknown;
  else if (size->value > left.size())
    element.told = size->value;
  const Bytes body = element.told ? left : left.first(size->value);
  element.has_children = depth < deepest && std::ranges::find(holders, element.id) != holders.end();
  if (element.has_children)
    element.children = elements_of(body, depth + 1);
  else
    element.payload = text_of(body);
  bytes = left.subspan(body.size());
  return element;
}

std::vector<Element> elements_of(Bytes bytes, int depth) {
  std::vector<Element> elements;
  while (!bytes.empty()) {
    std::optional<Element> element = take_element(bytes, depth);
    if (!element) {
      element.emplace().payload = text_of(bytes);
      bytes = {};
    }
    elements.push_back(std::move(*element));
  }
  return elements;
}

// ---- writing

std::string big_endian(std::uint64_t number, int width) {
  std::string text;
  for (int i = width; i > 0; --i) text += static_cast<char>(number >> 8 * (i - 1) & 0xff);
  return text;
}

std::string size_text(std::uint64_t size, int width) {
  if (size == unknown) return big_endian(std::uint64_t{1} << 7 * width | all_ones(width), width);
  while (width < 8 && size >= all_ones(width)) ++width;
  return big_endian(std::uint64_t{1} << 7 * width | size, width);
}

std::string id_text(std::uint32_t id) {
  int width = 1;
  while (width < 4 && id >> 8 * width != 0) ++width;
  return big_endian(id, width);
}

std::string written(const Element& element);

std::string body_of(const Element& element) {
  if (!element.has_children) return element.payload;
  std::string body;
  for (const Element& child : element.children) body += written(child);
  return body;
}

std::string written(const Element& element) {
  std::string body = body_of(element);
  if (element.id == 0) return body;
  return id_text(element.id) + size_text(element.told.value_or(body.size()), element.size_width) +
         body;
}

// ---- changing

struct Spot {
  std::vector<Element>* holder = nullptr;
  std::size_t at = 0;
  std::vector<Element*> around;  // what holds it, from the outermost on

  Element& element() const { return (*holder)[at]; }
  std::vector<Element>::iterator iterator() const {
    return holder->begin() + static_cast<std::ptrdiff_t>(at);
  }
};

// Returns a random element. There must be one.
Spot spot_in(std::vector<Element>& file, std::mt19937& random) {
  Spot spot{&file, 0, {}};
  while (true) {
    spot.at = below(random, spot.holder->size());
    Element& element = spot.element();
    if (element.children.empty() || below(random, 4) == 0) return spot;
    spot.around.push_back(&element);
    spot.holder = &element.children;
  }
}

void drop(std::vector<Element>&, const Spot& spot, std::mt19937&) {
  spot.holder->erase(spot.iterator());
}

void repeat(std::vector<Element>&, const Spot& spot, std::mt19937& random) {
  const std::size_t times = below(random, 8) == 0 ? 20 : 1;
  const Element copy = spot.element();
  spot.holder->insert(spot.iterator(), times, copy);
}

// Two elements of one holder change places.
void swap_elements(std::vector<Element>&, const Spot& spot, std::mt19937& random) {
  if (spot.holder->size() < 2) return;
  const std::size_t step = 1 + below(random, spot.holder->size() - 1);
  std::swap(spot.element(), (*spot.holder)[(spot.at + step) % spot.holder->size()]);
}

// An element is copied to a place elsewhere, or over another.
void copy_element(std::vector<Element>& file, const Spot& spot, std::mt19937& random) {
  Element copy = spot.element();
  const Spot to = spot_in(file, random);
  if (below(random, 2) == 0)
    to.element() = std::move(copy);
  else
    to.holder->insert(to.iterator(), std::move(copy));
}

// An element is put into one of its own kind, or into some other that holds elements.
void nest(std::vector<Element>&, const Spot& spot, std::mt19937& random) {
  Element outer;
  outer.has_children = true;
  outer.id = spot.element().has_children && below(random, 2) == 0
                 ? spot.element().id
                 : holders[below(random, holders.size())];
  outer.children.push_back(std::move(spot.element()));
  spot.element() = std::move(outer);
}

// A number of at most eight bytes becomes extreme, near or one of another length. Of a longer value
// a byte changes, most often near its beginning, where blocks and codecs keep their heads.
void change_payload(std::vector<Element>& file, const Spot& spot, std::mt19937& random) {
  std::string& payload = spot.element().payload;
  if (spot.element().has_children) return repeat(file, spot, random);
  // Their first bytes are taken where the value is shorter: as infinity and NaN, of both lengths.
  static constexpr std::array<std::uint64_t, 8> extremes = {0,
                                                            unknown,
                                                            0x8000000000000000,
                                                            0x7fffffffffffffff,
                                                            0x7ff0000000000000,
                                                            0x7ff8000000000000,
                                                            0x7f80000000000000,
                                                            0x00000000000000ff};
  if (payload.size() > 8 && below(random, 4) != 0) {
    const std::size_t reach =
        below(random, 4) == 0 ? payload.size() : std::min<std::size_t>(payload.size(), 16);
    payload[below(random, reach)] = static_cast<char>(random());
    return;
  }
  switch (below(random, 7)) {
    case 0:
      payload.resize(below(random, 9));
      break;
    case 1:
      payload.clear();
      break;
    case 2:
      if (!payload.empty()) ++payload.back();
      break;
    case 3:
      if (!payload.empty()) --payload.back();
      break;
    case 4:
      if (!payload.empty()) payload[below(random, payload.size())] = static_cast<char>(random());
      break;
    default: {
      const std::size_t width = std::min<std::size_t>(payload.size(), 8);
      payload = big_endian(extremes[below(random, extremes.size())], 8).substr(0, width);
    }
  }
}

void change_size(std::vector<Element>&, const Spot& spot, std::mt19937& random) {
  Element& element = spot.element();
  const std::size_t right = body_of(element).size();
  switch (below(random, 8)) {
    case 0:
      element.told = right - std::min<std::size_t>(right, 1);
      break;
    case 1:
      element.told = right + 1;
      break;
    case 2:
      element.told = unknown;
      element.size_width = 8;
      break;
    case 3:
      element.told = unknown;
      break;
    case 4:
      element.told = largest;
      break;
    default:
      element.told.reset();
      element.size_width = 1 + static_cast<int>(below(random, 8));
  }
}

using Change = void (*)(std::vector<Element>& file, const Spot& spot, std::mt19937& random);

constexpr std::array<Change, 16> changes = {
    drop,           drop,           repeat,         repeat,         swap_elements,  swap_elements,
    copy_element,   copy_element,   nest,           change_payload, change_payload, change_payload,
    change_payload, change_payload, change_payload, change_size,
};

void change(std::vector<Element>& file, std::mt19937& random) {
  const Spot spot = spot_in(file, random);
  if (below(random, 32) == 0)
    for (Element* holder : spot.around) holder->told = body_of(*holder).size();
  changes[below(random, changes.size())](file, spot, random);
}

}  // namespace mutate_ebml_cpp

std::optional<std::string> mutate_matroska(Bytes bytes, std::mt19937& random) {
  using namespace mutate_ebml_cpp;
  std::vector<Element> file = elements_of(bytes, 0);
  if (file.empty() || file[0].id != ebml_head) return std::nullopt;
  const std::string before = text_of(bytes);
  std::string text;
  std::size_t times = 1 + below(random, 3);
  // What is still as it was is changed a few times more.
  for (int tries = 0; tries < 4 && (tries == 0 || text == before); ++tries, times = 1) {
    for (; times > 0 && !file.empty(); --times) change(file, random);
    text.clear();
    for (const Element& element : file) text += written(element);
  }
  return text;
}

}  // namespace previz::fuzz
