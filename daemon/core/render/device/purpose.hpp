// What memory of a device is for, in words.
#pragma once

#include <string>

namespace previz::render {

// Says what a buffer is for, so that the error of one that does not fit can say it too, and what to
// do.
struct Purpose {
  // `what` completes "a buffer for" in the crew's words, and `advice` is an order. The texts must
  // stay where they are.
  const char *what, *advice;
  int width = 0, height = 0;  // of the picture that it is for; 0: for none

  // Returns "the paths of a picture of 1920x1080".
  std::string words() const {
    return width == 0 ? what
                      : std::string(what) + " of a picture of " + std::to_string(width) + "x" +
                            std::to_string(height);
  }
};

}  // namespace previz::render
