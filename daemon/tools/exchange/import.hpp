// `previz import FRAMES.json SESSION`: makes a session of footage that was not recorded here.
//
// FRAMES.json (config/frames.example.json is a complete one; paths are relative to its folder;
// members whose names begin with "//" are comments; anything else unknown is an error):
//
//   name          text; default: the session folder's name
//   clock         text: what the timestamps count, "utc", "ptp", ...; default "monotonic"
//   set           path of the set file. It is copied verbatim, and the files it names into assets/.
//   observer      the film camera's pictures (below); required
//   light         the light camera's; may be left out
//   track         list of {frame, world_from_camera, covariance?, tags?}: poses of the film camera
//                 known from elsewhere. frame: position in `observer` from 0, increasing,
//                 where frames that are lost or missing count;
//                 world_from_camera: 4 rows of 4, rigid, metres, OpenCV axes, world Z up;
//                 covariance: 36 numbers, row-major, rotation (rad) then translation (m), in the
//                 camera frame, default 0 (exact). Frames that are not listed count as lost.
//
// observer, light - the pictures, exactly one of:
//   pictures      list of paths; or a path whose file name holds one number, as "%04d", "####",
//                 "@@@@" or "$F4" (picture_sequence.hpp), also of a range, "plate.####.exr
//                 1001-1100", or wildcards * and ?. A number that is missing is a lost frame at its
//                 time, unless timestamps_ns say otherwise. PNG, JPEG, TIFF, WebP, DPX or OpenEXR
//                 (linear light, 1 is white), grey or RGB, 8 or 16 bits; all alike. They are turned
//                 upright as their EXIF data says. ICC profiles, PNG's cICP, gAMA and cHRM, TIFF's
//                 chromaticities and EXIF's Adobe RGB are converted to sRGB's curve and Rec. 709's
//                 primaries, in 16 bits.
//   video         path of a video, or a list of the files into which a camera divided one clip.
//                 Y'CbCr 4:2:2 in 8 bits, BT.709, limited range, and full grey are kept as they
//                 are; everything else becomes RGB or grey, 8 bits, or 16 if it has more than 8.
//                 Its tags are heeded: which side is up, the shape of a pixel (made square), range,
//                 matrix, transfer and primaries. High dynamic range (HLG, PQ), linear and
//                 logarithmic signals become sRGB's curve, wider primaries Rec. 709's, in 16 bits;
//                 the curves of sRGB and television are kept. Colours that the frames do not name
//                 are the container's; a video that does not say its colour matrix counts as BT.709
//                 from 720 lines on and as BT.601 below, as players do. Streams without times
//                 (.h264, .hevc) need fps. What was found and what was assumed is reported. A frame
//                 that cannot be decoded is lost: it is counted, and its number is left free.
//   read_as       in place of tags that are wrong or lacking: {range: "full" or "limited", matrix
//                 (of a video): "bt601", "bt709", "bt2020" or "smpte240m", transfer: "srgb",
//                 "bt709", "hlg", "pq", "linear", "gamma22", "gamma28", "log100", "log316", or "as
//                 recorded", which leaves it to response; primaries: "bt709", "bt2020", "p3-d65",
//                 "p3-dci", "bt601-525" or "bt601-625", rotation_deg: 0, 90, 180 or 270 clockwise,
//                 pixel_aspect: [width, height]}
//   csv           path of a table with a header line; its column `file` (relative to the table's
//                 folder) are the pictures, unless `pictures` or `video` is given, which it then
//                 lists in order. Columns timestamp_ns, exposure, exposure_s and gain stand for the
//                 members below; other columns are not used.
// observer, light - the times, exactly one of (a video may have none, which means "container"):
//   timestamps_ns list, one a frame, on the same clock for both cameras; or "container": the
//                 times in the video itself, from start_ns on
//   fps           frames per second; frame i is taken at start_ns + i / fps
//   (csv)         its column timestamp_ns
//   start_ns      for fps and "container"; default 0
//   sort_by_time  true: the frames are put in the order of their times; otherwise times that do not
//                 increase are an error. Not for videos.
// observer, light - the exposures: a number for all, or a list with one a frame (or csv columns):
//   exposure      absolute: picture signal = exposure * radiance; 1 if nobody knows it; or
//   exposure_s    shutter time, with
//   gain          linear, default 1: exposure = exposure_s * gain * response.responsivity
// observer, light - the calibration, written as in the set file; may be left out if the set has it:
//   intrinsics    {width, height, fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6}; light: {width,
//                 height, fx, fy, cx, cy, k: [k1, k2, k3, k4], max_angle_deg}
//   lens          observer only: {focal_length_mm, f_number, focus_distance_m}
//   response      {kind: "srgb", "linear", "gamma" or "table", gamma, table, responsivity}
//   pose          light only: {world_from_camera} or {position_m, rotation_deg}
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace previz::exchange {

struct ImportOptions {
  std::filesystem::path description;  // FRAMES.json
  std::filesystem::path session;      // must not exist, or be an empty folder
};

struct ImportReport {
  std::uint64_t observer_frames = 0;
  std::uint64_t light_frames = 0;
  std::uint64_t poses = 0;
  std::uint64_t assets = 0;
  std::uintmax_t bytes = 0;        // size of the session
  double seconds = 0;              // wall clock
  std::vector<std::string> notes;  // conversions, in plain words
};

// Imports the footage. It is written into a folder beside the session that gets the session's name
// once it is complete, so that a failed import leaves nothing. Throws previz::Error naming
// FRAMES.json and the member, or the picture, that is wrong and what is allowed.
ImportReport import_session(const ImportOptions& options);

}  // namespace previz::exchange
