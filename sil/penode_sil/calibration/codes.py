# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Numbers that XCP and the slave of penode have chosen."""

from enum import IntEnum


class Who(IntEnum):
    """Whose page: the mode of SET_CAL_PAGE and GET_CAL_PAGE."""

    ECU = 0x01
    TOOL = 0x02


class Page(IntEnum):
    """Pages of segment 0."""

    WORKING = 0
    REFERENCE = 1


class Text(IntEnum):
    """Types of GET_ID."""

    A2L = 4
    EPK = 5


class Slave(IntEnum):
    """The virtual controller (sil/firmware/): its event, the id of the first set that a master opens, its longest packet and the inputs
    that the emulated one holds [bytes]."""

    STEP = 0
    FIRST_ID = 1000
    MAX_CTO = 252
    STIMULUS = 1 << 20
