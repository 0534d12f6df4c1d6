#!/bin/sh
# embed.sh NAME MODULE HEADER: writes the words of a SPIR-V module into a C++ header, as an array of
# uint32_t.
set -e
{
  printf '#pragma once\n#include <cstdint>\nconst std::uint32_t %s[] = {\n' "$1"
  od -An -v -tx4 -w32 "$2" | sed 's/ \([0-9a-f]*\)/0x\1,/g'
  printf '};\n'
} >"$3"
