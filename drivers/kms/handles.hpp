// Owns the objects that libdrm hands out.
#pragma once

#include <xf86drm.h>
#include <xf86drmMode.h>

#include <memory>

namespace previz::kms {

struct Free {
  void operator()(drmModeRes* resources) const { drmModeFreeResources(resources); }
  void operator()(drmModePlaneRes* planes) const { drmModeFreePlaneResources(planes); }
  void operator()(drmModeConnector* connector) const { drmModeFreeConnector(connector); }
  void operator()(drmModeEncoder* encoder) const { drmModeFreeEncoder(encoder); }
  void operator()(drmModeCrtc* crtc) const { drmModeFreeCrtc(crtc); }
  void operator()(drmModePlane* plane) const { drmModeFreePlane(plane); }
  void operator()(drmModeObjectProperties* list) const { drmModeFreeObjectProperties(list); }
  void operator()(drmModePropertyRes* property) const { drmModeFreeProperty(property); }
  void operator()(drmModeAtomicReq* request) const { drmModeAtomicFree(request); }
};
template <class T>
using DrmOwned = std::unique_ptr<T, Free>;

}  // namespace previz::kms
