// Puts framebuffers on a screen through a connector, CRTC and plane, by atomic commits or, if the
// card has none, by the older calls.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "drivers/kms/handles.hpp"

namespace previz::kms {

class Output {
 public:
  // `card` must be DRM master and stay open longer than this object. Throws previz::Error if no
  // CRTC is free for the connector.
  Output(int card, const drmModeConnector& connector, const drmModeModeInfo& mode);
  ~Output();
  Output(const Output&) = delete;
  Output& operator=(const Output&) = delete;

  // Puts the framebuffer on the screen at the next vertical blank, for which the card then sends an
  // event with `data`. The first call, and the first after dark(), also sets the mode. Returns 0 or
  // an errno.
  int flip(std::uint32_t framebuffer, void* data);
  // Shows nothing on the screen, which then sleeps. Returns 0 or an errno.
  int dark();
  // Restores what the CRTC showed before this object was made.
  void restore();

  bool atomic() const { return plane_.has_value(); }

 private:
  using Properties = std::map<std::string, std::uint32_t>;  // name -> id

  void choose_crtc(const drmModeConnector& connector);
  void choose_plane();
  Properties properties_of(std::uint32_t object, std::uint32_t type) const;
  int commit(std::uint32_t framebuffer, void* data);
  int set_before_atomic(std::uint32_t framebuffer, void* data);

  const int card_;
  drmModeModeInfo mode_;
  const std::uint32_t connector_;
  std::uint32_t crtc_ = 0;
  int crtc_index_ = 0;
  std::optional<std::uint32_t> plane_;  // none: not atomic
  Properties of_connector_, of_crtc_, of_plane_;
  std::uint32_t mode_blob_ = 0;
  DrmOwned<drmModeCrtc> before_;
  bool lit_ = false;  // the mode is set
};

}  // namespace previz::kms
