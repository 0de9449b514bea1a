#!/usr/bin/env bash
# Builds examples/pipeline with Make, Ninja, CMake and Bazel, as far as they are installed: everything once, nothing a second time, and
# after a change exactly what depends on it.
#
#   tests/pipeline/build_tools.sh PROGRAM
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

# example FOLDER: a copy of the example.
example() {
  cp -r "$root/examples/pipeline" "$scratch/$1" && cd "$scratch/$1"
}

# change FILE: changes a file as an editor does; its time must be later than that of what was built.
change() {
  sleep 0.02 && printf '\n' >>"$1"
}

# has_baked OUTPUT NAME...: whether what a tool printed names exactly these bakes.
has_baked() {
  local printed=$1
  shift
  diff <(echo "$printed" | grep -o 'crate[.]obj\|tile[.]gltf' | sort -u) <(printf '%s\n' "$@" | grep . | sort)
}

# rebuilds_what_changed FOLDER COMMAND...: by the bakes that the command prints.
rebuilds_what_changed() {
  local folder=$1
  shift
  has_baked "$("$@")" crate.obj tile.gltf && has_baked "$("$@")" && [ "$(find -L "$folder" -name '*.glb' | wc -l)" -eq 2 ] || return
  local file
  for file in crate.obj crate.mtl crate.png; do
    change "assets/$file" && has_baked "$("$@")" crate.obj || return
  done
  change assets/props/tile.bin && has_baked "$("$@")" tile.gltf && has_baked "$("$@")"
}

make_rebuilds() {
  example make && rebuilds_what_changed baked make -j2 OPTIONS="${FEW_RAYS[*]}"
}

ninja_rebuilds() {
  example ninja && sed -i "s/^options =.*/options = ${FEW_RAYS[*]}/" build.ninja && rebuilds_what_changed baked ninja
}

cmake_rebuilds() {
  example "cmake-$1" && cmake -B build -G "$2" -DOPTIONS="$(IFS=';' && echo "${FEW_RAYS[*]}")" &&
    rebuilds_what_changed build/baked cmake --build build
}

bazel_rebuilds() {
  example bazel && sed -i "s/--device cpu/${FEW_RAYS[*]}/" BUILD.bazel && rebuilds_what_changed bazel-bin/ bazel_build
}

# Prints the commands that Bazel runs.
bazel_build() {
  bazel --output_user_root="$scratch/bazel-cache" build --subcommands //:baked 2>&1
}

# What `batch --engine ninja` writes.
ninja_plan_rebuilds() {
  example plan && rm build.ninja || return
  raykiln batch 'assets/**/*.[og][bl]*' --out out --cache cache "${FEW_RAYS[@]}" --quiet --plan build.ninja --engine ninja &&
    rebuilds_what_changed out ninja && ninja summary && [ "$(counted out cached)" -eq 2 ]
}

stop() {
  [ ! -d "$scratch/bazel" ] || (cd "$scratch/bazel" && bazel --output_user_root="$scratch/bazel-cache" shutdown) 2>/dev/null
  chmod -R u+w "$scratch"
}

# with TOOL NAME COMMAND...: runs a case if the tool is there; with CI it must be.
with() {
  local tool=$1 name=$2
  shift 2
  if command -v "$tool" >/dev/null || [ -n "${CI:-}" ]; then
    case_of "$name" "$@"
  else
    echo "test $name ... ignored, $tool is not installed"
  fi
}

with make "make rebuilds exactly what changed" make_rebuilds
with ninja "ninja rebuilds exactly what changed" ninja_rebuilds
with ninja "ninja rebuilds exactly what changed, by the file of a batch" ninja_plan_rebuilds
with cmake "cmake with make rebuilds exactly what changed" cmake_rebuilds make "Unix Makefiles"
with ninja "cmake with ninja rebuilds exactly what changed" cmake_rebuilds ninja Ninja
with bazel "bazel rebuilds exactly what changed" bazel_rebuilds
finish
