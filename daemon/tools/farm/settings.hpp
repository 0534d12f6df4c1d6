// Compares the settings that frames were rendered with, as their render.json has them.
#pragma once

#include <cstddef>
#include <string>

#include "daemon/tools/farm/job.hpp"

namespace previz::farm {

// Returns whether the pictures are the same but for the range of samples, in which the chunks of a
// take differ.
bool same_settings(const std::string& one, const std::string& other);
// Returns those that differ: "samples is 16 there and 64 now".
std::string difference_words(const std::string& there, const std::string& planned);

// Returns whether `sums` is one of the chunks whose sums `merge` makes pictures of.
bool is_merged_of(const Job& job, std::size_t merge, std::size_t sums);

}  // namespace previz::farm
