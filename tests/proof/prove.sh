#!/usr/bin/env bash
# Explains every case of the committed set (or of the set given) and prints the table of docs/proof.md.
#   prove.sh [SET [OUT [PROGRAM]]]     without PROGRAM: the release build, made first
set -euo pipefail
cd "$(dirname "$0")/../.."
set=${1:-tests/proof/set}
out=${2:-out/proof}
(cd tests/proof/set && sha256sum --check --quiet answers.sha256)
program=${3:-target/release/tauscope}
[ $# -ge 3 ] || cargo build --release --quiet
for case in "$set"/cases/*/case.yaml; do
    name=$(basename "$(dirname "$case")")
    "$program" explain "$case" --force --out "$out/$name" >/dev/null
done
python3 tests/proof/table.py "$set/answers.json" "$out"
