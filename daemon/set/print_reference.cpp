// Prints config/reference.toml; `ninja reference` writes it.
#include <iostream>

#include "daemon/set/reference.hpp"
#include "daemon/set/set.hpp"

int main() {
  std::cout << previz::set::reference_toml();
}
