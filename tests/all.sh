#!/usr/bin/env bash
# The test command: formatting, lints, documentation and every test, from a fresh checkout on. Needs cargo with the
# components rustfmt and clippy; installs (with apt-get, where they are missing) Node.js and a software driver of Vulkan
# that traces rays, and, below target/, the Khronos glTF validator. Runs every step even when one fails; exit status 0 only if all succeeded.
set -uo pipefail
cd "$(dirname "$0")/.." || exit 1

failed=()

# step NAME COMMAND...: runs a command under a headline and remembers whether it failed.
step() {
  local name=$1
  shift
  printf '\n== %s ==\n' "$name"
  "$@" || failed+=("$name")
}

install_node() {
  command -v node >/dev/null && command -v npm >/dev/null && return
  local as_root=()
  [ "$(id -u)" -eq 0 ] || as_root=(sudo)
  "${as_root[@]}" apt-get update && "${as_root[@]}" apt-get install -y --no-install-recommends nodejs npm
}

install_validator() {
  local into=target/npm
  [ -d $into/node_modules/gltf-validator ] && cmp -s tests/package-lock.json $into/package-lock.json && return
  mkdir -p $into && cp tests/package.json tests/package-lock.json $into/ && (cd $into && npm ci)
}

set_up() {
  install_node && install_validator && node --version && sh tests/install_vulkan.sh
}

# Random cases are the same in every run; PROPTEST_RNG_SEED=N tests/all.sh draws others.
export PROPTEST_RNG_SEED=${PROPTEST_RNG_SEED:-1}

step "set-up" set_up
step "formatting" cargo fmt --all --check
step "lints" cargo clippy --workspace --all-targets --locked -- -D warnings
step "documentation" env RUSTDOCFLAGS="-D warnings" cargo doc --no-deps --workspace --locked
step "tests" cargo test --workspace --locked --no-fail-fast

printf '\n== result ==\n'
if [ ${#failed[@]} -eq 0 ]; then
  echo "every step succeeded"
else
  printf 'failed: %s\n' "${failed[@]}"
  exit 1
fi
