// Prints config/reference.toml; `ninja reference` writes it.
#include <iostream>

#include "daemon/core/set/reference.hpp"
#include "daemon/core/set/set.hpp"

int main() {
  std::cout << previz::set::reference_toml();
}
