// Takes the files of scans apart into lines, words and numbers.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace previz::model {

// Returns all bytes of a scan's file. Throws previz::Error naming the file if it cannot be read or
// has more than 16 GiB.
std::string scan_bytes(const std::filesystem::path& file);

// Takes the first line off a text and returns it without its end, which is that of Unix, Windows or
// the old Macintosh.
std::string_view next_line(std::string_view& text);

// Takes the first word off a line and returns it; it is empty if there is none.
std::string_view next_word(std::string_view& line);

// Returns a line without white space at its ends.
std::string_view trimmed(std::string_view line);

std::string in_lower_case(std::string_view text);

// Returns the number that a word begins with, whose decimal sign may be a comma; what is written
// for infinity and for what is not a number, 1.#IND for example, is not finite. Returns nothing
// for other words.
std::optional<double> number_in(std::string_view word);

}  // namespace previz::model
