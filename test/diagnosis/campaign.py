# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Hides effects in recordings, lets a command diagnose them, scores the answers.

campaign.py --cases 300 --jobs 2 --out DIR           a fresh draw; its seed is printed
campaign.py --only 123456:17 --out DIR               one case again; leaves its files and truth
campaign.py --command "penode diagnose" --command "neural=python neural.py"     several on the same cases
campaign.py --cases 20 --generate --out DIR          only the files: DIR/cases/... and, apart from them, DIR/truth/...
"""

import argparse
import json
import os
import resource
import secrets
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
import score
from claims import nominals
from hidden import cases

ONE_CORE = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS"), "1")


def worked() -> float:
    """Seconds of processor time of all commands so far."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def pace() -> float:
    """Seconds of processor time that this machine takes to count to ten million, now: others may be on it."""
    begin = time.process_time()
    for _ in range(10_000_000):
        pass
    return time.process_time() - begin


def started(call: list[str], timeout: float) -> tuple[int, str]:
    """Exit code and stderr of a command. Raises TimeoutExpired."""
    done = subprocess.run(call, capture_output=True, text=True, timeout=timeout, env={**os.environ, **ONE_CORE})
    return done.returncode, done.stderr


def forked(call: list[str], timeout: float) -> tuple[int, str]:
    """The same of a penode command, in a process of its own that has the modules of this one."""

    def penode(stderr: str) -> None:
        from penode_sil.cli import main

        sys.argv = call
        with open(os.devnull, "w") as sys.stdout, open(stderr, "w") as sys.stderr:
            main()

    with tempfile.NamedTemporaryFile("r") as stderr:
        process = get_context("fork").Process(target=penode, args=(stderr.name,))
        process.start()
        process.join(timeout)
        if process.is_alive():
            process.kill()
            process.join()
            raise subprocess.TimeoutExpired(call, timeout)
        return process.exitcode or 0, stderr.read()


def diagnose(
    command: str,
    folder: Path,
    recordings: list[Path],
    timeout: float,
    start: Callable[[list[str], float], tuple[int, str]] = started,
    holdouts: int = 1,
) -> tuple[dict | None, float, str]:
    """Runs the command as a user would, the last `holdouts` recordings as the hold-out. Returns the diagnosis or None, seconds of one
    core that it took, and why there is none."""
    answer = folder / "diagnosis"
    train, held_out = recordings[:-holdouts], recordings[-holdouts:]
    call = [*shlex.split(command), folder / "model.toml", "--data", *train, "--holdout", *held_out, "-o", answer]
    try:
        begin = worked()
        code, stderr = start(list(map(str, call)), timeout)
    except subprocess.TimeoutExpired:
        return None, timeout, "timeout"
    seconds = worked() - begin
    (folder / "stderr.txt").write_text(stderr)
    if code:
        return None, seconds, f"exit {code}: {(stderr.strip().splitlines() or [''])[-1][:160]}"
    try:
        return json.loads((answer / "diagnosis.json").read_text()), seconds, ""
    except (OSError, ValueError) as problem:
        return None, seconds, f"no diagnosis: {problem}"


def simulated(command: str, model: Path, recording: Path) -> dict[str, float]:
    """RMSE of a model file on a recording, by simulating it; nothing if it cannot be simulated."""
    prediction = model.with_name("prediction.csv")
    call = [*shlex.split(command), model, "--input", recording, "-o", prediction]
    if not model.exists() or subprocess.run(list(map(str, call)), capture_output=True, timeout=120).returncode:
        return {}
    seen, said = (np.genfromtxt(f, delimiter=",", names=True, deletechars="") for f in (recording, prediction))
    n = min(len(seen), len(said))
    both = set(seen.dtype.names) & set(said.dtype.names)  # such as "a_body_[m/s^2]"
    return {name.split("_[")[0]: float(np.sqrt(np.mean((seen[name][:n] - said[name][:n]) ** 2))) for name in both}


def run(
    seed: int, index: int, commands: dict[str, str], simulate: str, timeout: float, out: Path, keep: bool, fork: bool = False
) -> list[dict]:
    """One case from draw to scores, one for each command. The truth is written only after the commands are through."""
    case = cases.make(seed, index)
    folder = out / "cases" / f"{seed}-{index}"
    shutil.rmtree(folder, ignore_errors=True)
    recordings, answers = case.write(folder), []
    for name, command in commands.items():
        found, seconds, why = diagnose(command, folder, recordings, timeout, forked if fork else started)
        error: dict[str, float] = {}
        if simulate and found and not case.bench.moving:  # else it needs a start state that only the diagnosis knows
            error = simulated(simulate, folder / "diagnosis" / "model_extended.toml", recordings[-1])
        answers.append((name, found, seconds, why, error))
        if (folder / "diagnosis").exists() and len(commands) > 1:
            (folder / "diagnosis").rename(folder / f"diagnosis of {name}")
    truth, nominal = case.truth(), nominals(folder / "model.toml")
    rows = [{"command": name, **score.score(truth, found, seconds, why, error, nominal)} for name, found, seconds, why, error in answers]
    if keep or not rows[0]["right"]:
        cases.write_truth(truth, out / "truth" / f"{seed}-{index}.json")
    if not keep:
        shutil.rmtree(folder)
    return rows


def alone(case: str, command: str, timeout: float, out: Path) -> float:
    """Seconds that a case of the draw takes by itself, compilers left out: with a second one beside it, two share caches and units of a
    core."""
    seed, index = map(int, case.split(":"))
    folder = out / "cases" / f"{seed}-{index}"
    shutil.rmtree(folder, ignore_errors=True)
    found, seconds, _ = diagnose(command, folder, cases.make(seed, index).write(folder), timeout)
    shutil.rmtree(folder)
    return round(seconds - (found or {}).get("compile_seconds", 0.0), 2)


def generate(seed: int, index: int, out: Path) -> str:
    """The files of one case, and its truth in a line."""
    case = cases.make(seed, index)
    truth = case.truth()
    case.write(out / "cases" / f"{seed}-{index}")
    cases.write_truth(truth, out / "truth" / f"{seed}-{index}.json")
    hidden = [f"{e['kind']} at {e['where']} as {e['form']}, energy {e['energy']:.0f}" for e in truth["effects"]]
    return f"{seed}:{index} {case.stratum}: {'; '.join(hidden) or 'nothing'}"


def choose(seed: int, count: int, strata: set[str], kinds: set[str]) -> list[tuple[int, int]]:
    """The first cases of the draw in these strata, and with one of these kinds if any are given."""
    found: list[tuple[int, int]] = []
    for index in range(200 * count + 1000):
        hidden = {kind for kind, _ in cases.kinds_of(seed, index)}
        if len(found) < count and cases.PATTERN[index % len(cases.PATTERN)] in strata and (not kinds or kinds & hidden):
            found.append((seed, index))
    return found


def line(row: dict) -> str:
    hidden = " + ".join(f"{k} ({f}, {e:.0f})" for k, f, e in zip(row["kinds"], row["forms"], row["energies"], strict=True)) or "nothing"
    answer = " + ".join(row["answer"]) or row["verdict"] or row["why"]
    return f"{row['command']} {row['case']} {row['stratum']}: {row['outcome']}: {hidden} -> {answer}, {row['seconds']} s"


def commit() -> str:
    """What the code was, as far as Git knows it; the page that the last draw left is no code."""

    def git(*call: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(["git", "-C", str(Path(__file__).parent), *call], capture_output=True, text=True)

    if not shutil.which("git") or (found := git("describe", "--always")).returncode:
        return "an unknown commit"
    return f"commit {found.stdout.strip()}" + "-dirty" * bool(
        git("diff", "--quiet", "HEAD", "--", ":/", ":(exclude)CAMPAIGN.md").returncode
    )


def least(text: str) -> tuple[str, int]:
    """null=100: a stratum and a count."""
    stratum, _, count = text.partition("=")
    if stratum not in cases.STRATA or not count.isdigit():
        raise argparse.ArgumentTypeError(f"not STRATUM=N: {text}; strata are {', '.join(cases.STRATA)}")
    return stratum, int(count)


def begun(file: Path, asked: argparse.Namespace, commands: Mapping[str, str]) -> tuple[int, list[dict]]:
    """Seed and rows of the draw in a folder, which one that was stopped has left; a new seed, a new file and no rows else."""
    head = {"commands": commands, "code": commit()}
    if asked.resume and file.exists():
        first, *rows = map(json.loads, file.read_text().splitlines())
        seed = first.pop("seed")
        if first != head or asked.seed not in (None, seed):
            print(f"{file}: another draw, by {first['code']}, with seed {seed}; remove it, or leave --resume out", file=sys.stderr)
            raise SystemExit(2)
        return seed, list({(r["command"], r["case"]): r for r in rows}.values())  # of a case that was timed again, the later row
    seed = secrets.randbelow(10**9) if asked.seed is None else asked.seed
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps({"seed": seed, **head}) + "\n")
    return seed, []


def note(out: Path, rows: list[dict]) -> None:
    """Adds rows to those of the draw, for one that is stopped to go on with."""
    with (out / "rows.jsonl").open("a") as file:
        file.write("".join(json.dumps(row) + "\n" for row in rows))


def drawing(about: str | None, out: Path) -> argparse.ArgumentParser:
    """The options that other campaigns share, which draw cases and write them below `out`."""
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="index of the first case (0), to go on with a draw")
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument("--only", help="SEED:INDEX")
    parser.add_argument("--no-tolerance", action="store_true", help="leave every tolerance out")
    parser.add_argument("--command", default="build/venv/bin/penode diagnose")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--timeout", type=float, default=900.0)
    parser.add_argument("--out", type=Path, default=out)
    parser.add_argument("--keep", action="store_true", help="keep files and answers of every case")
    parser.add_argument("--generate", action="store_true", help="only the files and the truth; no command is run")
    return parser


def drawn(args: argparse.Namespace) -> tuple[int, list[int]]:
    """The seed, printed, and the indices that these options ask for; the folder for results is made."""
    seed = secrets.randbelow(10**6) if args.seed is None else args.seed
    indices = list(range(args.first, args.first + args.cases))
    if args.only:
        seed, index = map(int, args.only.split(":"))
        indices = [index]
    args.out.mkdir(parents=True, exist_ok=True)
    print(f"seed {seed}", flush=True)
    return seed, indices


def arguments() -> argparse.ArgumentParser:
    parse = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parse.add_argument
    add("--cases", type=int, default=48, help="how many cases (48)")
    add("--seed", type=int, help="of the draw; default: a new one, which is printed")
    add("--resume", action="store_true", help="go on with the draw that was stopped in this folder, with the code that began it")
    add("--only", action="append", default=[], metavar="SEED:INDEX", help="just this case; may be given again")
    add("--strata", default=",".join(cases.STRATA), help="take these only: " + ", ".join(cases.STRATA))
    add("--least", action="append", default=[], type=least, metavar="STRATUM=N", help="go on until so many are of it; may be given again")
    add("--kinds", default="", help="take only cases with one of these kinds")
    add(
        "--command",
        action="append",
        default=[],
        metavar="[NAME=]COMMAND",
        help="called as COMMAND MODEL.toml --data REC... --holdout REC -o DIR (penode diagnose); may be given again",
    )
    add(
        "--simulate",
        default="",
        metavar="COMMAND",
        help="measure the gain by COMMAND model_extended.toml --input REC -o OUT.csv, not by what the diagnosis says",
    )
    add("--timeout", type=float, default=240, help="seconds for one case, by the clock (240)")
    add("--fork", action="store_true", help="the commands are penode's: fork them, so that modules are loaded once")
    add("--jobs", type=int, default=1, help="cases at the same time (1)")
    add(
        "--alone",
        type=float,
        default=float("inf"),
        metavar="SECONDS",
        help="when all are through, run those that took the first command longer once more by themselves, for their time",
    )
    add("--out", type=Path, default=Path("build/campaign"), help="folder (build/campaign)")
    add("--page", type=Path, help="write the tables there too")
    add("--keep", action="store_true", help="keep recordings, diagnoses and truths")
    add("--generate", action="store_true", help="write the cases, diagnose nothing")
    add("--gate", action="store_true", help="exit code 1 if the first command fails more often than chance allows (1 in 1000)")
    add("--brief", action="store_true", help="failures and the gate only, no tables")
    return parse


def write(
    asked: argparse.Namespace, commands: Mapping[str, str], seed: int, cases: int, rows: Mapping[str, list[dict]], paces: Sequence[float]
) -> None:
    """Tables of the cases that are through, of so many: printed, and kept beside the rows."""
    done = len(next(iter(rows.values())))
    count = f"{done} cases" + f", the first of {cases}" * (done < cases)
    tables = {name: score.summary(own) for name, own in rows.items()}
    texts = {name: f"{score.text(own)}\n\n{score.confusion(own)}\n" for name, own in tables.items()}
    side = score.compare(tables)
    if not asked.brief:
        print("".join(f"\n{name}: {commands[name]}\n{own}" for name, own in texts.items()) + f"\n{side}\n")
    said = (
        f"Code of {commit()}. Seconds are of the processor for a whole command, imports and files included, compilers not; "
        f"to count to ten million took it {paces[0]:.2f} s before and {paces[1]:.2f} s after."
    )
    if again := sum("alone" in r for r in next(iter(rows.values()))):
        said += (
            f" Of the {again} cases of more than {asked.alone:g} s with {asked.jobs} at a time, "
            "the time is that of a second run by themselves."
        )
    page = [
        f"# Campaign of {count}, seed {seed}\n\n{said}\n\n{side}\n",
        *(f"\n## {name}\n\n```\n{own}```\n" for name, own in texts.items()),
    ]
    for path in filter(None, (asked.out / "campaign.md", asked.page)):
        path.write_text("".join(page))
    result = {"seed": seed, "commands": commands, "tables": tables, "rows": rows}
    (asked.out / "campaign.json").write_text(json.dumps(result, indent=1))
    print(f"one case again: --only SEED:INDEX; all rows: {asked.out / 'campaign.json'}")


def gated(own: Sequence[dict], seed: int, seconds: float) -> int:
    """Print the gates that a command's rows fail; exit code 1 if there are any."""
    gates = score.gate(own)
    failed = list(filter(None, gates.values()))
    print("".join(f"gate: {p}\n" for p in failed), end="")
    right = sum(r["right"] for r in own)
    print(
        f"{len(gates) - len(failed)} passed, {len(failed)} failed in {seconds:.0f}s: gates of {len(own)} cases, {right} right, seed {seed}"
    )
    return 1 if failed else 0


def main() -> int:
    parse = arguments()
    asked = parse.parse_args()
    begin, paces = time.monotonic(), [pace()]
    commands = dict(c.split("=", 1) if "=" in c.split()[0] else ("diagnose", c) for c in asked.command or ["penode diagnose"])
    strata, kinds = set(asked.strata.split(",")), set(filter(None, asked.kinds.split(",")))
    if not strata <= set(cases.STRATA) or not kinds <= set(cases.KINDS):
        parse.error(f"unknown: {', '.join((strata - set(cases.STRATA)) | (kinds - set(cases.KINDS)))}")
    seed, before = begun(asked.out / "rows.jsonl", asked, commands)
    chosen = [tuple(map(int, one.split(":"))) for one in asked.only] or choose(seed, asked.cases, strata, kinds)
    for stratum, count in asked.least if not asked.only else ():
        chosen += [one for one in choose(seed, count, {stratum}, set()) if one not in chosen]
    print(f"{len(chosen)} cases, seed {chosen[0][0] if chosen else seed}", flush=True)
    rows: dict[str, list[dict]] = {name: [r for r in before if r["command"] == name] for name in commands}
    through = {r["case"] for r in before}
    left = [(s, i) for s, i in chosen if f"{s}:{i}" not in through]
    if before:
        print(f"{len(chosen) - len(left)} of them are through", flush=True)
    if asked.fork:  # what the command loads, once for all cases
        import_module("penode_sil.cli")
        import_module("penode_sil.diagnosis.files")
    with ProcessPoolExecutor(asked.jobs) as pool:
        if asked.generate:
            for job in [pool.submit(generate, *one, asked.out) for one in chosen]:
                print(job.result(), flush=True)
            return 0
        more = (commands, asked.simulate, asked.timeout, asked.out, asked.keep or bool(asked.only), asked.fork)
        jobs = [pool.submit(run, *one, *more) for one in left]
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        try:
            for done, job in enumerate(jobs, 1 + len(chosen) - len(left)):
                note(asked.out, job.result())
                for row in job.result():
                    rows[row["command"]].append(row)
                    if not row["right"] or asked.only:
                        print(line(row), flush=True)
                if sys.stderr.isatty():
                    print(f"{done} of {len(chosen)}", end="\r", file=sys.stderr)
            for row in [r for r in next(iter(rows.values())) if asked.alone < r["seconds"] - r["compiling"] and "alone" not in r]:
                row["alone"] = alone(row["case"], next(iter(commands.values())), asked.timeout, asked.out)
                note(asked.out, [row])
        except KeyboardInterrupt:  # its tables are of the cases so far
            pool.shutdown(wait=False, cancel_futures=True)
    paces.append(pace())
    write(asked, commands, seed, len(chosen), rows, paces)
    return gated(next(iter(rows.values())), seed, time.monotonic() - begin) if asked.gate else 0


if __name__ == "__main__":
    sys.exit(main())
