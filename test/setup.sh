#!/bin/bash
# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
#
# setup.sh tools|python|pythons|unity|cmock|packages|docs|proof|rivals|mujoco|rival_training: one part of the set-up each; the Makefile calls it, once. All goes into build/
# but the Debian packages of `tools` and `proof`. Quiet where there is nothing to do; one line that names the remedy where it cannot.
set -euo pipefail
cd "$(dirname "$0")/.."

MUTATOR=universalmutator==1.14.1
CMOCK_URL=https://github.com/ThrowTheSwitch/CMock
CMOCK_TAG=v2.7.0
CMOCK_COMMIT=6ea503340b1d3fdc0f2bcaf69273ba0160ec83af

give_up() # WHAT
{
    echo "setup: $1" >&2
    exit 1
}

# Print the command that runs apt-get as root; fails where there is none.
as_root()
{
    if [ "$(id -u)" = 0 ]; then
        echo "env"
    elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
        echo "sudo env"
    else
        return 1
    fi
}

# Print the Debian packages that are missing, found by what they bring, so that other systems pass as well.
missing_packages()
{
    command -v gcc >/dev/null || echo gcc
    echo '#include <stdio.h>' | gcc -E - >/dev/null 2>&1 || echo libc6-dev
    command -v arm-none-eabi-gcc >/dev/null || echo gcc-arm-none-eabi
    [ "$(arm-none-eabi-gcc -print-file-name=libc.a 2>/dev/null || true)" != libc.a ] &&
        command -v arm-none-eabi-gcc >/dev/null || echo libnewlib-arm-none-eabi
    command -v qemu-system-arm >/dev/null || echo qemu-system-arm
    command -v qemu-riscv32 >/dev/null && command -v qemu-s390x >/dev/null || echo qemu-user
    command -v riscv64-unknown-elf-gcc >/dev/null || echo gcc-riscv64-unknown-elf
    command -v s390x-linux-gnu-gcc >/dev/null || echo gcc-s390x-linux-gnu
    command -v g++ >/dev/null || echo g++
    command -v ruby >/dev/null || echo ruby
    command -v git >/dev/null || echo git
    command -v cmake >/dev/null || echo cmake
    command -v pkg-config >/dev/null || echo pkgconf
    command -v clang-19 >/dev/null || echo clang-19
    ls /usr/lib/llvm-19/lib/clang/19/lib/linux/libclang_rt.asan* >/dev/null 2>&1 || echo libclang-rt-19-dev
    python3 -c 'import ensurepip, venv' 2>/dev/null || echo python3-venv
}

# The same for `make prove`.
missing_proof_packages()
{
    command -v frama-c >/dev/null || echo frama-c-base
    command -v spin >/dev/null || echo spin
    command -v llvm-cov-19 >/dev/null || echo llvm-19
}

install() # PART COMMAND: the Debian packages that COMMAND prints
{
    local missing root
    missing=$($2 | tr '\n' ' ')
    if [ -n "$missing" ]; then
        echo "setup: installing $missing"
        root=$(as_root) || give_up "cannot install packages here; run as root: apt-get install $missing"
        { $root apt-get update -qq &&
            $root DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=300 install -qq -y --no-install-recommends $missing; } \
            >"build/setup/$1.log" 2>&1 || give_up "apt-get failed, see build/setup/$1.log; needed: $missing"
        missing=$($2 | tr '\n' ' ')
        [ -z "$missing" ] || give_up "still missing after apt-get: $missing"
    fi
}

tools()
{
    install tools missing_packages
}

# universalmutator brings much of its own, so it gets a place of its own.
proof()
{
    install proof missing_proof_packages
    rm -rf build/proof
    python3 -m venv build/proof
    build/proof/bin/python -m pip install --quiet --disable-pip-version-check "$MUTATOR" >build/setup/proof-python.log 2>&1 ||
        give_up "pip failed, see build/setup/proof-python.log; is the package index reachable?"
}

python()
{
    echo "setup: Python packages into build/venv"
    python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' || give_up "python3 is older than 3.11; install a newer one"
    rm -rf build/venv
    python3 -m venv build/venv
    { build/venv/bin/python -m pip install --quiet --disable-pip-version-check -r requirements.txt &&
        build/venv/bin/python -m pip install --quiet --disable-pip-version-check --no-build-isolation --no-deps -e .; } \
        >build/setup/python.log 2>&1 || give_up "pip failed, see build/setup/python.log; is the package index reachable?"
}

pythons() # what penode needs, for each other interpreter that is installed
{
    local version wanted
    wanted=$(build/venv/bin/python -c 'import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["project"]["dependencies"])')
    rm -rf build/pythons
    for version in 3.11 3.12 3.13 3.14; do
        if "python$version" --version >/dev/null 2>&1 && [ ! -e "build/venv/bin/python$version" ]; then
            echo "setup: Python packages for python$version into build/pythons/$version"
            { "python$version" -m venv "build/pythons/$version" &&
                "build/pythons/$version/bin/python" -m pip install --quiet --disable-pip-version-check -c requirements.txt $wanted; } \
                >build/setup/pythons.log 2>&1 || give_up "pip failed, see build/setup/pythons.log; is the package index reachable?"
        fi
    done
}

packages() # what reads manifests of packages, in a place of its own
{
    echo "setup: PlatformIO's and Zephyr's readers of manifests into build/packages"
    rm -rf build/packages
    python3 -m venv build/packages
    build/packages/bin/python -m pip install --quiet --disable-pip-version-check -r test/packages/requirements.txt \
        >build/setup/packages.log 2>&1 || give_up "pip failed, see build/setup/packages.log; is the package index reachable?"
}

docs() # Sphinx, in a place of its own, for `make site` only
{
    echo "setup: Sphinx into build/docs"
    rm -rf build/docs
    python3 -m venv build/docs
    build/docs/bin/python -m pip install --quiet --disable-pip-version-check -r sil/manual/requirements.txt \
        >build/setup/docs.log 2>&1 || give_up "pip failed, see build/setup/docs.log; is the package index reachable?"
}

rivals() # of the diagnosis, for `make campaign` only
{
    echo "setup: PySINDy into build/rivals"
    rm -rf build/rivals
    python3 -m venv build/rivals
    build/rivals/bin/python -m pip install --quiet --disable-pip-version-check -r test/diagnosis/rivals/requirements.txt \
        >build/setup/rivals.log 2>&1 || give_up "pip failed, see build/setup/rivals.log; is the package index reachable?"
}

mujoco() # the physics of a generator of hidden effects, for `make campaign-mujoco` and tests that skip without it
{
    echo "setup: MuJoCo into build/mujoco"
    rm -rf build/mujoco
    build/venv/bin/python -m pip install --quiet --disable-pip-version-check --no-deps --target build/mujoco \
        -r test/diagnosis/mujoco_cases/requirements.txt >build/setup/mujoco.log 2>&1 ||
        give_up "pip failed, see build/setup/mujoco.log; is the package index reachable?"
}

rival_training() # plain Adam in JAX, for `make campaign-train` only
{
    echo "setup: JAX and diffrax into build/rival-training"
    rm -rf build/rival-training
    python3 -m venv build/rival-training
    build/rival-training/bin/python -m pip install --quiet --disable-pip-version-check -r test/training/rivals/requirements.txt \
        >build/setup/rival_training.log 2>&1 || give_up "pip failed, see build/setup/rival_training.log; is the package index reachable?"
}

# Print the Debian archive's own entries (not those of third parties) as entries for source packages.
# Sets `suffix` by the format found, which apt tells by the name of the file.
debian_sources()
{
    local codename
    codename=$(. /etc/os-release && echo "${VERSION_CODENAME:-}")
    if ls /etc/apt/sources.list.d/*.sources >/dev/null 2>&1 &&
        cat /etc/apt/sources.list.d/*.sources | grep -q "^Suites:.*\b$codename\b"; then
        for file in /etc/apt/sources.list.d/*.sources; do
            awk -v name="$codename" 'BEGIN { RS = ""; ORS = "\n\n" }
                 $0 ~ ("Suites:([^\n]* )?" name "([ \n]|$)") { sub(/Types:[^\n]*/, "Types: deb-src"); print }' "$file"
        done >build/unity/debian.sources
        echo build/unity/debian.sources
    else
        sed -n "s/^deb \(.* $codename .*\)/deb-src \1/p" /etc/apt/sources.list >build/unity/debian.list
        echo build/unity/debian.list
    fi
}

# Unity comes inside Debian's source package of cJSON. apt-get works on lists of its own; the system's stay as they are.
unity()
{
    local entries options
    echo "setup: Unity into build/unity"
    rm -rf build/unity
    mkdir -p build/unity/lists/partial
    entries=$(debian_sources)
    options="-qq -o Dir::Etc::sourcelist=$PWD/$entries -o Dir::Etc::sourceparts=/dev/null
        -o Dir::State::Lists=$PWD/build/unity/lists -o Dir::Cache::pkgcache= -o Dir::Cache::srcpkgcache=
        -o APT::Get::List-Cleanup=0"
    { apt-get $options update && (cd build/unity && apt-get $options source --download-only cjson) &&
        tar xzf build/unity/cjson_*.orig.tar.gz -C build/unity --strip-components=3 --wildcards '*/tests/unity'; } \
        >build/setup/unity.log 2>&1 || give_up "no Unity, see build/setup/unity.log; is the Debian archive reachable?"
    rm -rf build/unity/lists build/unity/cjson_* build/unity/debian.*
}

# CMock is in no package archive. Without it its tests are skipped, and say so.
cmock()
{
    if [ -z "${CMOCK_DIR:-}" ]; then
        echo "setup: CMock $CMOCK_TAG into build/cmock"
        rm -rf build/cmock
        timeout 20 git -c advice.detachedHead=false clone --quiet --depth 1 --branch "$CMOCK_TAG" "$CMOCK_URL" build/cmock \
            >build/setup/cmock.log 2>&1 </dev/null || rm -rf build/cmock
        if [ ! -d build/cmock ]; then
            echo "setup: $CMOCK_URL cannot be reached, so the CMock tests will be skipped; CMOCK_DIR may name a checkout"
        elif [ "$(git -C build/cmock rev-parse HEAD)" != "$CMOCK_COMMIT" ]; then
            rm -rf build/cmock
            give_up "$CMOCK_URL: $CMOCK_TAG is no longer the commit it was; check it and correct test/setup.sh"
        fi
    fi
}

mkdir -p build/setup
"$1"
touch "build/setup/$1"
