#!/usr/bin/env bash
# Makes the pictures and charts of README and docs from committed samples, in docs/pictures, and page and charts of
# docs/thesis from the committed rows of a GPU, if they are there.
#
#   tests/pictures.sh            makes all; needs chromium for the screenshot of the page
#   tests/pictures.sh --check    says whether they are current, byte for byte, and changes nothing
#
# The screenshot is not checked: fonts and seconds differ from machine to machine. RAYKILN is the program to use. Figures in
# docs/figures are measurements of real scenes; docs/accuracy.md states commands and machines.
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

# The chart of the tutorial of the lab. Paths in the file are relative to it.
mkdir -p "$made/examples/lab"
cp examples/lab/methods.toml "$made/examples/lab/"
ln -s "$PWD/samples" "$made/samples"
"$raykiln" lab "$made/examples/lab/methods.toml" --quiet >"$made/lab.log" || { cat "$made/lab.log" >&2; exit 1; }
cp "$made/examples/lab/methods-results/methods.svg" "$made/pictures/"

# The experiments of the thesis. Their pictures show real scenes and stay as they are.
mkdir -p "$made/thesis/figures"
if [ -e docs/thesis/runs.jsonl ]; then
  cp docs/thesis/runs.jsonl "$made/thesis/"
  cp docs/thesis/figures/*.png "$made/thesis/figures/"
  # Status 1: some rows could not be measured, as the page says.
  "$raykiln" lab thesis --redraw --out "$made/thesis" --quiet 2>"$made/lab.log" || [ $? -eq 1 ] || { cat "$made/lab.log" >&2; exit 1; }
  # The comment at the top says how, where and when it was measured.
  { sed -n '1,/-->/p' docs/thesis/results.md; echo; cat "$made/thesis/thesis.md"; } >"$made/thesis/results.md"
  rm "$made"/thesis/{runs.jsonl,thesis.html,thesis.md} "$made"/thesis/figures/*.png
fi

if [ -n "$check" ]; then
  stale=()
  while read -r picture; do
    cmp -s "$made/$picture" "docs/$picture" || stale+=("$picture")
  done < <(cd "$made" && find pictures thesis -type f | sort)
  [ ${#stale[@]} -eq 0 ] || { echo "not current: ${stale[*]}; tests/pictures.sh makes them" >&2; exit 1; }
  echo "the pictures are current"
  exit
fi

chromium --headless --no-sandbox --use-angle=swiftshader --enable-unsafe-swiftshader --hide-scrollbars \
  --window-size=1100,1250 --force-device-scale-factor=0.75 --virtual-time-budget=4000 \
  --screenshot="$made/pictures/page.png" "file://$made/page.html" 2>/dev/null
mkdir -p docs/pictures
cp "$made"/pictures/* docs/pictures/
cp -r "$made"/thesis/. docs/thesis/
ls -l docs/pictures
