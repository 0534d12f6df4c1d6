// Makes the debug views of a frame: the composite, or one of the layers it was made of.
#pragma once

#include <array>

#include "daemon/core/lighting/response.hpp"
#include "daemon/core/render/picture/layers.hpp"
#include "drivers/frame.hpp"
#include "drivers/plate.hpp"

namespace previz::render {

enum class View { composite, mixed, real, difference, mask, depth, normal, noise };
inline constexpr std::array all_views = {View::composite,  View::mixed, View::real,
                                         View::difference, View::mask,  View::depth,
                                         View::normal,     View::noise};
const char* name_of(View view);

// Returns a layer as a picture with the response's bit depth. Radiance goes through exposure and
// response as the camera's would; the difference is centred on middle grey at half its contrast;
// depth is 1 m / (1 m + depth), black where nothing was hit; normals are 0.5 + 0.5 n; noise is
// eight times the composite's standard error.
Plate picture_of(View view, const Layers& layers, const lighting::Response& response,
                 double exposure);

}  // namespace previz::render
