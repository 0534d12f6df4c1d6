// How much memory the computer has, and how much of it may hold what waits to be recorded.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

namespace previz::output {

// Memory that has run out is asked for again so often.
inline constexpr std::chrono::milliseconds memory_interval{10};

// Return bytes: the computer's memory, and how much of it may hold what is recorded at most (three
// quarters).
std::uint64_t memory_bytes();
std::uint64_t most_queue_bytes(std::uint64_t memory);
// Returns how much of it programs can still take without swapping; nothing where the kernel does
// not say.
std::optional<std::uint64_t> free_memory_bytes();
// Returns the most that this process has had in memory so far.
std::uint64_t peak_memory_bytes();
// Returns the room for what is recorded: as wished, but not more than that; without a wish a
// quarter of the memory that is free now, because the machine has other things to do.
std::uint64_t queue_bytes(std::optional<double> wished_mb, std::uint64_t memory = memory_bytes());

}  // namespace previz::output
