#include "drivers/kms/output.hpp"

#include <cerrno>
#include <cstring>

#include "drivers/error.hpp"
#include "drivers/kms/cards.hpp"

namespace previz::kms {
namespace {

// libdrm's calls return 0, or -errno or -1 with errno set.
int error_of(int result) {
  if (result == 0) return 0;
  return result == -1 ? errno : -result;
}

}  // namespace

Output::Output(int card, const drmModeConnector& connector, const drmModeModeInfo& mode)
    : card_(card), mode_(mode), connector_(connector.connector_id) {
  choose_crtc(connector);
  before_.reset(drmModeGetCrtc(card_, crtc_));
  if (drmSetClientCap(card_, DRM_CLIENT_CAP_ATOMIC, 1) == 0) choose_plane();
  if (!plane_) return;
  of_connector_ = properties_of(connector_, DRM_MODE_OBJECT_CONNECTOR);
  of_crtc_ = properties_of(crtc_, DRM_MODE_OBJECT_CRTC);
  of_plane_ = properties_of(*plane_, DRM_MODE_OBJECT_PLANE);
  if (drmModeCreatePropertyBlob(card_, &mode_, sizeof mode_, &mode_blob_) != 0)
    throw Error(name_of(connector) + ": the mode is refused: " + std::strerror(errno));
}

Output::~Output() {
  if (mode_blob_ != 0) drmModeDestroyPropertyBlob(card_, mode_blob_);
}

// Chooses the CRTC that the connector is on already, else one that nobody uses.
void Output::choose_crtc(const drmModeConnector& connector) {
  const DrmOwned<drmModeRes> resources(drmModeGetResources(card_));
  if (!resources) throw Error(std::string("the card has no outputs: ") + std::strerror(errno));
  const DrmOwned<drmModeEncoder> current(drmModeGetEncoder(card_, connector.encoder_id));
  std::uint32_t possible = 0;  // one bit per CRTC
  for (int i = 0; i < connector.count_encoders; ++i)
    if (const DrmOwned<drmModeEncoder> encoder{drmModeGetEncoder(card_, connector.encoders[i])})
      possible |= encoder->possible_crtcs;
  for (int i = 0; i < resources->count_crtcs; ++i) {
    if ((possible & (1u << i)) == 0) continue;
    const std::uint32_t id = resources->crtcs[i];
    const bool ours = current && current->crtc_id == id;
    const DrmOwned<drmModeCrtc> crtc(drmModeGetCrtc(card_, id));
    const bool unused = crtc && crtc->mode_valid == 0;
    if (!ours && (!unused || crtc_ != 0)) continue;
    crtc_ = id;
    crtc_index_ = i;
    if (ours) return;
  }
  if (crtc_ == 0) throw Error(name_of(connector) + ": every CRTC of the card is in use");
}

void Output::choose_plane() {
  const DrmOwned<drmModePlaneRes> planes(drmModeGetPlaneResources(card_));
  for (std::uint32_t i = 0; planes && i < planes->count_planes; ++i) {
    const DrmOwned<drmModePlane> plane(drmModeGetPlane(card_, planes->planes[i]));
    if (!plane || (plane->possible_crtcs & (1u << crtc_index_)) == 0) continue;
    const DrmOwned<drmModeObjectProperties> properties(
        drmModeObjectGetProperties(card_, plane->plane_id, DRM_MODE_OBJECT_PLANE));
    for (std::uint32_t j = 0; properties && j < properties->count_props; ++j) {
      const DrmOwned<drmModePropertyRes> property(drmModeGetProperty(card_, properties->props[j]));
      if (property && std::strcmp(property->name, "type") == 0 &&
          properties->prop_values[j] == DRM_PLANE_TYPE_PRIMARY) {
        plane_ = plane->plane_id;
        return;
      }
    }
  }
}

Output::Properties Output::properties_of(std::uint32_t object, std::uint32_t type) const {
  Properties found;
  const DrmOwned<drmModeObjectProperties> list(drmModeObjectGetProperties(card_, object, type));
  for (std::uint32_t i = 0; list && i < list->count_props; ++i)
    if (const DrmOwned<drmModePropertyRes> property{drmModeGetProperty(card_, list->props[i])})
      found[property->name] = property->prop_id;
  return found;
}

int Output::flip(std::uint32_t framebuffer, void* data) {
  const int error = atomic() ? commit(framebuffer, data) : set_before_atomic(framebuffer, data);
  if (error == 0) lit_ = true;
  return error;
}

int Output::dark() {
  lit_ = false;
  return atomic() ? commit(0, nullptr)
                  : error_of(drmModeSetCrtc(card_, crtc_, 0, 0, 0, nullptr, 0, nullptr));
}

void Output::restore() {
  lit_ = false;
  std::uint32_t connector = connector_;
  const bool was_lit = before_ && before_->mode_valid != 0 && before_->buffer_id != 0;
  if (!was_lit || drmModeSetCrtc(card_, crtc_, before_->buffer_id, before_->x, before_->y,
                                 &connector, 1, &before_->mode) != 0)
    dark();
}

// Framebuffer 0 makes the screen dark.
int Output::commit(std::uint32_t framebuffer, void* data) {
  const DrmOwned<drmModeAtomicReq> request(drmModeAtomicAlloc());
  if (!request) return ENOMEM;
  const auto add = [&](std::uint32_t object, const Properties& properties, const char* name,
                       std::uint64_t value) {
    const auto found = properties.find(name);
    if (found != properties.end())
      drmModeAtomicAddProperty(request.get(), object, found->second, value);
  };
  const bool lights = framebuffer != 0;
  std::uint32_t flags = 0;
  if (!lit_) {
    flags |= DRM_MODE_ATOMIC_ALLOW_MODESET;
    add(connector_, of_connector_, "CRTC_ID", lights ? crtc_ : 0);
    add(crtc_, of_crtc_, "MODE_ID", lights ? mode_blob_ : 0);
    add(crtc_, of_crtc_, "ACTIVE", lights ? 1 : 0);
  }
  add(*plane_, of_plane_, "FB_ID", framebuffer);
  add(*plane_, of_plane_, "CRTC_ID", lights ? crtc_ : 0);
  if (lights) {
    flags |= DRM_MODE_PAGE_FLIP_EVENT | DRM_MODE_ATOMIC_NONBLOCK;
    const std::uint64_t width = mode_.hdisplay, height = mode_.vdisplay;
    add(*plane_, of_plane_, "SRC_X", 0);
    add(*plane_, of_plane_, "SRC_Y", 0);
    add(*plane_, of_plane_, "SRC_W", width << 16);  // 16.16 fixed point
    add(*plane_, of_plane_, "SRC_H", height << 16);
    add(*plane_, of_plane_, "CRTC_X", 0);
    add(*plane_, of_plane_, "CRTC_Y", 0);
    add(*plane_, of_plane_, "CRTC_W", width);
    add(*plane_, of_plane_, "CRTC_H", height);
  }
  return error_of(drmModeAtomicCommit(card_, request.get(), flags, data));
}

int Output::set_before_atomic(std::uint32_t framebuffer, void* data) {
  if (!lit_) {
    std::uint32_t connector = connector_;
    if (const int error =
            error_of(drmModeSetCrtc(card_, crtc_, framebuffer, 0, 0, &connector, 1, &mode_)))
      return error;
  }
  return error_of(drmModePageFlip(card_, crtc_, framebuffer, DRM_MODE_PAGE_FLIP_EVENT, data));
}

}  // namespace previz::kms
