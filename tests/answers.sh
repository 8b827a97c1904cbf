#!/usr/bin/env bash
# Writes what a build of tauscope answers, so that two builds can be compared byte by byte:
#
#     tests/answers.sh OLD_BINARY out/answers/old
#     tests/answers.sh NEW_BINARY out/answers/new
#     diff -rq out/answers/old out/answers/new
#
# Kept are answers, not pictures: reports, predictions and twins of `explain`, scores and events of
# `evaluate`, the archives and events of `replay`. Recordings that are not on this machine are skipped
# with a line that says so. A third argument takes the cases of `explain` whose path contains it.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -ge 2 ] || { sed -n '2,12s/^# \{0,1\}//p' "$0" >&2; exit 2; }
binary=$(realpath "$1")
out=$(realpath -m "$2")
only=${3:-}
shared=../shared
mkdir -p "$out"

# What ended with another code is part of the answer.
run() {
    local into=$1 code=0
    shift
    "$binary" "$@" >"$into.txt" 2>"$into.err" || code=$?
    echo "$code" >"$into.code"
    rm -f "$into.txt" "$into.err"
}

for set in tests/proof/set "$shared/practice" "$shared/practice2"; do
    if [ ! -d "$set" ]; then
        echo "SKIPPED: $set is not on this machine"
        continue
    fi
    for case in "$set"/cases/*/case.yaml; do
        case $case in *"$only"*) ;; *) continue ;; esac
        name=$(basename "$set")/$(basename "$(dirname "$case")")
        [ ! -e "$out/explain/$name.code" ] || continue
        rm -rf "$out/explain/$name"
        mkdir -p "$out/explain/$name"
        run "$out/explain/$name" explain "$case" --out "$out/explain/$name"
        rm -f "$out/explain/$name"/{report.html,explain.rrd}
    done
done

# Without the nets and support vector machines: their training takes an hour. The classifiers need the
# kinds of the contacts, which not every set knows; that they are refused is an answer, too.
plain=twin_regression,naive_difference,momentum_observer,tauscope
sensors=virtual_collision_sensor_basic,virtual_collision_sensor
classifiers=contact_classifier,fisher_discriminant,frequency_classifier
for set in "$shared"/contacts/*/set.yaml; do
    if [ ! -e "$set" ]; then
        echo "SKIPPED: $shared/contacts is not on this machine"
        continue
    fi
    for detectors in $plain $sensors $classifiers; do
        name=$(basename "$(dirname "$set")")/${detectors%%,*}
        [ ! -e "$out/evaluate/$name.code" ] || continue
        rm -rf "$out/evaluate/$name"
        mkdir -p "$out/evaluate/$name"
        run "$out/evaluate/$name" evaluate "$set" --out "$out/evaluate/$name" --detectors "$detectors"
        # Pages and tables hold how long the computing took.
        rm -rf "$out/evaluate/$name"/{report.html,results.parquet}
    done
done

rm -rf "$out/replay"
mkdir -p "$out/replay"
run "$out/replay/demo" replay tests/data/demo.mcap --pipeline pipeline.yaml --out "$out/replay/demo"
find "$out" -name '*.rrd' -delete
echo "answers of $binary stand in $out"
