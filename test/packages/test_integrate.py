# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""port/README.md replayed: from a fresh checkout, without Python, to a step in a timer interrupt of an emulated Cortex-M4F."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import NamedTuple

import build
import pytest
from build import CC, HERE, ROOT, Built, Fails, run

PAGE = (ROOT / "port" / "README.md").read_text(encoding="utf-8")
MOST_COMMANDS = 12
INCLUDE = [f"-I{ROOT / name}" for name in ("inc", "port/gnu", "gen/nqvm/c")]


class Page(NamedTuple):
    """What there is to type."""

    files: dict[str, str]  # name -> text
    commands: list[str]
    prints: str


def read(page: str) -> Page:
    """Programs (named by the line before), commands (a line that goes on behind a backslash is one) and what they print."""
    files = dict(re.findall(r"^Save as `([\w.]+)`.*?\n\n```c\n(.*?)^```$", page, re.MULTILINE | re.DOTALL))
    assert len(files) == page.count("\n```c\n"), "a program without a name"
    shell = "".join(re.findall(r"^```sh\n(.*?)^```$", page, re.MULTILINE | re.DOTALL))
    prints = re.findall(r"^```text\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    assert len(prints) == 1
    return Page(files, shell.replace("\\\n", " ").splitlines(), prints[0])


def replay(page: Page, checkout: Path, env: dict[str, str]) -> str:
    """What the last command prints. The programs are saved once there is the folder that the commands go to."""
    enter = page.commands.index("cd app")
    script = ["set -e", *page.commands[: enter + 1], *(f"cp {checkout}/saved/{name} ." for name in page.files)]
    script += [*page.commands[enter + 1 : -1], "echo built", page.commands[-1]]
    (checkout / "saved").mkdir(exist_ok=True)
    for name, text in page.files.items():
        (checkout / "saved" / name).write_text(text, encoding="utf-8")
    return run(["sh", "-c", "\n".join(script)], cwd=checkout, env=env).split("built\n")[1]


def test_as_the_page_says(checkout: Path, no_python: dict[str, str], reference: Built):
    page = read(PAGE)
    assert len(page.commands) <= MOST_COMMANDS
    shutil.rmtree(checkout / "app", ignore_errors=True)
    assert replay(page, checkout, no_python) == page.prints
    assert page.prints == reference.said  # of this machine, at another level of optimisation
    assert not (Path(no_python["PATH"].split(":")[0]) / "called").exists()


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (" penode/models/nqvm/nqvm_params.c", ""),
        ("-Ipenode/port/gnu ", ""),
        ("-Ipenode/models/nqvm ", ""),
        ("samples % 250U", "samples % 249U"),
    ],
)
def test_error_on_the_page_is_noticed(old: str, new: str, checkout: Path, no_python: dict[str, str]):
    assert old in PAGE
    page = read(PAGE.replace(old, new))
    commands = [command.replace("-O2", "-O0") for command in page.commands]  # sooner compiled
    commands[0] = ":"  # as it was made before
    shutil.rmtree(checkout / "app", ignore_errors=True)
    try:
        said = replay(page._replace(commands=commands), checkout, no_python)
    except Fails:
        return
    assert said != page.prints, "not noticed"


@pytest.fixture(scope="module")
def objects(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Runtime and model, compiled for this machine."""
    work = tmp_path_factory.mktemp("objects")
    sources = [*sorted((ROOT / "src").glob("*.c")), *(ROOT / "gen/nqvm/c" / name for name in build.MODEL)]
    run([*CC, "-fsanitize=address,undefined", *INCLUDE, "-c", *sources], cwd=work)
    return sorted(work.glob("*.o"))


def receive(text: str, work: Path, objects: list[Path]) -> str:
    """Send a set through the receiver of the page, on this machine."""
    (work / "page.c").write_text(text, encoding="utf-8")
    run([*CC, "-fsanitize=address,undefined", *INCLUDE, HERE / "receive.c", work / "page.c", *objects, "-o", work / "receive"])
    return run([work / "receive"])


def test_set_on_a_wire(tmp_path: Path, objects: list[Path]):
    assert receive(read(PAGE).files["receive.c"], tmp_path, objects).endswith("set 2 runs, status 0x0\n")


def test_error_of_the_receiver_is_noticed(tmp_path: Path, objects: list[Path]):
    text = read(PAGE).files["receive.c"]
    assert "at - PEN_SERIAL_HEAD" in text
    with pytest.raises(Fails, match="status 0x"):
        receive(text.replace("at - PEN_SERIAL_HEAD", "at"), tmp_path, objects)


def test_every_path_of_the_page_is_there(tree: Path):
    folder = tree / f"penode-{build.VERSION}"
    named = set(re.findall(r"`((?:inc|src|port|models|zephyr|penode)(?:/[\w.*-]+)+)`", PAGE)) - {"port/packages/amalgamate.sh"}
    assert named
    for name in named:
        assert list(folder.glob(name)) or (folder / "inc" / name).exists(), name
