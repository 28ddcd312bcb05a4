# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
#
# The emulated boards, for cc and run. Sets core, the memory map and the clock of the SysTick timer [MHz].

machines="mps2-an385 mps2-an386 mps2-an500 mps2-an505 mps3-an547"

choose_machine() # NAME
{
    rom=0x00000000 rom_size=4M ram=0x20000000 ram_size=4M tick=25
    case ${1:-} in
        mps2-an385) core="-mcpu=cortex-m3 -mfloat-abi=soft" ;;
        mps2-an386) core="-mcpu=cortex-m4 -mfpu=fpv4-sp-d16 -mfloat-abi=hard" ;;
        mps2-an500) core="-mcpu=cortex-m7 -mfpu=fpv5-sp-d16 -mfloat-abi=hard" ;;
        mps2-an505) core="-mcpu=cortex-m33 -mfpu=fpv5-sp-d16 -mfloat-abi=hard"
                    rom=0x10000000 ram=0x38000000 ram_size=2M tick=20 ;;
        # Without float vectors: they flush subnormal numbers to zero, and gcc makes them out of plain loops.
        mps3-an547) core="-mcpu=cortex-m55+nomve.fp -mfloat-abi=hard"
                    rom=0x10000000 rom_size=512K ram=0x30000000 ram_size=512K tick=32 ;;
        *) echo "$0: no machine '${1:-}'; choose one of: $machines" >&2; exit 2 ;;
    esac
}
