// Lists, marks, checks, copies and deletes takes, as `previz takes` does.
#pragma once

#include <filesystem>
#include <iosfwd>
#include <stop_token>
#include <vector>

namespace previz::post {

using Paths = std::vector<std::filesystem::path>;

// Prints a line a take: name, whether it is good, length, frames, timecode, size, how much of it is
// rendered, and what it lacks. Each of `places` is a folder of takes, or a set file, which names
// its folders. Throws previz::Error if one of them is neither.
void list_takes(const Paths& places, std::ostream& out);

// Marks the takes as good, or as not. Throws previz::Error, and marks none, if one is no take or
// may be in recording.
void mark_takes(const Paths& takes, bool good, std::ostream& out);

// Reads every frame and file of the takes, compares them with the checksums that are recorded, and
// with SHA256SUMS where a copy has it. Prints what is missing or was changed. Returns 0,
// damaged_status if anything is, or incomplete_status if all that is missing was lost while the
// take was recorded.
inline constexpr int damaged_status = 1, incomplete_status = 3;
int check_takes(const Paths& takes, std::ostream& out, const std::stop_token& stop);

struct RepairOptions {
  Paths takes;
  std::filesystem::path folder;  // made if need be; a repaired take is named as the damaged one
};
// Checks the takes as check_takes() does, and writes what is whole of each damaged one into a new
// take (session::repair_session()); the damaged one stays as it is. Then reads the new one as
// check_takes() does. Prints what was wrong and what is lost. Returns 0, or 1 if anything is lost.
// Throws previz::Error, and writes nothing, if the place of one is taken.
int repair_takes(const RepairOptions& options, std::ostream& out, const std::stop_token& stop);

struct CopyOptions {
  Paths takes;
  std::filesystem::path folder;  // made if need be; a copy is named as its take
};
// Copies the takes' own files and nothing else, writes their SHA-256 into the copy's SHA256SUMS
// (`sha256sum -c` reads it), and compares copy and take by reading both back. A copy gets its name
// when it is whole; a stop or an error leaves none. What was copied before is left as it is. Then
// reads the copy as check_takes does: a take that was damaged before is copied as it is, and said.
// Returns 0, or 1 if one is damaged. Throws previz::Error.
int copy_takes(const CopyOptions& options, std::ostream& out, const std::stop_token& stop);

// Deletes the takes' own files and the SHA256SUMS of a copy, and each folder that is then empty;
// whatever else lies in it stays and is reported. Throws previz::Error, and deletes nothing, if one
// is no take, is a link, may be in recording, or is marked good without `also_good`.
void delete_takes(const Paths& takes, bool also_good, std::ostream& out);

}  // namespace previz::post
