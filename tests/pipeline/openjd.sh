#!/usr/bin/env bash
# Checks and runs the job of `raykiln batch --engine openjd` with PyPI's openjd-cli, found by PATH or in `target/python`.
#
#   tests/pipeline/openjd.sh PROGRAM
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"
PATH=$PATH:$root/target/python/bin
cd "$scratch" || exit

is_valid() {
  raykiln batch 'assets/**/*.obj' --out baked --cache cache "${FEW_RAYS[@]}" --max-memory 2GiB --plan job.json --engine openjd --shards 3 &&
    openjd check job.json
}

runs() {
  openjd run job.json --step Collect --run-dependencies && [ "$(counted baked unchanged)" -eq 7 ] && same local baked
}

# A task that is lost is found missing by the step that sums up, and running it again is all it takes.
goes_on() {
  rm -rf baked cache
  openjd run job.json --step Bake --task-param Shard=2 --no-run-dependencies || return
  ! openjd run job.json --step Collect --no-run-dependencies || return
  [ "$(counted baked missing)" -gt 0 ] && runs
}

assets assets 7
raykiln batch 'assets/**/*.obj' --out local "${FEW_RAYS[@]}" --quiet || exit
case_of "openjd: the template passes openjd check" is_valid
case_of "openjd: the job bakes what a local run bakes" runs
case_of "openjd: a lost task is found and run again" goes_on
finish
