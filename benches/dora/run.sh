#!/usr/bin/env bash
# The chain of benches/live.rs as a dora dataflow: the same processes and the same rate, and no work in the nodes.
#
#     benches/dora/run.sh [SECONDS]
#
# dora's program comes from PyPI into target/dora, its nodes are built beside it. Prints a table in Markdown. Exits with 0
# and a line SKIPPED where it cannot be built.
set -euo pipefail
cd "$(dirname "$0")/../.."
seconds=${1:-100}
out=$PWD/target/dora
skip() { echo "SKIPPED: $1"; exit 0; }

mkdir -p "$out"
[ -x "$out/venv/bin/pip" ] || python3 -m venv "$out/venv" || skip "no Python with venv"
"$out/venv/bin/pip" install --quiet --disable-pip-version-check dora-rs-cli==1.1.0 || skip "dora cannot be fetched from PyPI"
cargo build --quiet --release --manifest-path benches/dora/Cargo.toml --target-dir "$out/cargo" ||
    skip "dora's nodes cannot be built here"
node=$out/cargo/release/dora-chain
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

echo "| chain | samples | lost | p50 | p90 | p99 |"
echo "| --- | --- | --- | --- | --- | --- |"
for hops in 2 3; do
    {
        printf 'nodes:\n'
        printf -- '- {id: play, path: %s, args: play %s000, outputs: [sample]}\n' "$node" "$((seconds + 2))"
        printf -- '- {id: h0, path: %s, args: stamp, inputs: {in: {source: play/sample, queue_size: 1000}}, outputs: [sample]}\n' "$node"
        for ((k = 1; k < hops; k++)); do
            printf -- '- {id: h%s, path: %s, args: hop, inputs: {in: {source: h%s/sample, queue_size: 1000}}, outputs: [sample]}\n' \
                "$k" "$node" "$((k - 1))"
        done
        printf -- '- {id: end, path: %s, args: end %s/arrivals, inputs: {in: {source: h%s/sample, queue_size: 1000}}}\n' \
            "$node" "$folder" "$((hops - 1))"
    } >dataflow.yml
    rm -f arrivals
    timeout "$((seconds + 60))" "$out/venv/bin/dora" run dataflow.yml >dora.log 2>&1 || true
    [ -s arrivals ] || { tail -5 dora.log >&2; skip "dora's dataflow gives no sample"; }
    python3 - "$hops" "$seconds" <<'END'
import sys

hops, seconds = sys.argv[1], int(sys.argv[2])
all_of_them = [int(line) / 1e3 for line in open("arrivals")]
# The first two seconds do not count: processes start, caches fill.
counted = sorted(all_of_them[2000:])
at = lambda share: counted[min(int(share * len(counted)), len(counted) - 1)]
lost = (seconds + 2) * 1000 - len(all_of_them)
print(f"| dora, {hops} hops, nodes without work | {len(counted)} | {lost} | {at(.5):.1f} | {at(.9):.1f} | {at(.99):.1f} |")
END
done
