#!/usr/bin/env bash
# Makes the pictures of README and docs from committed samples.
#
#   tests/pictures.sh            makes all; needs chromium for the screenshot of the page
#   tests/pictures.sh --check    says whether the pictures are current, byte for byte, and changes nothing
#
# The screenshot is not checked: fonts and seconds differ from machine to machine. RAYKILN is the program to use.
set -euo pipefail
cd "$(dirname "$0")/.."

case "$*" in
  '') check= ;;
  --check) check=yes ;;
  *)
    echo "usage: tests/pictures.sh [--check]" >&2
    exit 2
    ;;
esac

raykiln=$(realpath "${RAYKILN:-target/release/raykiln}")
[ -x "$raykiln" ] || { echo "there is no $raykiln: cargo build --release" >&2; exit 2; }
made=$(mktemp -d)
trap 'rm -rf "$made"' EXIT
baked=$made/baked.glb
mkdir "$made/pictures"
cp samples/woven/scene.glb "$made/woven.glb"

# draw SCENE NAME OPTIONS...: draws a picture of the woven rows from one place.
draw() {
  local scene=$1 name=$2
  shift 2
  "$raykiln" render "$scene" -o "$made/pictures/$name.png" --quiet --size 480x300 --camera=8,8.5,10,3.5,3.4,0,44 "$@"
}

page=(--report page.html)
[ -z "$check" ] || page=()
# From within the folder, so that the page shows no path of this machine.
(cd "$made" && "$raykiln" bake woven.glb -o baked.glb --quiet --device cpu "${page[@]}")
for side in before after; do
  scene=samples/woven/scene.glb
  [ "$side" = before ] || scene=$baked
  draw "$scene" "groups-$side" --view groups
  draw "$scene" "heatmap-$side" --view heatmap --samples 4 --scale 100
done

if [ -n "$check" ]; then
  stale=()
  for picture in "$made"/pictures/*.png; do
    cmp -s "$picture" "docs/pictures/$(basename "$picture")" || stale+=("$(basename "$picture")")
  done
  [ ${#stale[@]} -eq 0 ] || { echo "not current: ${stale[*]}; tests/pictures.sh makes them" >&2; exit 1; }
  echo "the pictures are current"
  exit
fi

chromium --headless --no-sandbox --use-angle=swiftshader --enable-unsafe-swiftshader --hide-scrollbars \
  --window-size=1100,1250 --force-device-scale-factor=0.75 --virtual-time-budget=4000 \
  --screenshot="$made/pictures/page.png" "file://$made/page.html" 2>/dev/null
mkdir -p docs/pictures
cp "$made"/pictures/*.png docs/pictures/
ls -l docs/pictures
