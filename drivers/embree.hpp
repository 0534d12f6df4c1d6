// Embree's two versions: 3, as Debian 12 has it, and 4, as Debian 13 does. A target that includes
// this header must link embree.
#pragma once

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace previz::embree {

// Finds the closest hit of `query.ray`. The caller sets hit.geomID to RTC_INVALID_GEOMETRY_ID,
// which stays where nothing is hit.
inline void find_closest(RTCScene scene, RTCRayHit& query) {
#if RTC_VERSION_MAJOR >= 4
  rtcIntersect1(scene, &query);
#else
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(scene, &context, &query);
#endif
}

// Returns whether anything lies on the ray between its tnear and tfar; changes tfar if so.
inline bool is_blocked(RTCScene scene, RTCRay& ray) {
#if RTC_VERSION_MAJOR >= 4
  rtcOccluded1(scene, &ray);
#else
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(scene, &context, &ray);
#endif
  return ray.tfar < 0;
}

}  // namespace previz::embree
