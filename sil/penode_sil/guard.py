# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
What a command ends with: 0 done, 2 wrong use or bad input with a line for each problem, 3 a bug in penode with one line,
4 a training that did not come down to the noise.

The lines go to stderr; where the command line has --json, the same go to stdout, as one JSON object (sil/ERRORS.md).
"""

from __future__ import annotations

import json
import os
import shlex
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import NoReturn

import click

from penode_gen.version import VERSION

from .errors import InternalError, PenodeError, Problem, WrongUse


def guarded(command: Callable[[], object]) -> None:
    """Run a command of the command line: exceptions become lines on stderr and an exit code."""
    if not sys.warnoptions:  # what numpy warns of is no matter of the console; of processes that are started neither
        warnings.simplefilter("ignore")
        os.environ.setdefault("PYTHONWARNINGS", "ignore")
    try:
        command()
    except PenodeError as exc:
        _end(exc)
    except click.exceptions.Abort:
        sys.exit(130)
    except click.UsageError as exc:
        where = f"See {exc.ctx.command_path if exc.ctx else 'penode'} --help"
        what = exc.format_message()
        _end(WrongUse(Problem.shown(f"{what} {where}", what, place=_option(exc), remedy=where)))
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(0)
    except OSError as exc:
        _end(WrongUse(f"{exc.filename or 'a file'}: {exc.strerror or exc}; check the path and its permissions"))
    except Exception as exc:  # a bug in penode, of any kind
        _end(_crashed(exc))


def _option(exc: click.UsageError) -> str:
    """The option or argument that is wrong, as far as click says."""
    if isinstance(exc, click.BadParameter) and exc.param is not None:
        return max(exc.param.opts, key=len) if isinstance(exc.param, click.Option) else exc.param.human_readable_name
    return getattr(exc, "option_name", "")


def _end(exc: PenodeError) -> NoReturn:
    """Say what is wrong, and end."""
    if "--json" in sys.argv and not exc.printed:
        with suppress(BrokenPipeError):
            click.echo(json.dumps(exc.as_json(), indent=2))
    for problem in exc.problems:
        click.echo(f"penode: {problem}", err=True)
    sys.exit(exc.exit)


def crash_file(exc: Exception) -> tuple[str, Path | None]:
    """What happened, in one line, and the file with the traceback that was written for it; None if none could be."""
    what = " ".join(f"{type(exc).__name__}: {exc}".split())
    call = shlex.join(["penode", *sys.argv[1:]])
    about = f"penode {VERSION}, Python {sys.version.split()[0]}, {sys.platform}"
    text = f"{about}\n{call}\n\n{''.join(traceback.format_exception(exc))}"
    for folder in (Path.cwd(), Path(tempfile.gettempdir())):
        path = folder / f"penode-crash-{datetime.now():%Y%m%d-%H%M%S}-{os.getpid()}.txt"
        try:
            path.write_text(text, encoding="utf-8", errors="backslashreplace")
        except OSError:
            continue
        return what, path
    return what, None


def _crashed(exc: Exception) -> InternalError:
    """The line that asks for a report."""
    what, path = crash_file(exc)
    send = f"{path} and the files that the command names" if path else "this line, the command and the files that it names"
    return InternalError(f"a bug in penode ({what}); report it with {send}", None if path is None else str(path))
