#include "daemon/tools/model/scan_stl.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>

#include "daemon/tools/model/scan_text.hpp"
#include "drivers/error.hpp"
#include "drivers/letters.hpp"

namespace previz::model {
namespace {

constexpr std::size_t head_bytes = 84, facet_bytes = 50;
static_assert(std::endian::native == std::endian::little, "binary STL is little-endian");

FoundSurface read_binary(std::string_view bytes, std::size_t facets) {
  FoundSurface found;
  found.points.reserve(3 * facets);
  found.corners.reserve(3 * facets);
  double farthest = 0;
  for (std::size_t facet = 0; facet < facets; ++facet)
    for (std::size_t corner = 0; corner < 3; ++corner) {
      glm::dvec3 p;
      for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t number = 3 + 3 * corner + k;  // behind the normal
        const double value =
            binary_number<float>(bytes.data() + head_bytes + facet_bytes * facet + 4 * number);
        p[static_cast<glm::length_t>(k)] = value;
        if (std::isfinite(value)) farthest = std::max(farthest, std::abs(value));
      }
      found.corners.push_back(static_cast<std::uint32_t>(found.points.size()));
      found.points.push_back(p);
    }
  found.step = single_step * farthest;
  return found;
}

FoundSurface read_text(const std::filesystem::path& file, std::string_view text) {
  FoundSurface found;
  TextSteps steps;
  while (!text.empty()) {
    const std::string word = lower_case(next_word(text));
    if (word == "solid" || word == "endsolid") {
      next_line(text);  // a name of any words
    } else if (word == "vertex") {
      glm::dvec3 p;
      for (glm::length_t k = 0; k < 3; ++k) {
        const std::string_view digits = next_word(text);
        const auto number = number_in(digits);
        if (!number)
          throw Error(file.string() + ": has a vertex without three numbers; export it again");
        p[k] = *number;
        steps.add(static_cast<std::size_t>(k), *number, digits);
      }
      found.corners.push_back(static_cast<std::uint32_t>(found.points.size()));
      found.points.push_back(p);
    } else if (word == "endloop") {
      found.end_face(colourless);
    }
  }
  found.step = steps.step();
  found.is_step_of_text = true;
  return found;
}

}  // namespace

FoundSurface read_stl(const std::filesystem::path& file, std::string_view bytes) {
  const double claimed =
      bytes.size() < head_bytes ? 0 : binary_number<std::uint32_t>(bytes.data() + 80);
  const auto facets = static_cast<std::size_t>(claimed);
  const std::size_t fit = bytes.size() < head_bytes ? 0 : (bytes.size() - head_bytes) / facet_bytes;
  if (bytes.size() >= head_bytes && bytes.size() == head_bytes + facet_bytes * facets)
    return read_binary(bytes, facets);
  if (bytes.starts_with("\xef\xbb\xbf")) bytes.remove_prefix(3);
  std::string_view start = bytes.substr(0, 1000);
  if (lower_case(next_word(start)) == "solid" &&
      lower_case(bytes.substr(0, 2000)).find("facet") != std::string::npos)
    return read_text(file, bytes);
  if (facets > 0 && facets <= fit) return read_binary(bytes, facets);
  throw Error(file.string() +
              ": cannot be read as STL: it is cut short, or of another kind; export it again");
}

}  // namespace previz::model
