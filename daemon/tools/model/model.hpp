// Reconstructs the real scene from tags and from points that a person marks in pictures, as a
// phantom for the set file: `previz model`.
#pragma once

#include <filesystem>
#include <optional>
#include <ostream>

#include "daemon/core/render/device/gpu.hpp"

namespace previz::model {

struct ModelOptions {
  std::filesystem::path footage;     // session, folder of pictures, or video
  std::filesystem::path parts_file;  // parts.hpp; empty: what was marked on the rig (rig_marks.hpp)
  std::optional<std::filesystem::path> pictures;  // only write pictures to mark into this folder
  std::optional<std::filesystem::path> set_file;  // default: the session's own
  std::optional<std::filesystem::path>
      out;  // default: the parts file's name, or the session's, ending in .glb
  std::optional<std::filesystem::path>
      overlay;                   // pictures with the model over them, into this folder
  bool write = false;            // add the model to the set file
  bool grey = false;             // do not measure colours
  bool tags_only = false;        // the model is the tags alone, with what is under them
  bool terminal = false;         // `out` is a terminal: progress is one rewritten line
  render::DeviceOptions device;  // that colours are measured on
};

// Writes the model and reports on `out` what fits how well. Throws previz::Error naming the file,
// part, point or picture at fault; nothing is written then.
void make_model(const ModelOptions& options, std::ostream& out);

}  // namespace previz::model
