// Brings linear light of other primaries to linear Rec. 709.
#pragma once

#include <array>
#include <filesystem>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace previz::lighting {

// CIE x and y of red, green, blue and white.
using Chromaticities = std::array<std::array<double, 2>, 4>;
using ColorMatrix = std::array<double, 9>;  // row-major

inline constexpr std::array<double, 2> d65 = {0.3127, 0.3290}, equal_energy = {1.0 / 3, 1.0 / 3};
inline constexpr Chromaticities rec709 = {{{0.640, 0.330}, {0.300, 0.600}, {0.150, 0.060}, d65}};

// Returns the matrix from linear RGB of these primaries to linear Rec. 709, white to white (SMPTE
// RP 177, and Lam 1985, "Bradford"); nothing for primaries that span no triangle.
std::optional<ColorMatrix> rec709_from(const Chromaticities& chromaticities);
// The same from CIE XYZ, in which this chromaticity is white; nothing for a white without light.
std::optional<ColorMatrix> rec709_from_xyz(const std::array<double, 2>& white);

// Returns whether these are Rec. 709 as files write it, which may have three digits.
bool is_rec709(const Chromaticities& chromaticities);

// Converts the pixels in place, but those with a value that is no number or infinite: a sum of
// those would hide a sun that overflowed.
void convert(std::span<glm::vec3> pixels, const ColorMatrix& matrix);
// The same for the pixels of a light, of which a channel is 0 where only the conversion makes it
// negative. Pixels of which this is more than a rounding are counted in `notes`. What the file has
// as negative stays for repair().
void convert_light(std::span<glm::vec3> pixels, const ColorMatrix& matrix,
                   const std::filesystem::path& path, std::vector<std::string>& notes);

}  // namespace previz::lighting
