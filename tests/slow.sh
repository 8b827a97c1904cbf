#!/usr/bin/env bash
# Runs what is too slow for `cargo test`: every ignored test, the proof on concealed arms, and CONTRIBUTING.md
# followed literally. Prints a table at the end; exit code 1 if anything failed.
#
#   tests/slow.sh            all of it, release build: an hour and more on 2 cores
#   tests/slow.sh --short    dev build, each test for at most LIMIT seconds (60), two cases of the proof
#   tests/slow.sh --only RE  only what matches the regular expression
#   tests/slow.sh --package P  only the ignored tests of one package
set -uo pipefail
cd "$(dirname "$0")/.."

short=false only=. packages=(--workspace)
while [ $# -gt 0 ]; do
    case $1 in
    --short) short=true ;;
    --only) only=$2 && shift ;;
    --package) packages=(--package "$2") && shift ;;
    *) echo "unknown argument $1" >&2 && exit 2 ;;
    esac
    shift
done
if $short; then profile=() limit=${LIMIT:-60}; else profile=(--release) limit=${LIMIT:-7200}; fi

# The processes that other tests start are ignored tests, too, and are no tests.
helpers='^bus/process: '
logs=$(mktemp -d)
rows=()
failed=0

# A command, or a function of this script, for at most `limit` seconds.
limited() {
    if [ "$(type -t "$1")" = function ]; then "$@"; else timeout "$limit" "$@"; fi
}

# run NAME COMMAND...: one row of the table.
run() {
    local name=$1 begin=$SECONDS result code
    shift
    if ! grep -qE "$only" <<<"$name"; then return; fi
    echo "--- $name"
    limited "$@" >"$logs/log" 2>&1
    code=$?
    case $code in
    0) if grep -q '^SKIPPED' "$logs/log"; then result=skipped; else result=passed; fi ;;
    124) result="stopped after $limit s" ;;
    *) result=FAILED && failed=1 && tail -40 "$logs/log" ;;
    esac
    rows+=("| $name | $((SECONDS - begin)) | $result |")
}

# The proof has failed if a case is neither right nor right up to a class.
proof() { tests/proof/prove.sh "$1" "$logs/proof" "$2" | tee /dev/stderr | grep -q ', 0 not\.$'; }

# The campaign of faults; it needs tests/proof/requirements.txt.
faults() {
    if ! python3 -c 'import mcap, mujoco, numpy, yaml' 2>/dev/null; then
        echo "SKIPPED: tests/proof/requirements.txt is not installed"
        return 0
    fi
    local program=$1
    shift
    python3 tests/proof/faults.py "$program" "$logs/faults" "$@" | tee /dev/stderr | grep -q ', 0 are missed'
}

# Each test program as: package and target, folder, executable.
programs() {
    cargo test "${packages[@]}" --no-run --message-format=json "${profile[@]}" 2>"$logs/build" | python3 -c '
import json, os, sys
for line in sys.stdin:
    made = json.loads(line) if line.startswith("{") else {}
    if made.get("executable") and made.get("profile", {}).get("test"):
        folder = os.path.dirname(made["manifest_path"])
        package = os.path.relpath(folder)
        print(("" if package == "." else package + "/") + made["target"]["name"], folder, made["executable"], sep="\t")
' || { cat "$logs/build" >&2 && return 1; }
}

found=$(programs) || exit 1
while IFS=$'\t' read -r target folder program; do
    for test in $(cd "$folder" && "$program" --ignored --list 2>/dev/null | sed -n 's/: test$//p'); do
        if ! grep -qE "$helpers" <<<"$target: $test"; then
            run "$target: $test" env -C "$folder" "$program" --ignored --exact "$test" --nocapture
        fi
    done
done <<<"$found"

if [ "${packages[0]}" = --package ]; then
    : # Neither the proof nor CONTRIBUTING.md.
elif $short; then
    some=$logs/set
    mkdir -p "$some/cases" && cp -r tests/proof/set/answers.json tests/proof/set/robots "$some/"
    for case in m00 m11; do cp -r "tests/proof/set/cases/$case" "$some/cases/"; done
    python3 -c '
import json, sys
held = json.load(open(sys.argv[1]))
held["cases"] = [case for case in held["cases"] if case["case"] in ("m00", "m11")]
json.dump(held, open(sys.argv[1], "w"))' "$some/answers.json"
    run "proof: two cases" proof "$some" target/debug/tauscope
    run "faults: three" faults target/debug/tauscope --short
else
    run "proof" proof tests/proof/set target/release/tauscope
fi
[ "${packages[0]}" = --package ] || run "CONTRIBUTING.md" tests/contributing.py

printf '\n| what | seconds | result |\n| --- | ---: | --- |\n'
printf '%s\n' "${rows[@]}"
rm -rf "$logs"
exit $failed
