#!/bin/sh
# Replays an archive with several processes on this machine: PROCESSES of its SHARDS at once. Started again, or on a
# second machine that shares OUT, it goes on with what is not done.
#     deploy/archive/replay.sh MANIFEST PIPELINE OUT [SHARDS [PROCESSES]]
set -eu
if [ $# -lt 3 ]; then
    sed -n '4s/^# *//p' "$0" >&2
    exit 2
fi
shards=${4:-16}
seq 0 $((shards - 1)) | xargs -P "${5:-$(nproc)}" -I{} sh -c '
    tauscope replay --manifest "$1" --pipeline "$2" --out "$3" --shard "$4" || code=$?
    # 3: done, but a recording had lost samples; the results say which.
    [ "${code:-0}" -eq 3 ] || exit "${code:-0}"
' sh "$1" "$2" "$3" "{}/$shards"
