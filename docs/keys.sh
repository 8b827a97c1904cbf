#!/usr/bin/env bash
# Makes the tables of docs/keys.md again from the types:
#
#     docs/keys.sh [TAUSCOPE]
set -euo pipefail

cd "$(dirname "$0")/.."
tauscope=${1:-target/debug/tauscope}
work=$(mktemp)
trap 'rm -f "$work"' EXIT
sed '/^## /,$d' docs/keys.md >"$work"
for kind in pipeline twin case set scenario; do
    printf '## %s\n\n' "$kind"
    "$tauscope" schema "$kind" --keys
    [ "$kind" = scenario ] || echo
done >>"$work"
cp "$work" docs/keys.md
