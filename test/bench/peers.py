# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The same Runge-Kutta step of the quarter vehicle with the same two networks, as other tools make it.

Each peer is C with a function peer_step(x, input before, input now). Packages come from PyPI, pinned, when the
benchmark runs; nothing of them is kept. Peers need not do what costs us instructions: no check of any number, no trust
envelope, no exchange of sets, and the scaling of inputs and outputs is worked into their weights beforehand.
"""

from __future__ import annotations

import importlib
import shutil
import subprocess
import sys
import tarfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import penode_gen
from penode_gen.networks import Network

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
PLACE = ROOT / "build" / "bench"
GLUE = HERE / "peers"
PACKAGES = ("casadi==3.8.2", "emlearn==0.23.2")
CMSIS = "cmsisdsp==1.10.3"

Layer = tuple[NDArray[np.float32], NDArray[np.float32]]  # weights [n_out][n_in], biases


@dataclass(frozen=True)
class Case:
    """What all peers compute."""

    networks: dict[str, list[Layer]]  # spring, damper; ReLU between the layers
    m_b: float
    m_w: float
    c: float
    d: float
    c_t: float
    h: float


@dataclass(frozen=True)
class Peer:
    """C of a peer: the folder with its constants and weights, what else to compile, and with which options."""

    name: str
    folder: Path
    sources: list[Path]
    options: list[str] = field(default_factory=list)
    weights_inside: int = 0  # bytes of its own constants that are weights


def plain_layers(network: Network) -> list[Layer]:
    """Weights and biases of the dense layers in float, with the scaling of input and output worked in."""
    before, *dense, after = network.layers
    layers = [(layer.weights.copy(), layer.bias.copy()) for layer in dense]
    first, last = layers[0], layers[-1]
    first[1][:] -= first[0] @ (before.shift * before.factor)
    first[0][:] *= before.factor
    last[0][:] *= after.factor[:, None]
    last[1][:] = last[1] * after.factor + after.shift
    return [(w.astype(np.float32), b.astype(np.float32)) for w, b in layers]


def the_case() -> Case:
    """The quarter vehicle of gen/nqvm with its default set."""
    model = penode_gen.load(ROOT / "gen" / "nqvm" / "nqvm.toml")
    networks = {name.removesuffix("_net"): plain_layers(n) for name, n in model.sets["default"].networks.items()}
    value = {name: float(parameter.value) for name, parameter in model.parameters.items()}
    return Case(networks, value["m_b"], value["m_w"], value["c"], value["d"], value["c_t"], float(model.sample_time))


# -- what the glue of all peers includes ------------------------------------------------------------------------------


def _literal(value: float) -> str:
    """The shortest text of a float, as C."""
    return np.format_float_scientific(np.float32(value), unique=True, trim="0") + "F"


def _constants(case: Case, count: int) -> str:
    lines = [
        f"#define M_B_INVERSE {_literal(1 / case.m_b)}",
        f"#define M_W_INVERSE {_literal(1 / case.m_w)}",
        f"#define C {_literal(case.c)}",
        f"#define D {_literal(case.d)}",
        f"#define C_T {_literal(case.c_t)}",
        f"#define H {_literal(case.h)}",
        f"#define WEIGHTS {count} /* of a network */",
        f"extern const float peer_weights[{2 * count}];",
    ]
    return "\n".join(lines) + "\n"


def _flat(layers: list[Layer], order: str = "C") -> NDArray[np.float32]:
    return np.concatenate([np.concatenate([w.ravel(order=order), b]) for w, b in layers])


def _folder(name: str, case: Case, order: str = "C") -> Path:
    """A fresh folder with constants.h and the weights, row by row or (F) column by column, biases after each layer."""
    folder = PLACE / "peers" / name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    weights = [_flat(layers, order) for layers in case.networks.values()]
    (folder / "constants.h").write_text(_constants(case, weights[0].size))
    values = ",\n".join(_literal(v) for v in np.concatenate(weights))
    (folder / "weights.c").write_text(f'#include "constants.h"\nconst float peer_weights[{2 * weights[0].size}] = {{\n{values}\n}};\n')
    return folder


# -- the peers --------------------------------------------------------------------------------------------------------


def textbook(case: Case) -> Peer:
    """Three loops."""
    folder = _folder("textbook", case)
    return Peer("textbook loop", folder, [GLUE / "textbook.c"])


def cmsis_dsp(case: Case) -> Peer:
    """arm_mat_vec_mult_f32 of CMSIS-DSP, from the source package of its Python binding."""
    folder = _folder("cmsis_dsp", case)
    packed, name = PLACE / "packages", CMSIS.replace("==", "-")
    if not list(packed.glob(f"{name}.tar.gz")):
        _pip("download", "--no-deps", "--no-binary", "cmsisdsp", "-d", str(packed), CMSIS)
    parts = ("/Include/", "/PrivateInclude/", "arm_mat_vec_mult_f32.c")
    with tarfile.open(packed / f"{name}.tar.gz") as archive:
        wanted = [member for member in archive.getmembers() if any(part in member.name for part in parts)]
        archive.extractall(folder, wanted, filter="data")
    source = folder / name / "Source" / "MatrixFunctions" / "arm_mat_vec_mult_f32.c"
    # __GNUC_PYTHON__ is the package's own way to do without the headers of CMSIS-Core.
    options = ["-D__GNUC_PYTHON__", *(f"-I{folder / name / headers}" for headers in ("Include", "PrivateInclude"))]
    return Peer("CMSIS-DSP 1.10.3", folder, [GLUE / "cmsis_dsp.c", source], options)


def emlearn(case: Case) -> Peer:
    """emlearn's loadable networks; it prints 6 decimals of a weight, here all of them."""
    package, generator, printer = (_package(f"emlearn{part}") for part in ("", ".net", ".cgen"))
    short = printer.constant
    printer.constant = lambda value, dtype="float": _literal(value) if dtype == "float" else str(value)
    text = ""
    for name, layers in case.networks.items():
        kinds = ["relu"] * (len(layers) - 1) + ["identity"]
        text += generator.c_generate_net_loadable(kinds, [w.T for w, _ in layers], [b for _, b in layers], name)
    printer.constant = short
    folder = _folder("emlearn", case)
    (folder / "emlearn_networks.h").write_text(text)
    inside = 4 * sum(_flat(layers).size for layers in case.networks.values())
    return Peer("emlearn 0.23.2", folder, [GLUE / "emlearn.c"], [f"-I{Path(package.__file__).parent}"], inside)


def casadi(case: Case, kind: str, mended: bool) -> Peer:
    """
    CasADi's generated C of the whole step. kind "SX": every operation a statement; "MX": matrix operations;
    "SX, called": the rates as SX, called four times by the step as MX. mended: fmaxf for fmax, which is in double.
    """
    ca = _package("casadi")
    name = f"casadi {kind}{', fmaxf' if mended else ''}"
    folder = _folder(name.replace(" ", "_").replace(",", ""), case, "F")
    function = _casadi_step(ca, case, kind)
    generator = ca.CodeGenerator("step.c", {"casadi_real": "float", "casadi_int": "int"})
    generator.add(function)
    generator.generate(f"{folder}/")
    if mended:
        text = (folder / "step.c").read_text()
        (folder / "step.c").write_text(text.replace("return fmax(", "return fmaxf("))
    sizes = {"ARG": function.sz_arg(), "RES": function.sz_res(), "IW": function.sz_iw(), "W": function.sz_w()}
    lines = [f"#define step_SZ_{key} {value}" for key, value in sizes.items()]
    lines.append("int step(const float **arg, float **res, int *iw, float *w, int mem);")
    (folder / "casadi_step.h").write_text("\n".join(lines) + "\n")
    return Peer(name.replace("casadi", "CasADi 3.8.2"), folder, [GLUE / "casadi.c", folder / "step.c"])


def _casadi_step(ca: Any, case: Case, kind: str) -> Any:
    """step(x, input before, input now, weights) -> x as a CasADi function."""
    outer = ca.SX if kind == "SX" else ca.MX
    inner = ca.MX if kind == "MX" else ca.SX
    count = _flat(case.networks["spring"]).size
    x, road, p = inner.sym("x", 4), inner.sym("road"), inner.sym("p", 2 * count)

    def network(values: Any, layers: list[Layer], signal: Any) -> Any:
        at = 0
        for k, (w, b) in enumerate(layers):
            weights, bias = ca.reshape(values[at : at + w.size], *w.shape), values[at + w.size : at + w.size + b.size]
            signal = ca.mtimes(weights, signal) + bias
            signal = signal if k == len(layers) - 1 else ca.fmax(signal, 0)
            at += w.size + b.size
        return signal

    s, v = x[0] - x[1], x[2] - x[3]
    force = case.c * s + case.d * v
    force += network(p[:count], case.networks["spring"], s) + network(p[count:], case.networks["damper"], v)
    dx = ca.vertcat(x[2], x[3], -force / case.m_b, (force - case.c_t * (x[1] - road)) / case.m_w)
    rates = ca.Function("rates", [x, road, p], [dx])

    x, before, now, p = outer.sym("x", 4), outer.sym("before"), outer.sym("now"), outer.sym("p", 2 * count)
    middle, h = (before + now) / 2, case.h
    k1 = rates(x, before, p)
    k2 = rates(x + h / 2 * k1, middle, p)
    k3 = rates(x + h / 2 * k2, middle, p)
    k4 = rates(x + h * k3, now, p)
    return ca.Function("step", [x, before, now, p], [x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])


def scalar(case: Case, inlined: bool) -> Peer:
    """Every multiply-add a statement. inlined: weights are literals, and the code is there four times, once a stage."""
    folder = _folder("scalar_inlined" if inlined else "scalar_called", case)
    text = '#define PEER_INLINED\n#include "constants.h"\n' if inlined else '#include "rk4.h"\n'
    values = np.concatenate([_flat(layers) for layers in case.networks.values()])
    weight = [_literal(value) for value in values] if inlined else [f"peer_weights[{k}]" for k in range(values.size)]
    at = 0
    for name, layers in case.networks.items():
        lines, signals = [], ["input"]
        for k, (w, b) in enumerate(layers):
            bias = at + w.size
            for row in range(b.size):
                lines.append(f"float s{k}_{row} = {weight[bias + row]};")
                for column, signal in enumerate(signals):
                    lines.append(f"s{k}_{row} += {weight[at + row * len(signals) + column]} * {signal};")
                if k < len(layers) - 1:
                    lines.append(f"s{k}_{row} = (s{k}_{row} > 0.0F) ? s{k}_{row} : 0.0F;")
            signals = [f"s{k}_{row}" for row in range(b.size)]
            at = bias + b.size
        kind = "static inline __attribute__((always_inline)) " if inlined else ""
        body = "\n    ".join([*lines, f"return {signals[0]};"])
        text += f"{kind}float peer_{name}(float input)\n{{\n    {body}\n}}\n"
    (folder / "scalar.c").write_text(text + ('#include "rk4.h"\n' if inlined else ""))
    name = "scalarised, literals, 4 stages inlined" if inlined else "scalarised, weights in an array, rates called"
    return Peer(name, folder, [folder / "scalar.c"])


PEERS: dict[str, Callable[[Case], Peer]] = {
    "textbook": textbook,
    "cmsis_dsp": cmsis_dsp,
    "emlearn": emlearn,
    "casadi_sx": lambda case: casadi(case, "SX", False),
    "casadi_sx_fmaxf": lambda case: casadi(case, "SX", True),
    "casadi_sx_called_fmaxf": lambda case: casadi(case, "SX, called", True),
    "casadi_mx": lambda case: casadi(case, "MX", False),
    "casadi_mx_fmaxf": lambda case: casadi(case, "MX", True),
    "scalar_called": lambda case: scalar(case, False),
    "scalar_inlined": lambda case: scalar(case, True),
}


# -- packages ---------------------------------------------------------------------------------------------------------


def _pip(*arguments: str) -> None:
    PLACE.mkdir(parents=True, exist_ok=True)
    done = subprocess.run(
        [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check", *arguments], capture_output=True, text=True
    )
    if done.returncode != 0:
        raise SystemExit(f"bench: pip {arguments[0]} failed: {done.stderr.strip().splitlines()[-1]}; is the package index reachable?")


def _package(name: str) -> Any:
    """A Python package of PACKAGES, installed beside the project's environment, not into it."""
    site = PLACE / "site"
    if not (site / name.split(".")[0]).exists():
        _pip("install", "--no-deps", "--target", str(site), *PACKAGES)
    if str(site) not in sys.path:
        sys.path.append(str(site))
    with np.errstate():  # some change what numpy does about underflow
        return importlib.import_module(name)
