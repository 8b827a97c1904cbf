#!/usr/bin/env bash
# Runs the trials of README.md and prints a table of good and bad answers. Exit code 1 if any is bad.
#
#   tests/trials/run.sh                  all of them: half an hour on 2 cores
#   tests/trials/run.sh --short          the quick commands: two minutes
#   tests/trials/run.sh --only RE        the trials whose name matches the regular expression
#   tests/trials/run.sh --program FILE   another program than target/debug/tauscope, which is built if absent
#   tests/trials/run.sh --table FILE     writes the table into a file, too
#
# The generator needs numpy, zstandard and mcap. Without them it takes them from PyPI into target/trials/venv; where
# that is impossible, the script prints a line SKIPPED and exits with 0.
set -euo pipefail
here=$(pwd)
cd "$(dirname "$0")/../.."
work=$PWD/target/trials

program='' rest=()
while [ $# -gt 0 ]; do
    case $1 in
    --program) program=$(cd "$here" && realpath "$2") && shift ;;
    --table) rest+=(--table "$(cd "$here" && realpath "$2")") && shift ;;
    --only | --jobs) rest+=("$1" "$2") && shift ;;
    --short) rest+=("$1") ;;
    *) echo "unknown argument $1" >&2 && exit 2 ;;
    esac
    shift
done

skip() { echo "SKIPPED: $1" && exit 0; }

mkdir -p "$work"
python=python3
if ! $python -c 'import mcap, numpy, zstandard' 2>/dev/null; then
    python=$work/venv/bin/python
    if ! "$python" -c 'import mcap, numpy, zstandard' 2>/dev/null; then
        python3 -m venv --clear "$work/venv" || skip "no Python with venv"
        "$python" -m pip install --quiet --disable-pip-version-check -r tests/trials/requirements.txt ||
            skip "numpy, zstandard and mcap cannot be fetched from PyPI"
    fi
fi

if [ -z "$program" ]; then
    program=target/debug/tauscope
    [ -x "$program" ] || cargo build --locked
fi
exec "$python" tests/trials/run.py --program "$program" --work "$work" ${rest[@]+"${rest[@]}"}
