// Implements `previz calibrate ...`: from pictures to the set file's tables.
#pragma once

#include <filesystem>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "daemon/core/render/renderer.hpp"
#include "daemon/tools/calibrate/sensor/response_fit.hpp"

namespace previz::calibrate {

struct LensOptions {
  std::filesystem::path footage;  // session, folder of pictures, or video
  std::string board;              // board_grammar; light camera: empty where the lens is known
  int every = 0;                  // uses every n-th picture; 0: as many as are useful
  bool force = false;             // print the table although views are missing
  std::optional<std::filesystem::path> table_file;     // gets the tables too, beside `out`
  std::optional<std::filesystem::path> residual_plot;  // an SVG
  std::optional<std::filesystem::path> set_file;       // that `write` changes
  bool write = false;
};

struct LightOptions : LensOptions {
  // The set file whose tags the light camera sees; the camera's pose is found from them. Without
  // `board` the lens is the set's, or else the session's.
  std::optional<std::filesystem::path> tags_set;
  // The rotation of lighting.environment is wanted in place of all that; the set is the set file's,
  // or else the session's own.
  bool rotation = false;
};

enum class CameraRole { observer, light };

struct ResponseOptions {
  std::filesystem::path footage;  // session or folder of pictures
  CameraRole camera = CameraRole::light;
  std::optional<std::filesystem::path> exposures;  // text file of NAME SECONDS
  std::optional<ResponseMethod> method;            // absent: whichever predicts better
  std::optional<std::filesystem::path> table_file;
};

struct DarkOptions {
  std::filesystem::path footage;                  // session, folder of pictures, or video
  std::optional<std::filesystem::path> set_file;  // with the light camera's response
  std::optional<std::filesystem::path> table_file;
};

struct VignettingOptions {
  std::filesystem::path footage;   // likewise; shows something evenly lit
  std::filesystem::path set_file;  // with the light camera's lens, response and dark level
  bool force = false;              // print the table although the light was not even
  std::optional<std::filesystem::path> table_file;
};

struct ThinLensOptions {
  std::optional<double> focal_length_mm, f_number, focus_distance_m, sensor_width_mm;
  std::optional<std::filesystem::path> photo;     // taken with the lens as it is set, with EXIF
  std::optional<std::filesystem::path> set_file;  // with the observer's intrinsics
  std::optional<std::filesystem::path> table_file;
};

struct TagsOptions {
  std::filesystem::path footage;                  // session, folder of pictures, or video
  std::optional<std::filesystem::path> set_file;  // with the lens, and the tags that are known
  std::string sizes;                              // "80mm,7:120mm"; go before the set's
  std::optional<int> origin;  // the tag that defines the world; default: the set's first one seen
  std::string distance;       // "0-3:1.234m"; empty: the tags' sizes give all lengths
  std::string family;         // empty: the set's
  int every = 0;              // uses every n-th picture; 0: as many as are useful
  bool force = false;         // accept the map although pictures are missing
  bool write = false;         // change the set file
  std::optional<std::filesystem::path> table_file;
};

struct FromOptions {
  std::filesystem::path file;         // of OpenCV, ROS, Kalibr or COLMAP (lens_file.hpp)
  std::optional<CameraRole> as;       // absent: a fisheye's is light, a pinhole's observer
  std::optional<std::string> camera;  // name or index, of a file with several
  std::string size;                   // "1920x1080"; empty: the file has it
  bool force = false;                 // print the table although the model does not fit
  std::optional<std::filesystem::path> table_file;
};

struct BalanceOptions {
  std::filesystem::path session;
  std::optional<std::filesystem::path> set_file;  // instead of the session's own
  std::vector<std::string> references;  // materials whose albedo is known; empty: fit_balance()
  int frames = 3;
  int samples = 64;
  bool write = false;  // change the set file's [lighting]
  render::DeviceOptions device;
  std::optional<std::filesystem::path> table_file;
};

// Each reports its results on `out`, the TOML tables last. Throws previz::Error naming a file that
// cannot be read or, unless forced, the views that are missing.
void calibrate_observer(const LensOptions& options, std::ostream& out);
void calibrate_light(const LightOptions& options, std::ostream& out);
// Finds how the set's environment is turned (rotation_fit.hpp). Throws previz::Error, too, where
// the pictures do not tell.
void calibrate_rotation(const LightOptions& options, std::ostream& out);
void calibrate_response(const ResponseOptions& options, std::ostream& out);
void calibrate_dark(const DarkOptions& options, std::ostream& out);
void calibrate_vignetting(const VignettingOptions& options, std::ostream& out);
void calibrate_lens(const ThinLensOptions& options, std::ostream& out);
// Takes the lens from another program's file. A model that the camera's table does not have is
// fitted by the table's, which may be off by at most 0.1 px anywhere unless forced.
void calibrate_from(const FromOptions& options, std::ostream& out);
void calibrate_balance(const BalanceOptions& options, std::ostream& out);
void calibrate_tags(const TagsOptions& options, std::ostream& out);

}  // namespace previz::calibrate
