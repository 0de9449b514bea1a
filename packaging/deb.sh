#!/usr/bin/env bash
# Makes a Debian package of a program that is built: with its completions and manual page, by cargo-deb
# (cargo install --locked cargo-deb). Prints the path of the package.
#
#   cargo build --release && packaging/deb.sh [FOLDER]             writes to target/debian, or to FOLDER
#   PROFILE=dev packaging/deb.sh                                   packs target/debug/raykiln
set -euo pipefail
cd "$(dirname "$0")/.."

profile=${PROFILE:-release}
built=target/$([ "$profile" = dev ] && echo debug || echo "$profile")
made=target/packaging
rm -rf "$made" && mkdir -p "$made"
"$built/raykiln" completions bash >"$made/raykiln.bash"
"$built/raykiln" completions zsh >"$made/_raykiln"
"$built/raykiln" completions fish >"$made/raykiln.fish"
"$built/raykiln" man | gzip -9n >"$made/raykiln.1.gz"
# Unoptimised programs are large: what is packed for a test need not be small.
cargo deb --quiet ${FAST:+--fast} --no-build --no-strip --profile "$profile" --output "${1:-target/debian}/"
