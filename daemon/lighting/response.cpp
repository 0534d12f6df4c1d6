#include "daemon/lighting/response.hpp"
