#!/usr/bin/env bash
# Our dynamics beside Pinocchio's, per call, in one run on one machine:
#
#     benches/pinocchio/run.sh [URDF...]
#
# Pinocchio and its code generator come from PyPI into target/pinocchio; both sides are built for this very processor
# (-O3 -march=native, -C target-cpu=native). They take turns, ten times each; a figure is the fastest of all rounds.
# Prints a table in Markdown. Exits with 0 and a line SKIPPED where it cannot be built.
set -euo pipefail
cd "$(dirname "$0")/../.."
out=$PWD/target/pinocchio
robots=("$@")
[ ${#robots[@]} -gt 0 ] || robots=(tests/proof/robots/six.urdf tests/proof/robots/seven.urdf)
skip() { echo "SKIPPED: $1"; exit 0; }

command -v g++ >/dev/null || skip "no C++ compiler"
mkdir -p "$out"
[ -x "$out/venv/bin/pip" ] || python3 -m venv "$out/venv" || skip "no Python with venv"
"$out/venv/bin/pip" install --quiet --disable-pip-version-check -r benches/pinocchio/requirements.txt ||
    skip "Pinocchio cannot be fetched from PyPI"
prefix=$(echo "$out"/venv/lib/python3*/site-packages/cmeel.prefix)
source=benches/pinocchio/per_call.cpp
if [ ! -x "$out/per_call" ] || [ "$source" -nt "$out/per_call" ]; then
    g++ -std=c++17 -O3 -march=native -DNDEBUG \
        -DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS -DBOOST_MPL_LIMIT_LIST_SIZE=30 -DBOOST_MPL_LIMIT_VECTOR_SIZE=30 -DBOOST_FUSION_INVOKE_MAX_ARITY=10 \
        -isystem "$prefix/include" -isystem "$prefix/include/eigen3" \
        "$source" -o "$out/per_call" -L"$prefix/lib" -Wl,-rpath,"$prefix/lib" \
        -lboost_filesystem -lboost_serialization -ldl ||
        skip "Pinocchio cannot be built here"
fi
RUSTFLAGS="-C target-cpu=native" cargo bench --quiet --locked -p tauscope-dynamics --bench per_call --no-run \
    --target-dir "$out/cargo" --message-format=json |
    python3 -c 'import json, sys
for line in sys.stdin:
    it = json.loads(line)
    if it.get("executable") and it["target"]["name"] == "per_call":
        print(it["executable"])' >"$out/ours"

for urdf in "${robots[@]}"; do
    urdf=$(realpath "$urdf")
    folder=$out/$(basename "$urdf" .urdf)
    mkdir -p "$folder"
    (
        cd "$folder"
        # What was generated for another robot of that name is not to be used.
        rm -f generated_* ours theirs
        echo "-O3 -march=native" >flags
        "$out/venv/bin/python" -c 'import sys, pinocchio
pinocchio.buildModelFromUrdf(sys.argv[1]).saveToText("model.txt")' "$urdf"
        for _ in 1 2 3 4 5 6 7 8 9 10; do
            "$(cat "$out/ours")" "$urdf" >>ours
            "$out/per_call" model.txt >>theirs
        done
    )
    python3 benches/pinocchio/table.py "$folder" "$(basename "$urdf")"
done
