# What became of the cases in GoogleTest's logs. Prints the skipped, refused and failed ones, then one line that
# counts them. Fails if a case failed, if a program ended within a case, or if none ran.
#   awk -v run=NAME -v seconds=N -v may_refuse=1 -f outcome.awk LOG...
# With may_refuse a failed case counts as refused if every one of its failures says that the device is too small.
function end_of_program() {
  if (open == "") return
  printf "  FAILED: %s: the program ended within it%s\n", open, why
  failed++
  open = ""
}

FNR == 1 { end_of_program() }
/^\[ RUN      \]/ { open = $4; wrong = 0; too_small = 0; why = "" }
/^guard_pages: / { why = "; " $0 }
/: Failure$|^unknown file: Failure/ { wrong++ }
/ allows 65536|65536 pixels that the Vulkan device can address/ { too_small++; words = $0 }
/^\[       OK \] .* ms\)$/ { passed++; open = "" }
/^\[  SKIPPED \] .* ms\)$/ { printf "  skipped: %s: %s\n", $4, last; skipped++; open = "" }
/^\[  FAILED  \] .* ms\)$/ {
  if (may_refuse && wrong > 0 && too_small >= wrong) {
    sub(/^C\+\+ exception with description /, "", words)
    printf "  refused: %s: %s\n", $4, words
    refused++
  } else {
    printf "  FAILED: %s\n", $4
    failed++
  }
  open = ""
}
NF { last = $0 }
END {
  end_of_program()
  printf "other_devices: %s: %d passed, %d skipped, %d refused, %d failed in %d s\n", run, passed,
    skipped, refused, failed, seconds
  exit failed > 0 || passed == 0
}
