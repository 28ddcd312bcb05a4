# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Parts of a campaign that are done are not done again: a file with a part a line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any


def kept(path: Path, key: list[Any], make: Callable[[], Any]) -> Any:
    """What `make` gives (anything that JSON holds), from the file if it is there under the key already."""
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            found = json.loads(line)
            if found["key"] == key:
                return found["value"]
    value = json.loads(json.dumps(make()))
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps({"key": key, "value": value}) + "\n")
    return value
