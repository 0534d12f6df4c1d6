# What became of the cases in GoogleTest's logs. Prints the skipped and failed ones, then one line that
# counts them. Fails if a case failed, if a program ended within a case, or if none ran.
#   awk -v run=NAME -v seconds=N -f outcome.awk LOG...
function end_of_program() {
  if (open == "") return
  printf "  FAILED: %s: the program ended within it%s\n", open, why
  failed++
  open = ""
}

FNR == 1 { end_of_program() }
/^\[ RUN      \]/ { open = $4; why = "" }
/^guard_pages: / { why = "; " $0 }
/^\[       OK \] .* ms\)$/ { passed++; open = "" }
/^\[  SKIPPED \] .* ms\)$/ { printf "  skipped: %s: %s\n", $4, last; skipped++; open = "" }
/^\[  FAILED  \] .* ms\)$/ { printf "  FAILED: %s\n", $4; failed++; open = "" }
NF { last = $0 }
END {
  end_of_program()
  printf "other_devices: %s: %d passed, %d skipped, %d failed in %d s\n", run, passed, skipped,
    failed, seconds
  exit failed > 0 || passed == 0
}
