#!/usr/bin/env bash
# Makes the tables at the end of docs/simulators.md again from the effects:
#
#     docs/simulators.sh
set -euo pipefail

cd "$(dirname "$0")/.."
tables=$(mktemp)
trap 'rm -f "$tables"' EXIT
cargo run --quiet --locked -p tauscope-report --example simulators >"$tables"
sed -i '/^## Elements by simulator$/q' docs/simulators.md
{ echo; cat "$tables"; } >>docs/simulators.md
