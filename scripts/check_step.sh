#!/bin/sh
# One step of `make check`: check_step.sh MAKE BUILD STEP. What it prints is kept in BUILD/check-STEP.log and shown at its end.
set -u
log="$2/check-$3.log"
began=$(date +%s)
$1 "check-$3" > "$log" 2>&1
result=$?
{ cat "$log"; echo "check-$3: $(($(date +%s) - began)) s"; }
[ "$result" = 0 ] || { echo "check-$3: failed"; exit 255; }
