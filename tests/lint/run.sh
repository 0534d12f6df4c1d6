#!/usr/bin/env bash
# clang-tidy on every target that has changed since it passed. A target's sources are read at once: most
# of the time goes into the headers of libraries.
#
#   tests/lint/run.sh       the targets whose text is not what passed.txt says has passed
#   tests/lint/run.sh all   those too that have passed, but not on this machine
#
# passed.txt has a hash of what was read and the name for each target. What passes is written into it:
# commit it with the change, or everybody's next run looks at the target again.
set -uo pipefail
cd "$(dirname "$0")/../.." || exit
LINT_ALL=$([[ ${1:-} == all ]] && echo 1 || echo 0)
export LINT_ALL
mkdir -p "${XDG_CACHE_HOME:-$HOME/.cache}/previzd/lint"
rm -rf build/lint
cmake --preset lint --log-level=WARNING >/dev/null || exit
cmake --build build/lint --target previz_render_shaders previz_tracer_shaders >/dev/null || exit
status=0
# The largest first, since one that is begun last is waited for.
find build/lint -name 'unity_*.cxx' -printf '%s %p\n' | sort -rn | cut -d' ' -f2 |
  xargs -P "$(nproc)" -I{} tests/lint/target.sh {} || status=1
find build/lint -name 'unity_*.cxx.passed' -exec cat {} + | sort -k2 >build/lint/passed.txt
[[ $status != 0 ]] || cmp -s build/lint/passed.txt tests/lint/passed.txt || {
  cp build/lint/passed.txt tests/lint/passed.txt
  echo "lint: tests/lint/passed.txt has changed; commit it"
}
printf 'lint: %d of %d targets pass\n' "$(wc -l <build/lint/passed.txt)" "$(find build/lint -name 'unity_*.cxx' | wc -l)"
exit "$status"
