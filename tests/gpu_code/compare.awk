# Compares two tables of compile_modules.cpp, the kept one first; fails where a number is worse by more
# than a tenth. A pass that is in one of them only fails too: the kept table is then to be made again.
BEGIN {
  FS = "\t"
  split("registers spills scratch lanes instructions", names, " ")
}
/^#/ { version[FILENAME] = substr($0, 3); next }
{ key = $1 " " $2 " " $3 }
FILENAME == ARGV[1] { for (i = 1; i <= 5; ++i) kept[key, i] = $(i + 3); is_kept[key] = 1; next }
!(key in is_kept) { print "gpu_code: " key " is not in the kept table"; failed = 1; next }
{
  seen[key] = 1
  for (i = 1; i <= 5; ++i) {
    before = kept[key, i]
    now = $(i + 3)
    if (now == before) continue
    worse = i == 4 ? now < 0.9 * before : now > 1.1 * before
    printf "%s %s: %s before, %s now%s\n", key, names[i], before, now, worse ? "  WORSE" : ""
    if (worse) failed = 1
  }
}
END {
  for (key in is_kept) if (!(key in seen)) { print "gpu_code: " key " is only in the kept table"; failed = 1 }
  if (failed && version[ARGV[1]] != version[ARGV[2]])
    print "gpu_code: the kept table is by Mesa " version[ARGV[1]] ", this one by " version[ARGV[2]] \
      ": that may be the reason. tests/gpu_code/run.sh --keep on shaders that have not changed tells"
  else if (failed)
    print "gpu_code: worse by more than a tenth, or other passes; where that is meant, tests/gpu_code/run.sh --keep"
  else
    print "gpu_code: no pass is worse by more than a tenth"
  exit failed
}
