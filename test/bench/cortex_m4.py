# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A model of the cycles that a Cortex-M4 with FPU takes, without wait states of its memory.

From the Technical Reference Manual DDI 0439: tables 3-1 (instructions) and 7-1 (floating point), load/store timings.
Where the manual leaves it open there is a low and a high reading:

|                                        | low | high |
|----------------------------------------|-----|------|
| refill of the pipeline after a jump    | 1   | 3    |
| VLDR after another load                | 1   | 2    |
| VSTR                                   | 1   | 2    |
| IT                                     | 0   | 1    |
| SDIV, UDIV                             | 2   | 12   |
| VABS, VNEG: waited for like arithmetic | no  | yes  |

An instruction that is skipped in an IT block counts like one that is not.
"""

from __future__ import annotations

import re
import subprocess
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

Cycles = tuple[int, int]  # low, high

LINE = re.compile(r"^ *([0-9a-f]+):\t([0-9a-f ]+?) *\t(\S+)(?:\t(.*?))?(?:\s*[;@].*)?$")
SUFFIX = re.compile(r"(eq|ne|cs|hs|cc|lo|mi|pl|vs|vc|hi|ls|ge|lt|gt|le)$")
LOAD = re.compile(r"(v?ldr|ldrs?[bh]|ldrex[bh]?|lda[bh]?)$")
STORE = re.compile(r"(v?str|str[bh]|strex[bh]?|stl[bh]?)$")
MULTIPLE = re.compile(r"v?(ldm|stm)(ia|db)?$|v?(push|pop)$|(ldr|str)d$")
ARITHMETIC = re.compile(r"v(add|sub|n?mul|div|sqrt|cvt[rbt]?|n?ml[as]|fn?m[as])$")
SIGN = re.compile(r"v(abs|neg)$")
ACCUMULATE = re.compile(r"v(n?ml[as]|fn?m[as])$")
JUMP = re.compile(r"(b|bl|bx|blx|cbn?z)$")
TWO = re.compile(r"(ml[as]|tb[bh])$")
ONE = re.compile(
    r"(mov|mvn|add|adc|sub|sbc|rsb|and|orr|orn|eor|bic|lsl|lsr|asr|ror|rrx|neg|mul)s?$|(mov[wt]|addw|subw|cmp|cmn|tst|teq|[us]xt[bh]|[us]bfx|bf[ic]|"
    r"clz|rbit|rev(16|sh)?|[us]mull|[us]mlal|umaal|smul[bt][bt]|smla[bt][bt]|smmulr?|smmla|[us]sat|sel|nop|adr|cps\w*|mrs|msr|dmb|dsb|isb|clrex|bkpt|"
    r"vcmpe?|vmov|vmrs|vmsr)$"
)
OTHER = re.compile(r"it[te]*$|[us]div$")
KNOWN = (LOAD, STORE, MULTIPLE, ARITHMETIC, SIGN, JUMP, TWO, ONE, OTHER)


@dataclass(frozen=True)
class Instruction:
    """One line of a disassembly: name without condition and type; what it reads and writes."""

    address: int
    size: int  # [bytes]
    name: str
    wide: bool  # double precision
    text: str
    writes: frozenset[str]
    reads: frozenset[str]
    address_reads: frozenset[str]  # registers that a load or store has in its address
    count: int  # registers of a list


def _registers(text: str) -> list[str]:
    """Names in the order of the text; s2-s4 and r4-r7 are lists; d1 is s2 and s3."""
    found: list[str] = []
    for match in re.finditer(r"\b(?:([rsd])(\d+)(?:\s*-\s*\1(\d+))?|(sl|fp|ip|sp|lr|pc))\b", text):
        kind, first, last, name = match.groups()
        if name:
            found.append(name)
            continue
        for k in range(int(first), int(last or first) + 1):
            found += [f"s{2 * k}", f"s{2 * k + 1}"] if kind == "d" else [f"{kind}{k}"]
    return found


def _instruction(address: int, size: int, mnemonic: str, operands: str) -> Instruction:
    name, *kinds = mnemonic.split(".")
    if not any(pattern.match(name) for pattern in KNOWN):
        name = SUFFIX.sub("", name)
    parts = re.split(r",\s*(?![^\[{]*[\]}])", operands)
    target, rest = _registers(parts[0]), _registers(",".join(parts[1:]))
    inside = frozenset(_registers(" ".join(re.findall(r"\[(.*?)\]", operands))))
    listed = _registers("".join(re.findall(r"\{(.*?)\}", operands)))
    loads_list, stores = (re.match(r"v?(ldm|pop)", name), STORE.match(name) or re.match(r"v?(cmpe?$|stm|push|strd)", name))
    if stores or re.match(r"(cmp|cmn|tst|teq|b|bl|bx|cbn?z|strd)$", name):
        writes, reads = frozenset(), frozenset(target + rest)
    elif loads_list:
        writes, reads = frozenset(listed), frozenset(_registers(parts[0]))
    else:
        writes, reads = frozenset(target[:4]), frozenset(rest)
        if len(parts) > 1 and name in ("ldrd", "smull", "umull", "smlal", "umlal"):
            writes |= frozenset(_registers(parts[1]))
    count = len(listed) if listed else 2
    wide = any("64" in kind for kind in kinds) or (name in ("vldr", "vstr") and operands.startswith("d"))
    return Instruction(address, size, name, wide, f"{mnemonic} {operands}".strip(), writes, reads, inside, count)


def disassemble(elf: Path) -> tuple[Instruction, ...]:
    """All instructions of a program, by address."""
    return _disassemble(elf, elf.stat().st_mtime_ns)


@lru_cache(8)
def _disassemble(elf: Path, _made: int) -> tuple[Instruction, ...]:
    text = subprocess.run(["arm-none-eabi-objdump", "-d", "-z", str(elf)], check=True, capture_output=True, text=True).stdout
    found = []
    for line in text.splitlines():
        match = LINE.match(line)
        if match and not match[3].startswith((".", "undefined")):
            found.append(_instruction(int(match[1], 16), len(match[2].replace(" ", "")) // 2, match[3], match[4] or ""))
    return tuple(sorted(found, key=lambda i: i.address))


def base(this: Instruction) -> Cycles | None:
    """Cycles where nothing before is in the way; None for what a Cortex-M4 has not."""
    name = this.name
    if LOAD.match(name):
        return (3, 3) if this.wide else (2, 2)
    if STORE.match(name):
        if name == "vstr":
            return (2, 3) if this.wide else (1, 2)
        return (1, 1) if len(this.address_reads) < 2 else (2, 2)
    if MULTIPLE.match(name):
        return (1 + this.count, 1 + this.count)
    if ACCUMULATE.match(name):
        return (3, 3)
    if name in ("vdiv", "vsqrt"):
        return (14, 14)
    if name.startswith("it"):
        return (0, 1)
    if name in ("sdiv", "udiv"):
        return (2, 12)
    if TWO.match(name) or (name == "vmov" and this.text.count(",") >= 2):  # two core registers
        return (2, 2)
    return (1, 1) if any(pattern.match(name) for pattern in (ARITHMETIC, SIGN, JUMP, ONE)) else None


def after(above: Instruction, this: Instruction) -> Cycles | None:
    """Cycles of an instruction that is executed after the one above of it."""
    cycles = base(this)
    if cycles is None:
        return None
    low, high = cycles
    if LOAD.match(above.name) and not (above.writes & this.address_reads):
        pipelined = bool(LOAD.match(this.name)) or (this.name != "vstr" and bool(STORE.match(this.name)) and low == 2)
        low -= pipelined
        high -= pipelined and "vldr" not in (above.name, this.name)
    reads = this.reads
    if ACCUMULATE.match(this.name):  # it takes its addend one cycle later
        reads = reads - this.writes
    if above.writes & reads:
        low += bool(ARITHMETIC.match(above.name))
        high += bool(ARITHMETIC.match(above.name) or SIGN.match(above.name))
    return low, high


def away(this: Instruction) -> Cycles:
    """Cycles more if the next instruction executed is not the one below."""
    return 1, 3
