# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Many recordings: a diagnosis of each by itself, in processes of this machine or on a Dask cluster.

A recording that cannot be diagnosed becomes a row that says why. Rows stand in the order of the recordings, whichever
is through first.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from importlib import metadata
from multiprocessing import get_context
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import penode_gen

from ..errors import TargetError, ToolMissing, UserError, WrongUse
from ..guard import crash_file
from ..recordings.measured import load
from . import files, table
from .files import Job
from .table import Row

KINDS = (".csv", ".mf4", ".mdf")
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
PATIENCE = 30.0  # [s] a cluster may be without a worker for so long
Answer = tuple[dict[str, Any] | None, str]  # what a Row has of a diagnosis, or None and why there is none
DIED = "the process that diagnosed it died; is there enough memory? diagnose it alone, and report it if it dies again"


def diagnose(
    job: Job, processes: int = 1, scheduler: str = "", resume: bool = False, tell: Callable[[int, int], None] = lambda done, of: None
) -> tuple[Row, ...]:
    """Diagnose each recording of a job by itself, with the same hold-out, into a folder of its own below job.output;
    the table over all is written beside. `scheduler` is the address of a Dask cluster whose workers see the same files.

    `resume` keeps what an earlier table has of the same model, recording, hold-out and options. `tell` hears how many
    are done. UserError, before anything is written, if nothing can be begun.
    """
    parts = plan(job)
    model = files.load_model(job)
    load(job.holdout, model, job.channels)
    sources = [_source(part, model) for part in parts]
    kept = {row.source: row for row in table.read(job.output)} if resume else {}
    rows = {k: kept[source] for k, source in enumerate(sources) if source in kept}
    todo = [k for k in range(len(parts)) if k not in rows]
    work = [_absolute(parts[k]) for k in todo]
    tell(len(rows), len(parts))
    answers = _on_cluster(work, scheduler) if scheduler else _in_processes(work, processes)
    for number, (found, error) in answers if work else ():
        k = todo[number]
        part = parts[k]
        if found is not None and not (part.output / "diagnosis.json").exists():
            what = f"{part.data[0]}: its files are not in {part.output}"
            found, error = None, f"{what}; use a folder that all workers share"
        error = error.replace(str(work[number].data[0]), str(part.data[0]))
        rows[k] = Row(str(part.data[0]), str(part.output.relative_to(job.output)), sources[k], found, error)
        table.write(job.output, model.name, [rows[k] for k in sorted(rows)])
        tell(len(rows), len(parts))
    ordered = tuple(rows[k] for k in sorted(rows))
    table.write(job.output, model.name, ordered)
    return ordered


def plan(job: Job) -> list[Job]:
    """A job for each recording: files as named, folders by what lies directly in them, in the order of names. UserError
    for an empty folder, and if the results would lie among the recordings."""
    if job.output.resolve() in {place.resolve() for place in job.data}:
        raise WrongUse(f"{job.output}: the results would lie among the recordings; name another directory")
    paths: list[Path] = []
    for place in job.data:
        inside = [place]
        if place.is_dir():
            files_in = (p for p in place.iterdir() if p.is_file() and p.name[0] != ".")
            inside = sorted(p for p in files_in if p.suffix.lower() in KINDS)
            if not inside:
                raise WrongUse(f"{place}: there is no recording in this folder; put {', '.join(KINDS)} files into it")
        paths += inside
    paths = list(dict.fromkeys(paths))
    names = [path.stem for path in paths]
    if len(set(names)) < len(names):  # a.csv and a.mf4, or of several folders
        above = os.path.commonpath([path.absolute().parent for path in paths])
        names = [str(path.absolute().relative_to(above)) for path in paths]
    return [replace(job, data=(path,), output=job.output / name) for path, name in zip(paths, names, strict=True)]


def _absolute(job: Job) -> Job:
    """The same for a process that runs elsewhere."""
    data, holdout, still = (tuple(path.absolute() for path in paths) for paths in (job.data, job.holdout, job.still))
    return replace(job, model=job.model.absolute(), data=data, holdout=holdout, still=still, output=job.output.absolute())


def _source(job: Job, model: penode_gen.Model) -> str:
    """A name for all that an answer follows from."""
    parts = [penode_gen.VERSION, model.digest, job.set_name, *job.channels]
    parts += [str(len(job.holdout)), str(len(job.still))]
    for path in (*job.data, *job.holdout, *job.still):
        parts.append(hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "")
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]


def attempt(job: Job) -> Answer:
    """One diagnosis; all that goes wrong becomes a line."""
    unseen = next((path for path in (job.model, *job.data, *job.holdout, *job.still) if not path.exists()), None)
    if unseen is not None:
        return None, f"{unseen}: there is no such file where it is to be diagnosed; use a folder that all workers share"
    try:
        found = files.run(job)[1].as_json()
        return json.loads(json.dumps({key: found[key] for key in table.KEPT})), ""
    except UserError as exc:
        more = len(exc.problems) - 1
        return None, exc.problems[0] + (f" (and {more} more)" if more else "")
    except Exception as exc:  # a defect in one diagnosis must not take the others along
        what, path = crash_file(exc)
        return None, f"{job.data[0]}: the diagnosis failed ({what}); report this bug with {path or 'this line'} and the recording"


def _in_processes(jobs: Sequence[Job], count: int) -> Iterator[tuple[int, Answer]]:
    """Number and answer of each job as it ends. A process that dies takes only its own job along."""
    pools: SimpleQueue[ProcessPoolExecutor] = SimpleQueue()
    count = min(count, len(jobs))

    def begin() -> None:  # an interrupt ends it at once, without a word
        pools.put(ProcessPoolExecutor(1, get_context("spawn"), signal.signal, (signal.SIGINT, signal.SIG_DFL)))

    def one(job: Job) -> Answer:
        pool = pools.get()
        try:
            answer = pool.submit(attempt, job).result()
            pools.put(pool)
            return answer
        except BrokenProcessPool:
            begin()
            return None, f"{job.data[0]}: {DIED}"

    before = {name: os.environ.get(name) for name in THREADS}
    os.environ |= dict.fromkeys(THREADS, "1")  # what processes inherit: they are many already
    threads = ThreadPoolExecutor(count)
    try:
        for _ in range(count):
            begin()
        numbers = {threads.submit(one, job): k for k, job in enumerate(jobs)}
        for future in as_completed(numbers):
            yield numbers[future], future.result()
    finally:
        threads.shutdown(cancel_futures=True)
        while not pools.empty():
            pools.get().shutdown()
        for name, value in before.items():
            os.environ.pop(name)
            os.environ |= {} if value is None else {name: value}


def _on_cluster(jobs: Sequence[Job], address: str) -> Iterator[tuple[int, Answer]]:
    """The same by the workers of a Dask scheduler. UserError if it, or a worker with this penode, cannot be had."""
    import asyncio  # with it comes SSL: slow to load, and for a cluster only

    try:
        from distributed import Client, Security, wait
        from distributed.comm.core import connect
    except ImportError:
        raise ToolMissing(f"--scheduler {address}: Dask is not installed here; pip install penode[cluster]") from None
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)  # what matters is reported here

    async def greet() -> None:  # a client would wait for ever on a server of another kind
        comm = await asyncio.wait_for(connect(address, timeout=5.0, **Security().get_connection_args("client")), 10.0)
        await comm.close()

    try:
        asyncio.run(greet())
    except (OSError, ValueError) as exc:
        what = "no Dask scheduler answers there; start one (dask scheduler), or correct the address"
        raise TargetError(f"--scheduler {address}: {what}") from exc
    with Client(address, set_as_default=False) as client, client.as_current():
        _staffed(client, address)
        for worker, version in client.run(metadata.version, "penode", on_error="return").items():
            if version != penode_gen.VERSION:
                has = "no penode" if isinstance(version, Exception) else f"penode {version}"
                what = f"{worker} has {has}; install {penode_gen.VERSION} there as here"
                raise TargetError(f"--scheduler {address}: {what}")
        numbers = {future: k for k, future in enumerate(client.map(attempt, jobs, pure=False))}
        while numbers:
            try:
                finished = wait(list(numbers), timeout=PATIENCE, return_when="FIRST_COMPLETED").done
            except TimeoutError:
                _staffed(client, address)
                continue
            except CancelledError:
                what = "its connection was lost; start it again, then --resume keeps what is done"
                raise TargetError(f"--scheduler {address}: {what}") from None
            for future in finished:
                k = numbers.pop(future)
                try:
                    yield k, future.result()
                except Exception:  # the scheduler gives a job up that several workers died of
                    yield k, (None, f"{jobs[k].data[0]}: {DIED}")


def _staffed(client: Any, address: str) -> None:
    """UserError if a cluster stays without a worker."""
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        what = f"the cluster has no workers; start some (dask worker {address})"
        raise TargetError(f"--scheduler {address}: {what}") from None
