#!/bin/sh
# Called by cargo in the place of rustc for the crates of this workspace: libFuzzer sees which code an input reaches,
# and what a release build lets pass (an overflow, a broken assertion) ends the run.
exec "$@" -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
    -Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=1 -Coverflow-checks=yes -Cdebug-assertions=yes
