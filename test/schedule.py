# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A pytest plugin of tally.py: files of tests, the longest first, on cores that are shared with make.

PENODE_TOKENS names a pipe that holds a byte for each free core (the job server of GNU make); a test takes one while it runs.
PENODE_DURATIONS names the file that gets the seconds of all tests; those of the last run, if it is there, give the order.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
from xdist.scheduler import LoadScopeScheduling
from xdist.workermanage import WorkerController

TOGETHER = {"install", "packages"}  # folders whose tests share what lies at one place: for one worker
# Where no run before says so, these begin.
LONG = (
    "test_diagnosis test_folder test_bench test_selftest test_holding test_tutorials test_commands test_batch test_emit "
    "test_hidden test_packages test_targets test_step test_coarse_rigs test_bent_inputs test_other_cores test_absorb "
    "test_diagnose_bad_input test_tune_filter test_filter_file test_innovations test_drives test_serve_lines test_mix_ups"
).split()
took: Counter[str] = Counter()


class Files(LoadScopeScheduling):
    """A file for a worker, so that its fixtures are made once."""

    def _split_scope(self, nodeid: str) -> str:
        return group_of(nodeid)

    def remove_node(self, node: WorkerController) -> str | None:
        """What a worker has left when it dies is for another, but for the test that ended it."""
        units = self.assigned_work.pop(node)
        left = [(unit, test) for unit in units.values() for test, done in unit.items() if not done]
        if not left:
            return None
        unit, ended = left[0]
        unit[ended] = True
        self.workqueue.update({name: unit for name, unit in units.items() if not all(unit.values())})
        for other in self.assigned_work:
            self._reschedule(other)
        return ended

    def schedule(self) -> None:
        """Also when a worker has died: the one that comes for it waits with its last test, for another or the end."""
        super().schedule()
        if self.collection is not None and not self.workqueue:
            for node in self.nodes:
                node.shutdown()


def group_of(nodeid: str) -> str:
    """What stays together: a file, or a folder."""
    path = Path(nodeid.split("::")[0])
    return path.parent.name if path.parent.name in TOGETHER else str(path)


def seconds(path: Path) -> dict[str, float]:
    """Seconds of each test of the last run; empty if there was none."""
    try:
        return json.loads(path.read_text())
    except (OSError, ValueError):
        return {}


def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> Files:
    return Files(config, log)


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The groups that take longest come first. The order is the same in all workers."""
    known = seconds(Path(os.environ["PENODE_DURATIONS"]))
    length: Counter[str] = Counter()
    for item in items:
        length[group_of(item.nodeid)] += known.get(item.nodeid, 0.0) if known else 1e3 * (item.path.stem in LONG)
    items.sort(key=lambda item: -length[group_of(item.nodeid)])


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol() -> Iterator[None]:
    """One core for one test."""
    pipe = os.open(os.environ["PENODE_TOKENS"], os.O_RDWR)
    token = os.read(pipe, 1)
    try:
        return (yield)
    finally:
        os.write(pipe, token)
        os.close(pipe)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Set-up, call and end of a test."""
    took[report.nodeid] += report.duration


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Keep what was measured; only the process that hears of all tests does."""
    if not hasattr(session.config, "workerinput"):
        path = Path(os.environ["PENODE_DURATIONS"])
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps({name: round(value, 2) for name, value in took.items()}, indent=0))
