// Writes a map of tags as tables of a set file.
#pragma once

#include <string>

#include "daemon/tools/calibrate/tags/tag_survey.hpp"

namespace previz::calibrate {

// Returns a [[tag]] table for each tag, with a comment that says how certain its place is. Lengths
// are rounded to a micrometre and angles to a ten-thousandth of a degree.
std::string tag_tables(const TagSurvey& survey);

// Returns the set file's text with the tags' sizes and places in the tables that the file has for
// them, in the form that each is written in (position_m and rotation_deg, corners_m, or
// world_from_tag), and new tables for the others at the end. `doubts`, a comment as insist()
// returns it, comes before the first table, in place of an earlier calibration's. Everything else
// stays as it is. Throws previz::Error if the text cannot be changed.
std::string with_tags(const std::string& text, const TagSurvey& survey,
                      const std::string& doubts = {});

// Returns the table of a refined lens; empty if it is as it was.
std::string lens_table(const PinholeIntrinsics& before, const PinholeIntrinsics& after);

// Returns the set file's text with the parameters of the refined lens in its [observer.intrinsics];
// unchanged if the lens is as it was. The statistics of the boards stay: another walk begins with
// them, so that no walk counts twice.
std::string with_lens(const std::string& text, const PinholeIntrinsics& before,
                      const PinholeIntrinsics& after);

}  // namespace previz::calibrate
