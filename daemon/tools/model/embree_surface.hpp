// Holds a surface of triangles in Embree, for rays and for nearest points.
#pragma once

#include <glm/vec3.hpp>
#include <memory>
#include <vector>

#include "drivers/embree.hpp"

namespace previz::model {

enum class Faces { both, front };  // that rays hit; a face's front has it counter-clockwise

class EmbreeSurface {
 public:
  // Three indices for each triangle, whose index is the hit's primID. Copies both lists. Throws
  // previz::Error if Embree cannot hold the surface.
  EmbreeSurface(const std::vector<glm::vec3>& positions, const std::vector<unsigned>& indices,
                Faces faces);

  RTCScene scene() const { return scene_.get(); }

 private:
  struct Release {
    void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
    void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
  };

  std::unique_ptr<RTCDeviceTy, Release> device_{rtcNewDevice(nullptr)};
  std::unique_ptr<RTCSceneTy, Release> scene_{rtcNewScene(device_.get())};
};

}  // namespace previz::model
