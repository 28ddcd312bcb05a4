# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Commands of penode one after the other, in the interpreter that runs this: importing it for each would take most of the time.

session.py COMMANDS.json ANSWERS.json: a list of commands, each a list of words; their answers, and where penode was imported from.
"""

from __future__ import annotations

import json
import sys
import traceback
from pathlib import Path

from click.testing import CliRunner

import penode_gen
import penode_sil.cli


def answer(words: list[str]) -> dict[str, str]:
    """What a command prints, and the exception that ended it."""
    done = CliRunner().invoke(penode_sil.cli.cli, words, standalone_mode=False)
    return {"output": done.output, "error": "".join(traceback.format_exception(done.exception)) if done.exception else ""}


if __name__ == "__main__":
    commands, answers = map(Path, sys.argv[1:])
    found = {name: answer(words) for name, words in json.loads(commands.read_text()).items()}
    imported = {"penode_gen": penode_gen.__file__, "penode_sil": penode_sil.__file__, "version": penode_gen.VERSION}
    editable = [finder.__name__ for finder in sys.meta_path if "editable" in getattr(finder, "__module__", "")]
    answers.write_text(json.dumps({"commands": found, "imported": imported, "editable": editable}))
