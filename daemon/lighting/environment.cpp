#include "daemon/lighting/lighting.hpp"
