#!/usr/bin/env bash
# Takes a picture of a Rerun recording as the real viewer shows it:
#
#     docs/screenshot.sh RECORDING.rrd PICTURE.png [SECONDS [TIMELINE]]
#
# SECONDS from the start is where the time cursor stands (default 0); TIMELINE is `recording_time` for explain.rrd. Installs the viewer of the version
# that the recorder writes for into target/viewer. Needs Python 3 and a Vulkan driver; without a graphics
# card one that computes: `apt-get install --no-install-recommends mesa-vulkan-drivers`.
set -euo pipefail

recording=$(realpath "$1") picture=$(realpath -m "$2") seconds=${3:-0}
cd "$(dirname "$0")/.."
version=$(sed -n 's/^rerun = .*version = "\([0-9.]*\)".*/\1/p' Cargo.toml)
viewer=${CARGO_TARGET_DIR:-target}/viewer
if [ ! -x "$viewer/bin/rerun" ]; then
    python3 -m venv "$viewer"
    "$viewer/bin/pip" install --quiet "rerun-sdk==$version"
fi
"$viewer/bin/python" docs/screenshot.py "$recording" "$picture" "$seconds" "${4:-ros2_timestamp}"
