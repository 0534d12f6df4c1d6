#include "drivers/session/session.hpp"
