#include "drivers/replay/replay_camera.hpp"
