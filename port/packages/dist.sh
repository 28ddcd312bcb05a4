#!/bin/sh
# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
#
# dist.sh OUT: lay out what a firmware project takes, in OUT/penode-VERSION, and pack it. Needs sh, awk, sed and GNU tar and
# gzip, no Python. The same tree gives the same bytes: order, owners, modes and times are fixed (SOURCE_DATE_EPOCH sets the time).
#
#   OUT/penode-VERSION.tar.gz               everything: sources, ports, models, CMake, pkg-config, PlatformIO, Zephyr, CMSIS-Pack
#   OUT/penode-VERSION-amalgamated.tar.gz   the same runtime as one .c and one .h, with the port and the models
#
# A line of a package file that holds @SOURCE@ is repeated for each source, likewise @HEADER@, @MODEL_SOURCE@,
# @MODEL_HEADER@ and @PORT_GNU@; so a new file of the runtime is in every package. @VERSION@ is PEN_VERSION.
set -eu
LC_ALL=C
export LC_ALL
umask 022
out=${1:?"dist.sh: name the folder to write"}
case $out in /*) ;; *) out=$PWD/$out ;; esac
cd "$(dirname "$0")/../.."
packages=port/packages

version=$(sed -n 's/^#define PEN_VERSION  *"\([0-9.]*\)".*/\1/p' inc/penode/pen_real.h)
[ -n "$version" ] || { echo "dist.sh: no PEN_VERSION in inc/penode/pen_real.h" >&2; exit 1; }
tree=$out/penode-$version
one=$tree-amalgamated

# expand FILE: to the same place in the tree
expand()
{
    mkdir -p "$tree/$(dirname "$1")"
    (cd "$tree" &&
        VERSION=$version SOURCE=$(echo src/*.c) HEADER=$(echo inc/penode/*.h) PORT_GNU=$(echo port/gnu/*.h) \
        MODEL_SOURCE=$(echo models/nqvm/*.c) MODEL_HEADER=$(echo models/nqvm/*.h) MODEL_NAMES=$(cd models/nqvm && echo *.[ch]) \
        awk '
        BEGIN {
            lists = split("SOURCE HEADER PORT_GNU MODEL_SOURCE MODEL_HEADER", list, " ")
            names = ENVIRON["MODEL_NAMES"]
            gsub(/ /, "\", \"", names)
        }
        {
            gsub(/@VERSION@/, ENVIRON["VERSION"])
            gsub(/@MODEL_NAMES@/, names)
            for (i = 1; i <= lists; i++) {
                mark = "@" list[i] "@"
                if (at = index($0, mark)) {
                    n = split(ENVIRON[list[i]], file, " ")
                    for (j = 1; j <= n; j++) print substr($0, 1, at - 1) file[j] substr($0, at + length(mark))
                    next
                }
            }
            print
        }') <"$packages/$1" >"$tree/$1"
}

rm -rf "$tree" "$one" "$tree.tar.gz" "$one.tar.gz"
mkdir -p "$tree/models/nqvm" "$tree/port"
cp -R inc src LICENSE CHANGELOG.md "$tree"
cp -R port/gnu port/template port/cortex-m port/xcp "$tree/port"
cp sil/firmware/board.h "$tree/port/cortex-m"
cp gen/nqvm/c/* "$tree/models/nqvm"
cp port/README.md "$tree/README.md"
for file in CMakeLists.txt penode-config.cmake.in penode.pc.in library.json penode.penode.pdsc \
    zephyr/module.yml zephyr/Kconfig zephyr/CMakeLists.txt; do
    expand $file
done

"$packages/amalgamate.sh" "$one" inc/penode/*.h -- src/*.c -- gen/nqvm/c/*.[ch]
cp LICENSE port/README.md port/gnu/*.h "$one"

for folder in "$tree" "$one"; do
    find "$folder" -type d -exec chmod 755 {} + -o -type f ! -perm -100 -exec chmod 644 {} + -o -type f -exec chmod 755 {} +
    tar -C "$out" --format=ustar --sort=name --mtime="@${SOURCE_DATE_EPOCH:-0}" --owner=0 --group=0 --numeric-owner \
        -cf - "$(basename "$folder")" | gzip -9n >"$folder.tar.gz"
    echo "$folder.tar.gz"
done
