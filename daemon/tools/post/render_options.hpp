// What a render is asked for, beside what the take's set says.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/render/device/gpu.hpp"
#include "daemon/core/render/picture/sample_sums.hpp"
#include "daemon/core/set/origin.hpp"
#include "daemon/core/set/set.hpp"
#include "daemon/tools/post/finished_frame.hpp"

namespace previz::post {

// Options that are given override the set file.
struct RenderOptions {
  std::filesystem::path session;
  std::optional<std::filesystem::path> set_file;  // instead of the one in the session
  std::optional<std::filesystem::path> with;      // replaces settings of either (set::Overlay)
  // The session's own set may read and write outside of the session's folder.
  bool any_paths = false;
  set::Origin of_set_file = set::Origin::crew;  // whose `set_file` is
  std::optional<FrameRange> frames;             // absent: all
  double scale = 1;                             // of the pictures' size; above 0, at most 1
  std::optional<int> samples;                   // quality.samples
  std::optional<double> error;                  // quality.error
  std::optional<bool> adaptive;                 // quality.adaptive
  std::optional<bool> denoise;                  // quality.denoise
  std::optional<int> neighbours;                // quality.neighbours
  std::optional<double> seconds;                // quality.seconds
  std::optional<std::uint32_t> seed;            // estimation.seed
  std::optional<set::Estimator> estimator;
  std::optional<bool> hides_tags;  // [tags] hide, whatever was recorded
  // For the pictures of this take; absent: by output.directory, render_folder().
  std::optional<std::filesystem::path> directory;
  std::optional<bool> exr, png, video;
  bool force = false;  // render frames again that are already there
  render::DeviceOptions device;
  std::optional<std::uint64_t> memory;  // bytes that it may take; absent: quality.memory_mb
  // For scratch files, where the memory does not suffice; absent: $TMPDIR, or /var/tmp.
  std::optional<std::filesystem::path> scratch;
  // Bytes of the computer's memory that are free; absent: the kernel is asked.
  std::optional<std::uint64_t> free_memory;
  bool terminal = false;  // `out` is a terminal: progress is one rewritten line
  std::stop_token stop;   // ends cleanly, with finished frames on disk
  // Called after a frame's files are written, on the output stage's thread, in frame order, but not
  // for frames that were finished before. The shot has its layers.
  std::function<void(const pipeline::Shot&)> on_frame;
  // Files that stand in for those of `set_file`, by the names that it has for them.
  std::vector<std::pair<std::string, std::filesystem::path>> set_assets;
  // Rendered on in place of a device that is opened by `device`; null: none is open.
  std::shared_ptr<render::Device> open_device;
  // One of many processes that share the take: it renders no more than the first so many frames
  // that are free, and does not read what others have finished.
  std::optional<std::uint64_t> share;
  // Returns whether a frame is to be left out: it is not rendered and not reported. Asked of each
  // frame in their order, once this process is known to be at work in the folder.
  std::function<bool(std::uint64_t frame)> is_left_out;
  // Only these samples of every frame are rendered, and their sums are written in place of pictures
  // and video: NNNN.sums.exr (output::write_sums_exr). check_sample_range() says what is refused.
  std::optional<render::SampleRange> sample_range;
  // Folders with the sums of all ranges of the frames' samples, of which the pictures are made in
  // place of rendering them (SumsFolders). They are those of one run to the last bit, if one device
  // rendered them all.
  std::vector<std::filesystem::path> sums_from;
};

}  // namespace previz::post
