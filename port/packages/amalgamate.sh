#!/bin/sh
# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
#
# amalgamate.sh OUT HEADER... -- SOURCE... -- MODEL_FILE...: the runtime as one pair, OUT/penode.h and OUT/penode.c, and the
# files of models made to include it. Headers come in the order of their includes, each once. Macros of a source end with it
# (#undef), so that two sources may have one name for two things; functions and types of sources may not.
# pen_exact.h, the compiler's orders for exact arithmetic, is for the runtime and models only, not for programs that include
# penode.h: it stands at its top under PENODE_EXACT. pen_port_target.h stays apart, because the target provides it.
set -eu
LC_ALL=C
export LC_ALL
out=$1
shift
mkdir -p "$out"

headers=
while [ "$1" != -- ]; do headers="$headers $1"; shift; done
shift
sources=
while [ "$1" != -- ]; do sources="$sources $1"; shift; done
shift

# The text of files without their includes of the runtime, after the text of the included files.
text='
function base(path) { sub(/.*\//, "", path); return path }

# Name of the header of the runtime that a line includes, or nothing.
function included(line)
{
    return (line ~ /^#include "penode\//) ? substr(line, 11, length(line) - 11) : ""
}

function emit(path,   line, name, number, macro, macros, n, i)
{
    if (path in done) return
    done[path] = 1
    while ((getline line < path) > 0) {
        name = base(included(line))
        if (name in place) emit(place[name])
    }
    close(path)
    printf "\n/* ==== %s ==== */\n\n", base(path)
    while ((getline line < path) > 0) {
        number++
        if (number == 1 && line ~ /SPDX-License-Identifier/) { skip = 1; continue }
        if (number == 2 && skip) { skip = 0; if (line ~ /Copyright/) continue }
        if (included(line) != "") continue
        print line
        if (sources && match(line, /^[ \t]*#[ \t]*define[ \t]+[A-Za-z_0-9]+/)) {
            macro = substr(line, RSTART, RLENGTH)
            sub(/.*[ \t]/, "", macro)
            if (!((path, macro) in known)) { known[path, macro] = 1; macros[++n] = macro }
        }
    }
    close(path)
    for (i = 1; i <= n; i++) printf "%s#undef %s\n", (i == 1) ? "\n" : "", macros[i]
}

BEGIN {
    sources = (ENVIRON["KIND"] == "sources")
    for (i = 1; i < ARGC; i++) place[base(ARGV[i])] = ARGV[i]
    if (!sources && ("pen_exact.h" in place)) {
        print "#ifdef PENODE_EXACT"
        emit(place["pen_exact.h"])
        print "#endif"
    }
    for (i = 1; i < ARGC; i++) emit(ARGV[i])
}'

licence()
{
    echo "/* SPDX-License-Identifier: MIT"
    echo " * Copyright (c) 2026 the penode authors"
    echo " *"
    echo " * $1 */"
}

{
    licence "penode in one header, made by make dist. pen_port_target.h comes from the port."
    echo "#ifndef PENODE_ONE_H"
    echo "#define PENODE_ONE_H"
    KIND=headers awk "$text" $headers
    echo
    echo "#endif"
} >"$out/penode.h"

{
    licence "penode in one source, made by make dist."
    echo "#define PENODE_EXACT"
    echo '#include "penode.h"'
    KIND=sources awk "$text" $sources
} >"$out/penode.c"

for file; do
    awk '/^#include "penode\/pen_exact.h"$/ { print "#define PENODE_EXACT" }
         { if (sub(/^#include "penode\/pen_[a-z0-9_]*\.h"$/, "#include \"penode.h\"") && there++) next; print }' \
        "$file" >"$out/$(basename "$file")"
done
