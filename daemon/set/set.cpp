// The set file's parser: TOML in, typed values or every problem of the file out.
#include "daemon/set/set.hpp"

#include "drivers/error.hpp"

namespace previz::set {}
