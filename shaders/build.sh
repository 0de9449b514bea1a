#!/bin/sh
# Compiles all shaders to SPIR-V, into this folder or the one given.
set -eu
cd "$(dirname "$0")"
out=${1:-.}
for shader in *.rgen *.rmiss *.rchit *.rahit; do
    glslangValidator --quiet --target-env vulkan1.2 -o "$out/$shader.spv" "$shader"
done
