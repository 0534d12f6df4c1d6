// A recorded stream behind the ordinary camera interface.
#pragma once
#include "drivers/camera.hpp"
