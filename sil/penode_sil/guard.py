# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a command ends with: 0 done, 2 wrong use or bad input with a line for each problem, 3 a fault of ours with one line."""

from __future__ import annotations

import os
import shlex
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable
from datetime import datetime
from pathlib import Path

import click

import penode_gen

from .errors import UserError


def guarded(command: Callable[[], object]) -> None:
    """Run a command of the command line: exceptions become lines on stderr and an exit code."""
    if not sys.warnoptions:  # what numpy warns of is no matter of the console; of processes that are started neither
        warnings.simplefilter("ignore")
        os.environ.setdefault("PYTHONWARNINGS", "ignore")
    try:
        command()
    except (UserError, penode_gen.ModelError) as exc:
        for problem in exc.problems:
            click.echo(f"penode: {problem}", err=True)
        sys.exit(2)
    except click.exceptions.Abort:
        sys.exit(130)
    except click.UsageError as exc:
        where = exc.ctx.command_path if exc.ctx else "penode"
        click.echo(f"penode: {exc.format_message()} See {where} --help", err=True)
        sys.exit(2)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(0)
    except OSError as exc:
        click.echo(f"penode: {exc.filename or 'a file'}: {exc.strerror or exc}; check the path and its permissions", err=True)
        sys.exit(2)
    except Exception as exc:  # a fault of ours, whatever it is
        click.echo(_crashed(exc), err=True)
        sys.exit(3)


def crash_file(exc: Exception) -> tuple[str, Path | None]:
    """What happened, in one line, and the file with the traceback that was written for it; None if none could be."""
    what = " ".join(f"{type(exc).__name__}: {exc}".split())
    call = shlex.join(["penode", *sys.argv[1:]])
    about = f"penode {penode_gen.VERSION}, Python {sys.version.split()[0]}, {sys.platform}"
    text = f"{about}\n{call}\n\n{''.join(traceback.format_exception(exc))}"
    for folder in (Path.cwd(), Path(tempfile.gettempdir())):
        path = folder / f"penode-crash-{datetime.now():%Y%m%d-%H%M%S}-{os.getpid()}.txt"
        try:
            path.write_text(text, encoding="utf-8", errors="backslashreplace")
        except OSError:
            continue
        return what, path
    return what, None


def _crashed(exc: Exception) -> str:
    """The line that says what to send."""
    what, path = crash_file(exc)
    send = f"{path} and the files that the command names" if path else "this line, the command and the files that it names"
    return f"penode: a fault of penode, not of yours ({what}); send us {send}"
