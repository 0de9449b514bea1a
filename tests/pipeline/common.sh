# What the scripts of this folder share. Each runs as `SCRIPT PROGRAM`, where PROGRAM is the `raykiln` to test, and prints a line per
# case; the exit status is 0 only if all cases passed.
set -uo pipefail

program=$(realpath "${1:?usage: $0 PROGRAM}")
here=$(cd "$(dirname "${BASH_SOURCE[1]}")" && pwd)
root=$(cd "$here/../.." && pwd)
scratch=$(mktemp -d)
mkdir "$scratch/bin" && ln -s "$program" "$scratch/bin/raykiln"
PATH=$scratch/bin:$PATH
passed=0 failed=0

# What stops services; scripts override it.
stop() { :; }
trap 'stop; rm -rf "$scratch"' EXIT

# case NAME COMMAND...: runs a case.
case_of() {
  local name=$1 log=$scratch/log
  shift
  if "$@" >"$log" 2>&1; then
    passed=$((passed + 1))
    echo "test $name ... ok"
  else
    failed=$((failed + 1))
    echo "test $name ... FAILED"
    sed 's/^/  /' "$log"
  fi
}

# Prints the result as cargo does, and ends the script with it.
finish() {
  local result=ok
  [ "$failed" -eq 0 ] || result=FAILED
  echo "test result: $result. $passed passed; $failed failed"
  [ "$failed" -eq 0 ]
  exit
}

# Options that keep bakes short.
FEW_RAYS=(--device cpu --rays 100 --repeats 1 --views 2)

# assets FOLDER COUNT: writes COUNT small OBJ files, all different, in two folders.
assets() {
  local i
  mkdir -p "$1/in"
  for ((i = 0; i < $2; i++)); do
    local file=$1/$i.obj
    [ $((i % 2)) -eq 0 ] || file=$1/in/$i.obj
    printf 'v 0 0 0\nv %d 0 0\nv 0 1 0\nv 0 0 %d\nf 1 2 3\nf 1 2 4\n' $((i + 1)) $((i + 2)) >"$file"
  done
}

# outputs FOLDER: the hash of each visible file but the summary.
outputs() {
  (cd "$1" && find . -type f -not -path '*/.*' -not -name 'summary.*' | sort | xargs sha256sum)
}

# same A B: whether two folders have the same outputs.
same() {
  diff <(outputs "$1") <(outputs "$2")
}

# counted FOLDER STATUS: number of assets of a status in a summary.
counted() {
  python3 -c 'import json, sys; print(json.load(open(sys.argv[1] + "/summary.json"))["counts"][sys.argv[2]])' "$1" "$2"
}
