#!/usr/bin/env bash
# The long form of the fuzzing, with libFuzzer on the stable toolchain (a C++ compiler is needed):
#
#     tests/fuzz/run.sh [SECONDS] [TARGET...]
#
# Each target runs for SECONDS (1800 by default), two at a time, in 4 GB of address space. New inputs that reach new
# code go to target/fuzz/TARGET; what crashes, hangs for 20 s or takes more than 1 GB stands in
# target/fuzz/found/TARGET-*, and the exit code is 1.
set -euo pipefail
cd "$(dirname "$0")/../.."
seconds=${1:-1800}
[ $# -gt 0 ] && shift
targets=("$@")
[ ${#targets[@]} -gt 0 ] || targets=($(ls tests/fuzz/corpus))

# Coverage for our own crates alone, so that the others need not be built again; optimised.
wrapper=$PWD/tests/fuzz/instrument.sh
RUSTC_WORKSPACE_WRAPPER=$wrapper ${CARGO:-cargo} build --release --workspace --bin fuzz --locked --features tauscope-fuzz/libfuzzer
out=$PWD/target/fuzz
mkdir -p "$out/bin" "$out/found"
cp target/release/fuzz "$out/bin/program"

fuzz() {
    ln -sf program "$out/bin/$1"
    mkdir -p "$out/$1"
    # The time of computing, which is less than SECONDS on a busy machine.
    TIMEFORMAT=%U
    time (
        ulimit -v 4000000
        # Quotes of what a target prints would fill the disk.
        "$out/bin/$1" -max_total_time="$seconds" -timeout=20 -rss_limit_mb=1024 -malloc_limit_mb=1024 \
            -max_len=65536 -print_final_stats=1 -artifact_prefix="$out/found/$1-" "$out/$1" "tests/fuzz/corpus/$1" \
            >"$out/$1.log" 2>&1
    ) 2>"$out/$1.seconds" && verdict=sound || verdict=FOUND
    runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$out/$1.log")
    echo "$1: ${runs:-?} inputs, $(tail -1 "$out/$1.seconds") s of computing, $verdict ($out/$1.log)"
    [ "$verdict" = sound ]
}
export -f fuzz
export out seconds
printf '%s\n' "${targets[@]}" | xargs -P 2 -I{} bash -c 'fuzz {}'
