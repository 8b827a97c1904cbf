#!/usr/bin/env bash
# Makes docs/demo.png and docs/report.png again, so that they show what the program shows:
#
#     docs/pictures.sh [all|demo|report] [TAUSCOPE]
#
# Builds tauscope, unless the program is named, and runs it: the bundled recording for the Rerun viewer
# (docs/screenshot.sh says what that needs), and the case of the README, "Let it find something", for the page. The
# page needs Chromium (`apt-get install --no-install-recommends chromium`).
set -euo pipefail

cd "$(dirname "$0")/.."
which=${1:-all}
tauscope=${2:-}
if [ -z "$tauscope" ]; then
    cargo build --release
    tauscope=${CARGO_TARGET_DIR:-target}/release/tauscope
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

if [ "$which" != report ]; then
    "$tauscope" replay --pipeline pipeline.yaml tests/data/demo.mcap --out "$work/demo" >/dev/null
    picture=$(find "$work/demo" -name '*.rrd' | head -n 1)
    # While the first push is at its strongest.
    docs/screenshot.sh "$picture" docs/demo.png 3.7
fi
if [ "$which" != demo ]; then
    "$tauscope" simulate tests/data/concealed.scenario.yaml --out "$work/out/concealed" >/dev/null
    # With the paths that a reader of the README has.
    tauscope=$(realpath "$tauscope")
    (cd "$work" && "$tauscope" explain out/concealed/case.yaml --out out/explained >/dev/null)
    chromium --headless --no-sandbox --hide-scrollbars --window-size=1120,1560 \
        --screenshot="$PWD/docs/report.png" "file://$work/out/explained/report.html" 2>/dev/null
fi
