#include "drivers/calibration.hpp"
