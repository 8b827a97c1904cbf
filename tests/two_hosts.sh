#!/bin/sh
# Two hosts in one pipeline file: two network namespaces joined by a veth pair. A robot of 1000 samples a
# second and its twin in one, a detector and a recorder in the other; nothing may be lost on the way.
#
#     tests/two_hosts.sh PROGRAM [SECONDS]
#
# PROGRAM is the built tauscope; SECONDS are 60 by default. Needs root; where network namespaces are not
# allowed it says SKIPPED and ends with 0.
set -eu

program=$(realpath "$1")
seconds=${2:-60}
data=$(realpath "$(dirname "$0")/data")
a=tauscope_a_$$ b=tauscope_b_$$
folder=$(mktemp -d)

clean_up() {
    for namespace in $a $b; do
        ip netns pids $namespace 2>/dev/null | xargs -r kill -9 2>/dev/null || true
        ip netns delete $namespace 2>/dev/null || true
    done
    rm -rf "$folder"
}
trap clean_up EXIT INT TERM

if ! command -v ip >/dev/null || ! ip netns add $a 2>"$folder/why"; then
    echo "SKIPPED two_hosts: network namespaces are not allowed here: $(cat "$folder/why" 2>/dev/null)"
    exit 0
fi
ip netns add $b
if ! ip link add ts_a_$$ netns $a type veth peer name ts_b_$$ netns $b 2>"$folder/why"; then
    echo "SKIPPED two_hosts: veth pairs are not allowed here: $(cat "$folder/why")"
    exit 0
fi
ip -n $a address add 10.231.0.1/24 dev ts_a_$$
ip -n $b address add 10.231.0.2/24 dev ts_b_$$
for side in a b; do
    eval "namespace=\$$side"
    ip -n "$namespace" link set lo up
    ip -n "$namespace" link set "ts_${side}_$$" up
done

cat >"$folder/scenario.yaml" <<END
version: 1
name: two_hosts
robot: $data/demo_arm.urdf
rate_hz: 1000
recordings:
  - name: loop
    duration_s: $seconds
    motion: {fourier: {period_s: 10, harmonics: 4, speed: 0.4, acceleration_rad_s2: 2.5, range: 0.5}}
END
cat >"$folder/pipeline.yaml" <<END
version: 1
cells: {demo: {robot: $data/demo_arm.urdf}}
hosts:
  a: {listen: "tcp/10.231.0.1:7447"}
  b: {connect: "tcp/10.231.0.1:7447"}
stages:
  - {name: ingest, host: a, ingest: {simulate: {scenario: scenario.yaml}, rate: realtime}}
  - {name: twin, host: a, input: ingest, twin: {}}
  - {name: detect, host: b, input: twin, detect: {naive_difference: {}, threshold: {score: 1000.0}}}
  - {name: record, host: b, inputs: [ingest, twin, detect], record: {mcap: out.mcap}}
END

ip netns exec $a "$program" run "$folder/pipeline.yaml" --host a --json >"$folder/a.json" 2>"$folder/a.err" &
first=$!
status_b=0
ip netns exec $b "$program" run "$folder/pipeline.yaml" --host b --json >"$folder/b.json" 2>"$folder/b.err" || status_b=$?
status_a=0
wait $first || status_a=$?

fail() {
    echo "FAILED two_hosts: $1" >&2
    cat "$folder"/a.* "$folder"/b.* >&2
    exit 1
}
# 0 says that nothing was lost.
[ $status_a -eq 0 ] || fail "host a ended with $status_a"
[ $status_b -eq 0 ] || fail "host b ended with $status_b"
messages=$("$program" info "$folder/out.mcap" --json | tr -d ' \n' |
    sed 's/.*"name":"\/joint_states",[^}]*"message_count":\([0-9]*\).*/\1/')
[ "$messages" -ge $((seconds * 1000)) ] ||
    fail "$messages joint states in the archive, expected at least $((seconds * 1000))"
echo "two_hosts: $messages samples at 1 kHz over $seconds s from host to host, nothing lost"
