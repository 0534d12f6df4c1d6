#include "drivers/frame.hpp"
