#!/bin/bash
# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
#
# check.sh MACHINE: build board_check.c for a machine and see that the port keeps its promises there.
set -uo pipefail
machine=$1
port=port/cortex-m
folder=build/board/$machine
mkdir -p "$folder"
export LIMIT=20
bad=0

# expect NAME CODE PATTERN ARGUMENT...: the program's exit code, and what its output must match (newlines are blanks).
expect()
{
    local name=$1 code=$2 pattern=$3 text
    shift 3
    text=$(cd "$folder" && ../../../$port/run "$machine" program "$@" 2>&1 | tr '\n' ' '; exit "${PIPESTATUS[0]}")
    set -- $?
    if [ "$1" = "$code" ] && [[ $text =~ ^$pattern\ $ ]]; then
        echo "ok    $machine $name"
    else
        echo "FAIL  $machine $name: exit code $1, should be $code; said: $text"
        bad=1
    fi
}

test/check "$machine build" $port/cc "$machine" -std=c99 -O2 -Wall -Wextra -Werror -o "$folder/program" test/board/board_check.c || exit 1
head -c 200 /dev/urandom >"$folder/in"

expect "counts instructions exactly" 3 "nothing 0 one 6 thousand 2004 million 2000004" count
SHIFT=10 expect "counts whatever the clock" 3 "nothing 0 one 6 thousand 2004 .*" count
# ten frames of 64 bytes and what the compiler saves beside them
expect "measures the stack" 3 "untouched [0-9] ten-frames ([6789][0-9][0-9])" stack
expect "keeps subnormal numbers" 3 "subnormal 8" subnormal
expect "interrupts" 3 "ticks 10" timer
expect "reads and writes files" 3 "copied 200" copy in out
test/check "$machine the copy is the same" cmp "$folder/in" "$folder/out" || bad=1
expect "says when there is no file" 3 "cannot-open 0" copy missing out
expect "passes an exit code" 2 "asked for nothing known" nothing
expect "catches an undefined instruction" 70 " fault: UsageFault pc 0x[0-9a-f]+ lr 0x[0-9a-f]+ cfsr 0x00010000 hfsr 0x00000000" undefined
expect "catches a write through NULL" 70 " fault: MemManage pc 0x[0-9a-f]+ lr 0x[0-9a-f]+ address 0x00000000 cfsr 0x00000082 hfsr 0x00000000" null-write
expect "catches a read from nowhere" 70 " fault: BusFault pc 0x[0-9a-f]+ lr 0x[0-9a-f]+ address 0x4f000000 cfsr 0x00008200 hfsr 0x00000000" wild-read
expect "catches a stack overflow" 70 " fault: [A-Za-z]+, stack overflow.*" overflow
exit $bad
