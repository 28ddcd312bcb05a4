# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Programs that penode calls, and the Debian packages that bring them."""

from __future__ import annotations

PACKAGES = {
    "gcc": "gcc libc6-dev",
    "clang": "clang",
    "clang-19": "clang-19",
    "objcopy": "binutils",
    "arm-none-eabi-gcc": "gcc-arm-none-eabi libnewlib-arm-none-eabi",
    "qemu-system-arm": "qemu-system-arm",
    "x86_64-w64-mingw32-gcc": "gcc-mingw-w64-x86-64",
}


def not_installed(program: str) -> str:
    """The message for a missing program, with the package that installs it."""
    return f"{program} is not installed; install {f'it, on Debian: apt-get install {PACKAGES[program]}' if program in PACKAGES else 'it'}"
