#!/usr/bin/env bash
# Runs a small plant on this computer and takes pictures of its wall:
#
#     docs/fleet.sh [TAUSCOPE] [FOLDER]
#
# Three cells play the bundled recording, a fourth is expected and does not come; one of the three is killed. The picture
# for docs/fleet.md is docs/fleet.png. With FOLDER, the wall and a cell's page are also taken there, wide and narrow,
# light and dark. Needs Chromium (`apt-get install --no-install-recommends chromium`).
set -euo pipefail

cd "$(dirname "$0")/.."
root=$PWD
tauscope=$(realpath "${1:-target/debug/tauscope}")
folder=$(realpath -m "${2:-.}")
router=tcp/127.0.0.1:17447
page=127.0.0.1:17460
work=$(mktemp -d)
trap 'kill $(jobs -p) 2>/dev/null || true; wait 2>/dev/null || true; rm -rf "$work"' EXIT

cell() { # name, speed, latch
    mkdir "$work/$1"
    cat >"$work/$1/pipeline.yaml" <<EOF
version: 1
cells: {$1: {robot: $root/tests/data/demo_arm.urdf}}
stages:
- name: ingest
  ingest: {file: {path: $root/tests/data/demo.mcap}, rate: $2, commands: {connect: [$router]}}
- {name: twin, input: ingest, twin: {model: $root/tests/data/demo.explained.yaml}}
- {name: detect, input: twin, detect: {tauscope: {learnt: $root/tests/data/demo.learnt.yaml}}}
- {name: record, inputs: [ingest, twin, detect], record: {mcap: $1.mcap}}
- name: publish
  inputs: [ingest, twin, detect]
  publish: {zenoh: {connect: [$router], json: false}, latch: $3, stop_after_s: 5}
EOF
    (cd "$work/$1" && exec "$tauscope" run --quiet >run.txt 2>&1) &
}

cd "$work"
"$tauscope" fleet --listen "$router" --serve "$page" --store "$work/fleet.sqlite" --expect paint-1 2>fleet.txt &
cd "$root"
cell press-1 0.2 contact
cell press-2 0.2 collision
cell weld-1 0.25 collision
killed=$!
sleep 30
kill -9 "$killed"
sleep 4
python3 docs/page.py "http://$page/" docs/fleet.png 1400 light 510
if [ -n "${2:-}" ]; then
    mkdir -p "$folder"
    curl -s "http://$page/fleet.json" >"$folder/fleet.json"
    curl -s "http://$page/" >"$folder/wall.html"
    curl -s "http://$page/cells/press-1" >"$folder/cell.html"
    curl -s "http://$page/metrics" >"$folder/metrics.txt"
    for scheme in light dark; do
        for width in 1400 390; do
            python3 docs/page.py "http://$page/" "$folder/wall-$width-$scheme.png" $width $scheme
            python3 docs/page.py "http://$page/cells/press-1" "$folder/cell-$width-$scheme.png" $width $scheme
        done
    done
fi
