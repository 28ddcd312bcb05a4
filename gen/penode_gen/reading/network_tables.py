# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Networks of a model file: their ports, the sets with a file for each, and whether they can be folded."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from .. import model as m, units
from ..algebra import expressions as ex
from ..networks import Network, NetworkError
from ..sets import promises
from ..sets.fold import foldable, pieces, room
from ..sets.packing import network_pieces
from .network_files import read_network
from .places import show
from .tables import Tables
from .untrained import untrained

UNKNOWN = "?"  # stands for a unit that was missing: no second complaint where it is used
ROOM = 4096  # pieces of a folded network, at most


class NetworkTables(Tables):
    """Reads [networks] and [sets]."""

    def __init__(self, path: Path):
        super().__init__(path)
        self.files: dict[Path, Network | None] = {}
        self.unsure: set[str] = set()  # networks whose declaration is at fault

    def networks(self) -> Iterable[tuple[str, m.NetworkPort]]:
        for name, entry in self.section("networks").items():
            where = ("networks", name)
            inputs = entry.get("inputs", [])
            if not inputs or not all(isinstance(u, str) for u in inputs):
                if "inputs" in entry:
                    self.problem((*where, "inputs"), "must list the unit of each input", 'write inputs = ["m"]')
                self.unsure.add(name)
                inputs = []
            for unit in (*inputs, entry.get("output")):
                if self.unit(where, unit) != 1.0:
                    self.problem(
                        where,
                        f"a network in {unit}: networks take and give SI values",
                        f"declare {units.si(unit)}, and scale in the network",
                    )
            output = entry.get("output", UNKNOWN)
            made = m.Promises() if name in self.unsure or output == UNKNOWN else promises.read(where, entry, inputs, output, self.problem)
            yield name, m.NetworkPort(name, tuple(inputs), output, entry.get("description", ""), made)

    def folds(self, head: dict[str, Any], sets: dict[str, m.ParameterSet]) -> None:
        """Check that there is something to fold, and room for it."""
        where, given = ("model", "pieces"), room(min(head["pieces"], ROOM))
        if given == 0 or not sets:
            return
        if head["outside"] == "fade":
            self.problem(
                where, "a network that fades is not piecewise linear", "choose outside = 'extrapolate' or 'clamp', or leave pieces out"
            )
        elif not any(foldable(net) for net in sets["default"].networks.values()) and len(sets["default"].networks) == len(
            self.data.get("networks", {})
        ):
            self.problem(where, "no network has one input and only ReLU activations", "leave pieces out")
        elif head["more_pieces"] == "refuse":
            for chosen in sets.values():
                for name, net in chosen.networks.items():
                    need = pieces(net, head["outside"] == "clamp") if foldable(net) else 0
                    if need > given:
                        remedy = f"give room for {need} or more, or choose more_pieces = 'layers'"
                        self.problem(where, f"{name} of set '{chosen.name}' has {need} straight pieces", remedy)

    def sets(self, parameters: dict[str, m.Parameter], networks: dict[str, m.NetworkPort], masses: set[str]) -> dict[str, m.ParameterSet]:
        tunable = {p.name: p for p in parameters.values() if p.tunable}
        entries = self.entries("sets")
        required = networks if "default" in entries else ()
        if networks and "default" not in entries and isinstance(self.data.get("sets", {}), dict):
            self.problem(("sets",), "there is no set 'default'", "add [sets.default] with a file for each network")
        allowed = dict.fromkeys(networks, (str, dict)) | dict.fromkeys(tunable, str)
        sets: dict[str, m.ParameterSet] = {}
        files: dict[str, Network | None] = dict.fromkeys(networks)  # of the set 'default', which the others build on
        values = {p.name: p.value for p in tunable.values()}
        upper: dict[str, str] = {}
        for number, (name, entry) in enumerate(({"default": {}} | entries).items(), 1):
            where = ("sets", name)
            self.label(where, name)
            if upper.setdefault(name.upper(), name) != name:
                self.problem(where, f"differs from the set '{upper[name.upper()]}' by case only", "rename one")
            own = self.table(where, allowed, entry, required if name == "default" else ())
            own_files = {n: self.network(where, n, own[n], networks[n]) for n in networks if n in own}
            own_values = {n: self.quantity((*where, n), own[n], p.unit) for n, p in tunable.items() if n in own}
            for n in masses & set(own_values):
                if own_values[n] <= 0.0:
                    self.problem((*where, n), f"mass {show(own[n])} is not above zero", "give a positive mass")
            if name == "default":
                files, values = files | own_files, values | own_values
            sets[name] = m.ParameterSet(
                name, number, {n: net for n, net in (files | own_files).items() if net is not None}, values | own_values
            )
            for n, net in own_files.items():
                first = files[n]
                if net is not None and first is not None and net.architecture != first.architecture:
                    self.problem(
                        (*where, n), "has another architecture than in the set 'default'", "train the same layers: sets share one code"
                    )
        return sets

    def untrained(self, where: tuple[str, ...], name: str, entry: dict[str, Any], port: m.NetworkPort) -> Network | None:
        """A network that has a shape only; None after reporting a problem."""
        entry = self.table(where, {"layers": list, "activation": str}, entry, ("layers",))
        try:
            return untrained(entry, len(port.input_units), name) if port.input_units else None
        except NetworkError as error:
            self.problem(where, str(error), "see [sets] in gen/README.md")
            return None

    def network(self, where: tuple[str, ...], name: str, entry: str | dict[str, Any], port: m.NetworkPort) -> Network | None:
        """The network file of one port, with its trust envelope; None after reporting a problem."""
        where = (*where, name)
        if isinstance(entry, str):
            entry = {"file": entry}
        if "layers" in entry:
            return self.untrained(where, name, entry, port)
        entry = self.table(where, {"file": str, "min": list, "max": list}, entry, ("file",))
        if "file" not in entry:
            return None
        path = self.place(where)[0].parent / entry["file"]
        if path not in self.files:
            try:
                self.files[path] = read_network(path)
                self.digest.update(path.read_bytes())
            except NetworkError as error:
                self.problem(where, str(error), "see [sets]")
                self.files[path] = None
            except (OSError, ValueError) as error:
                self.problem(where, f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})", "correct the path")
                self.files[path] = None
            found = self.files[path]
            for layer in found.layers if found else ():  # weights may lie in files of their own
                for numbers in (v for v in vars(layer).values() if isinstance(v, np.ndarray)):
                    self.digest.update(numbers.tobytes())
        network = self.files[path]
        if network is None or port.name in self.unsure:
            return None
        if network.n_inputs != len(port.input_units) or network.n_outputs != 1:
            self.problem(
                where,
                f"{path.name} has {network.n_inputs} input(s) and {network.n_outputs} output(s), "
                f"declared are {len(port.input_units)} and 1",
                "correct [networks] or the file",
            )
            return None
        remedy = "give min and max, one number for each input, or write them into the file"
        for key in ("min", "max"):
            if not all(isinstance(v, (int, float)) and not isinstance(v, bool) and ex.in_range(v) for v in entry.get(key, [])):
                self.problem((*where, key), "is not a list of numbers that a float can hold", remedy)
                return None
        try:
            network = replace(network, input_min=entry.get("min", network.input_min), input_max=entry.get("max", network.input_max))
        except NetworkError as error:
            self.problem(where, str(error), remedy)
            return None
        with np.errstate(over="ignore"):
            envelope, *layers = [p.values.astype(np.float32) for p in network_pieces(network)]
        if not all(np.isfinite(values).all() for values in (envelope, *layers)):
            self.problem(where, f"{path.name} has a number that a float cannot hold", "train or export the network again")
            return None
        if not (envelope[: network.n_inputs] < envelope[network.n_inputs :]).all():
            self.problem(where, "the trained range is narrower than a float can tell", remedy)
            return None
        return network
