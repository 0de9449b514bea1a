#!/usr/bin/env bash
# Runs formatting, lints, feature checks, documentation and all tests. Continues if a step fails; the exit status is 0
# only if all steps succeed. Needs cargo with the components rustfmt and clippy, and what `missing` lists below.
#
#   tests/all.sh             fails at once if something is missing, and says how to get it
#   tests/all.sh --install   says what it installs and where, installs it, then runs; so does CI=true tests/all.sh
#
# FARM=yes also runs job arrays of Slurm, whose daemons it starts and kills; PACKAGES=yes also makes and installs the crates, the
# Debian package and the Python wheel, which takes ten minutes.
set -uo pipefail
cd "$(dirname "$0")/.." || exit 1

case "$*" in
  '') install=${CI:-} ;;
  --install) install=yes ;;
  *)
    echo "usage: tests/all.sh [--install]" >&2
    exit 2
    ;;
esac

failed=()

# step NAME COMMAND...: runs a command under a heading and records whether it failed.
step() {
  local name=$1
  shift
  printf '\n== %s ==\n' "$name"
  "$@" || failed+=("$name")
}

has_node() {
  command -v node >/dev/null && command -v npm >/dev/null
}

has_packages() {
  [ -d target/npm/node_modules/gltf-validator ] && cmp -s tests/package-lock.json target/npm/package-lock.json
}

has_chromium() {
  command -v chromium >/dev/null
}

# Tools that build examples/pipeline, and with FARM Slurm: program and package of Debian.
PIPELINE_TOOLS=(make:make pgrep:procps ninja:ninja-build cmake:cmake bazel:bazel-bootstrap)
[ -z "${FARM:-}" ] || PIPELINE_TOOLS+=(slurmctld:slurmctld slurmd:slurmd sbatch:slurm-client)

# Packages of the tools that are missing.
missing_pipeline_tools() {
  local tool
  for tool in "${PIPELINE_TOOLS[@]}"; do
    PATH=$PATH:/usr/sbin command -v "${tool%%:*}" >/dev/null || echo "${tool##*:}"
  done
}

# Packages of PyPI: Open Job Description, and what builds and tests the wheel.
has_python_packages() {
  [ -x target/python/bin/openjd ] && cmp -s tests/pipeline/requirements.txt target/python/requirements.txt
}

has_cargo_deb() {
  [ -z "${PACKAGES:-}" ] || [ -x target/cargo/bin/cargo-deb ] || command -v cargo-deb >/dev/null
}

# Lists what the tests need and this machine lacks, one per line, with what `--install` does about it.
missing() {
  has_node || echo "Node.js and npm: apt-get install nodejs npm"
  has_packages || echo "the Khronos glTF validator, Playwright and other packages of tests/package.json: npm ci, into target/npm"
  has_chromium || echo "chromium: apt-get install chromium"
  [ -z "$(missing_pipeline_tools)" ] || echo "tools for tests/pipeline: apt-get install $(missing_pipeline_tools | xargs)"
  has_python_packages || echo "packages of tests/pipeline/requirements.txt: pip install, into target/python"
  has_cargo_deb || echo "cargo-deb: cargo install, into target/cargo"
  sh tests/install_vulkan.sh --missing
}

# install_debian PACKAGE...: installs packages of the system.
install_debian() {
  local as_root=()
  [ "$(id -u)" -eq 0 ] || as_root=(sudo)
  "${as_root[@]}" apt-get update && "${as_root[@]}" apt-get install -y --no-install-recommends "$@"
}

install_node() {
  has_node || install_debian nodejs npm
}

install_chromium() {
  has_chromium || install_debian chromium
}

install_packages() {
  has_packages && return
  mkdir -p target/npm && cp tests/package.json tests/package-lock.json target/npm/ && (cd target/npm && npm ci)
}

install_pipeline_tools() {
  local packages
  packages=$(missing_pipeline_tools)
  # shellcheck disable=SC2086 # a package is a word
  [ -z "$packages" ] || DEBIAN_FRONTEND=noninteractive install_debian $packages
}

install_python_packages() {
  has_python_packages && return
  python3 -m venv target/python && target/python/bin/pip install --quiet --requirement tests/pipeline/requirements.txt &&
    cp tests/pipeline/requirements.txt target/python/
}

# Unoptimised, which takes less time to compile.
install_cargo_deb() {
  has_cargo_deb || cargo install --quiet --locked --debug --root target/cargo --version 3.8.0 cargo-deb
}

install_missing() {
  install_node && install_packages && install_chromium && node --version && install_pipeline_tools &&
    install_python_packages && install_cargo_deb && sh tests/install_vulkan.sh
}

# Checks each feature alone, and none: the library, the examples and, with `cli`, the program.
check_features() {
  local features
  for features in "" cli lab vulkan; do
    echo "features: ${features:-none}"
    cargo clippy --quiet --lib --bins --examples --locked --no-default-features --features "$features" -- -D warnings || return
  done
}

# The test `dependencies` checks deny.toml too; cargo-deny, which takes long to install, runs only if it is installed.
check_dependencies() {
  if cargo deny --version 2>/dev/null; then
    cargo deny --offline --locked check licenses bans
  else
    echo "cargo-deny is not installed (cargo install --locked cargo-deny): left to the test \`dependencies\`"
  fi
}

lacking=$(missing)
if [ -n "$lacking" ]; then
  printf 'missing on this machine:\n%s\n' "$lacking"
  if [ -z "$install" ]; then
    printf '\n`tests/all.sh --install` installs this.\n'
    exit 1
  fi
  printf '\ninstalling it\n'
  step "set-up" install_missing
fi

# What builds once is not worth preparing for a second build.
[ -z "${CI:-}" ] || export CARGO_INCREMENTAL=0

# Random cases are the same in every run; PROPTEST_RNG_SEED=N tests/all.sh generates others.
export PROPTEST_RNG_SEED=${PROPTEST_RNG_SEED:-1}

# All but the tests.
checks() {
  step "formatting" cargo fmt --all --check
  step "lints" cargo clippy --workspace --all-targets --locked -- -D warnings
  step "features" check_features
  step "dependencies" check_dependencies
  step "documentation" env RUSTDOCFLAGS="-D warnings" cargo doc --no-deps --workspace --locked
}

# The program in build tools and on farms.
pipeline() {
  local name
  for name in build_tools openjd ${FARM:+slurm} ${PACKAGES:+packages}; do
    bash "tests/pipeline/$name.sh" target/debug/raykiln || return
  done
}

tests() {
  step "tests" cargo test --workspace --locked --no-fail-fast
  step "pipeline" pipeline
}

# Runs the checks beside the tests, in a folder of their own as two builds cannot share one: much of either uses one
# core only. Prints what they say when the tests have ended.
tests_beside_checks() {
  local log
  log=$(mktemp)
  (
    export CARGO_TARGET_DIR=target/checks
    checks
    [ ${#failed[@]} -eq 0 ]
  ) >"$log" 2>&1 &
  tests
  wait $! || failed+=("checks")
  cat "$log"
  rm -f "$log"
}

if [ -n "${CI:-}" ]; then
  tests_beside_checks
else
  checks
  tests
fi

printf '\n== result ==\n'
if [ ${#failed[@]} -eq 0 ]; then
  echo "every step succeeded"
else
  printf 'failed: %s\n' "${failed[@]}"
  exit 1
fi
