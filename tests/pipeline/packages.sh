#!/usr/bin/env bash
# Makes the packages of a program that is built (target/debug/raykiln), installs them into folders of their own, and removes them:
# crates, a Debian package, a Python wheel, and the container file.
#
#   tests/pipeline/packages.sh PROGRAM
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"
cd "$root" || exit
python=$root/target/python/bin
PATH=$PATH:$root/target/cargo/bin:$python
export CARGO_TERM_COLOR=never

# bakes PROGRAM: whether an installed program bakes.
bakes() {
  "$1" bake samples/overlapping/scene.glb -o "$scratch/out.glb" "${FEW_RAYS[@]}" --quiet &&
    [ "$("$1" --version)" = "$(raykiln --version)" ]
}

# Packs the crates, unpacks them elsewhere, and installs from there, with the other crates in place of a registry's.
packed_crates_install() {
  local version name
  version=$(raykiln --version | cut -d' ' -f2)
  cargo package --workspace --locked --allow-dirty --no-verify --quiet || return
  for name in raykiln raykiln-formats raykiln-allocator; do
    tar -xzf "target/package/$name-$version.crate" -C "$scratch" || return
  done
  local patches=()
  for name in formats allocator; do
    patches+=(--config "patch.crates-io.raykiln-$name.path='$scratch/raykiln-$name-$version'")
  done
  # The folder of the build is shared, so that what is built already need not be built again.
  cargo install --path "$scratch/raykiln-$version" --root "$scratch/installed" --debug --offline "${patches[@]}" \
    --target-dir target --quiet && bakes "$scratch/installed/bin/raykiln"
}

debian_package_installs_and_removes() {
  local admin=$scratch/system
  PROFILE=dev FAST=yes packaging/deb.sh "$scratch/deb" || return
  mkdir -p "$admin/var/lib/dpkg/updates" "$admin/var/lib/dpkg/info" && touch "$admin/var/lib/dpkg/status" "$admin/var/lib/dpkg/available"
  ls "$scratch"/deb/*.deb && dpkg-deb --info "$scratch"/deb/*.deb || return
  # The folder is no system, so that the libraries that it depends on are not in it.
  dpkg --root="$admin" --force-depends --force-not-root --force-script-chrootless --log="$scratch/dpkg.log" --install "$scratch"/deb/*.deb &&
    bakes "$admin/usr/bin/raykiln" || return
  local file
  for file in man/man1/raykiln.1.gz bash-completion/completions/raykiln zsh/vendor-completions/_raykiln \
    fish/vendor_completions.d/raykiln.fish doc/raykiln/copyright; do
    [ -s "$admin/usr/share/$file" ] || return
  done
  man --warnings -l "$admin/usr/share/man/man1/raykiln.1.gz" 2>&1 >/dev/null | grep . && return 1
  bash -n "$admin/usr/share/bash-completion/completions/raykiln" || return
  dpkg --root="$admin" --force-not-root --force-script-chrootless --log="$scratch/dpkg.log" --purge raykiln || return
  ! find "$admin/usr" -type f 2>/dev/null | grep .
}

wheel_installs_and_passes_its_tests() {
  local fresh=$scratch/fresh
  "$python/maturin" build --manifest-path python/Cargo.toml --target-dir target/wheel --profile dev --out "$scratch/wheel" --locked &&
    ls "$scratch"/wheel/raykiln-*-cp39-abi3-*.whl || return
  python3 -m venv "$fresh" && "$fresh/bin/pip" install --quiet "$scratch"/wheel/*.whl pytest mypy || return
  # In another folder, so that the package is found where it is installed alone.
  cd "$scratch" && "$fresh/bin/python" -m pytest -q -p no:cacheprovider "$root/python/tests" &&
    "$fresh/bin/python" -m mypy.stubtest raykiln --ignore-missing-stub --ignore-disjoint-bases
}

container_file_is_sound() {
  "$python/hadolint" packaging/Containerfile || return
  # It can be built only where a daemon runs.
  ! docker info >/dev/null 2>&1 || docker build -f packaging/Containerfile -t raykiln-test .
}

case_of "packages: crates that are packed install" packed_crates_install
case_of "packages: the Debian package installs and removes cleanly" debian_package_installs_and_removes
case_of "packages: the wheel installs into a fresh environment and passes its tests" wheel_installs_and_passes_its_tests
case_of "packages: the container file is sound" container_file_is_sound
finish
