#!/bin/sh
# Installs what the Vulkan tests need on Debian or Ubuntu: the loader, the validation layer, glslang, and a software
# driver (lavapipe) of Mesa 24.1 or later, which can trace rays. Does nothing if everything is installed. Needs root or
# sudo. With --missing, only lists what it would install.
set -eu

wanted="libvulkan1 vulkan-validationlayers glslang-tools mesa-vulkan-drivers"
oldest_mesa=24.1

root() { if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi; }
version() { dpkg-query --show --showformat='${Version}' "$1" 2>/dev/null || true; }
can_trace() { [ -n "$1" ] && [ "$1" != "(none)" ] && dpkg --compare-versions "$1" ge "$oldest_mesa"; }
candidate() { apt-cache policy mesa-vulkan-drivers | sed -n 's/^  Candidate: //p'; }

all_installed() {
    for package in $wanted; do
        [ -n "$(version "$package")" ] || return 1
    done
    can_trace "$(version mesa-vulkan-drivers)"
}

# Adds the backports suite of this release, from the archive that this machine's sources already use.
add_backports() {
    . /etc/os-release
    suite="$VERSION_CODENAME-backports"
    archive=$(apt-get indextargets --format '$(REPO_URI) $(RELEASE) $(COMPONENT) $(CREATED_BY)' \
        | awk -v release="$VERSION_CODENAME" '$2 == release && $3 == "main" && $4 == "Packages" { print $1; exit }')
    keys=/usr/share/keyrings/debian-archive-keyring.gpg
    if [ -z "$archive" ]; then
        echo "install_vulkan.sh: no archive of $VERSION_CODENAME among the apt sources" >&2
        exit 1
    fi
    {
        printf 'Types: deb\nURIs: %s\nSuites: %s\nComponents: main\n' "$archive" "$suite"
        [ ! -e "$keys" ] || printf 'Signed-By: %s\n' "$keys"
    } | root tee /etc/apt/sources.list.d/raykiln-backports.sources >/dev/null
    root apt-get update -qq
}

# Lists what is missing, one per line.
list_missing() {
    for package in libvulkan1 vulkan-validationlayers glslang-tools; do
        [ -n "$(version "$package")" ] || echo "$package: apt-get install"
    done
    if can_trace "$(version mesa-vulkan-drivers)"; then
        return
    fi
    if can_trace "$(candidate)"; then
        echo "mesa-vulkan-drivers $oldest_mesa or later: apt-get install"
    else
        echo "mesa-vulkan-drivers $oldest_mesa or later: from the release's backports, which is added to the package sources" \
            "as /etc/apt/sources.list.d/raykiln-backports.sources and stays there; may upgrade libraries such as libdrm"
    fi
}

if [ "${1:-}" = --missing ]; then
    list_missing
    exit 0
fi
if all_installed; then
    exit 0
fi
root apt-get update -qq
from_backports=
if ! can_trace "$(candidate)"; then
    add_backports
    from_backports="--target-release=$VERSION_CODENAME-backports"
fi
# shellcheck disable=SC2086 # lists of words, one of which is often empty
{
    root env DEBIAN_FRONTEND=noninteractive apt-get install -qq --no-install-recommends \
        libvulkan1 vulkan-validationlayers glslang-tools
    root env DEBIAN_FRONTEND=noninteractive apt-get install -qq --no-install-recommends $from_backports \
        mesa-vulkan-drivers
}
if ! all_installed; then
    echo "install_vulkan.sh: the archive has no mesa-vulkan-drivers of version $oldest_mesa or later" >&2
    exit 1
fi
