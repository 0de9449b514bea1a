#!/usr/bin/env bash
# Measures what docs/pipeline.md states: a first run over many generated assets, a second one, one from the cache alone, and the
# largest memory of runs within --max-memory, as /proc has it. Not part of the tests, because it takes minutes.
#
#   tests/pipeline/measure.sh PROGRAM [COUNT [SIZE]]
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"
count=${2:-10000} most=${3:-4GiB}
cd "$scratch" || exit

run() {
  local what=$1 start
  shift
  start=$(date +%s.%N)
  python3 "$here/peak.py" raykiln batch 'assets/**/*.glb' --out baked --device cpu --quiet "$@"
  echo "$what: $(echo "$(date +%s.%N) - $start" | bc) s"
  python3 -c 'import json; print(json.load(open("baked/summary.json"))["counts"])'
}

python3 "$here/generate_assets.py" "$count" 1 assets
find assets -name '*.glb' -printf '%s\n' | sort -n |
  awk '{ size[NR] = $1; sum += $1 } END { print NR, "assets of", size[1], "to", size[NR], "bytes, median", size[int(NR / 2)], "sum", sum }'
run "first run" --cache cache
outputs baked >first
run "second run" --cache cache
rm -rf baked
run "from the cache" --cache cache
outputs baked | cmp - first && echo "the same bytes"
for seed in 1 2 3 4 5 6 7 8 9 10; do
  rm -rf baked
  run "within $most" --max-memory "$most" --seed "$seed"
done
