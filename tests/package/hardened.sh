#!/usr/bin/env bash
# Looks into programs for what their build was to harden (CMakeLists.txt, previz_hardening).
#   tests/package/hardened.sh PROGRAM...
set -euo pipefail
fail() {
  echo "hardened: $*" >&2
  exit 1
}
for program in "$@"; do
  header=$(readelf --wide --file-header --program-headers --dynamic "$program")
  symbols=$(readelf --wide --dyn-syms "$program")
  has() { grep -q -- "$2" <<<"$1" || fail "$program: $3"; }
  has "$header" 'Type: *DYN' "is not position independent"
  has "$header" 'GNU_RELRO' "can write to its tables of functions: no -z relro"
  has "$header" 'FLAGS_1.*NOW' "binds functions late, and so can write to its tables: no -z now"
  has "$header" 'GNU_STACK .* RW ' "has a stack that can be run"
  has "$symbols" ' __stack_chk_fail@' "has no stack protector"
  has "$symbols" ' _ZSt21__glibcxx_assert_fail' "checks no indices of vectors"
done
# Whether a function of the C library has a checked form depends on what a program calls.
symbols=$(readelf --wide --dyn-syms "$@")
grep -q '__[a-z]*_chk@' <<<"$symbols" ||
  fail "no function of the C library is checked: no _FORTIFY_SOURCE"
