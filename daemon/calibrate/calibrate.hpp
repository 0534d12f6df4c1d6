// `previzd calibrate observer | light`: from pictures of a board to the set file's tables.
#pragma once

#include <filesystem>
#include <optional>
#include <ostream>
#include <string>

namespace previz::calibrate {

struct LensOptions {
  std::filesystem::path footage;  // session, folder of pictures, or video
  std::string board;              // board_grammar; light camera: empty where the lens is known
  int every = 0;                  // picture to look at; 0: as many as are useful
  bool force = false;             // print the table although views are missing
  std::optional<std::filesystem::path> table_file;     // where the tables go beside `out`
  std::optional<std::filesystem::path> residual_plot;  // an SVG
};

struct LightOptions : LensOptions {
  // Set file whose tags the light camera sees: its pose is found. Without `board` the lens is the
  // set's, or else the session's.
  std::optional<std::filesystem::path> tags_set;
};

// What is found is told on `out`, the TOML tables last. Throws previz::Error: what cannot be read,
// and where views are missing (unless forced), which.
void calibrate_observer(const LensOptions& options, std::ostream& out);
void calibrate_light(const LightOptions& options, std::ostream& out);

}  // namespace previz::calibrate
