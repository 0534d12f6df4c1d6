#include "daemon/scene/scene.hpp"
