"""The model as plain data: the contents of a model file in SI units."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from .errors import ModelError as ModelError
from .networks import Network

METHODS = ("euler", "heun", "rk4", "ros1", "ros2")
INTERPOLATIONS = ("held", "linear", "parabola", "cubic")
OUTSIDE = ("extrapolate", "clamp", "fade")
MORE_PIECES = ("refuse", "layers")
OUT_OF_RANGE = ("report", "clamp", "hold")
ON_DAMAGE = ("report", "hold", "rollback")
GROUND = "ground"


@dataclass(frozen=True)
class Parameter:
    """A physical constant. `value` is in SI; `tolerance` is relative (how well it is known): 0 if none is stated or it is `exact`,
    infinite if it is unknown."""

    name: str
    value: float
    unit: str
    tolerance: float = 0.0
    tunable: bool = False
    description: str = ""
    exact: bool = False  # the file vouches for it


@dataclass(frozen=True)
class Input:
    """A measured signal that drives the model. `noise` is the standard deviation of its measurement, SI."""

    name: str
    unit: str
    minimum: float | None = None
    maximum: float | None = None
    noise: float = 0.0
    description: str = ""


@dataclass(frozen=True)
class Body:
    """A mass that moves along one axis; its two states are `position` [m] and `velocity` [m/s]. A `rotational` one turns about it: then
    `mass` names its inertia [kg*m^2], and its states are an angle [rad] and its rate [rad/s]."""

    name: str
    mass: str
    position: str
    velocity: str
    start: tuple[float, float] = (0.0, 0.0)
    rotational: bool = False

    @property
    def unit(self) -> str:
        """Unit of its position."""
        return "rad" if self.rotational else "m"


@dataclass(frozen=True)
class Point:
    """A linear combination of positions, inputs and earlier points, with parameters as coefficients; elements may act on it."""

    name: str
    text: str
    unit: str = "m"


@dataclass(frozen=True)
class Sampled:
    """What an actuator makes of the samples of an input, or of an earlier one of its kind: a `delay` by, or a value `held` for `time`
    [s], a whole number of samples; or a `slew_limit`, which follows by at most `rate` [of its unit per s]."""

    name: str
    source: str
    law: str
    time: float
    unit: str
    rate: float = 0.0


@dataclass(frozen=True)
class Element:
    """A force between two ends (bodies, points, position inputs or ground): deflection s = z_a - z_b, positive force pulls."""

    name: str
    ends: tuple[str, str]
    law: str
    arguments: dict[str, str] = field(default_factory=dict)  # argument of the law -> parameter
    network: str = ""
    network_inputs: tuple[str, ...] = ()
    expression: str = ""

    def state(self, name: str) -> str:
        """The model's name for a state of this element's law."""
        return f"{self.name}_{name}"


@dataclass(frozen=True)
class State:
    """A state that is not mechanical; an equation, or the law of an element, gives der(name)."""

    name: str
    unit: str
    start: float = 0.0
    description: str = ""


@dataclass(frozen=True)
class Variable:
    """An algebraic unknown of the plain equations."""

    name: str
    unit: str


@dataclass(frozen=True)
class Equation:
    """`left = right` between parameters, inputs, states, variables and networks."""

    name: str
    text: str


@dataclass(frozen=True)
class Signal:
    """An output or a sensor: an expression, its unit and, for a sensor, the standard deviation of its noise (SI)."""

    name: str
    expression: str
    unit: str
    noise: float = 0.0
    description: str = ""
    trial_bound: float | None = None  # how far a new set may lead it from the running one in its trial, SI


@dataclass(frozen=True)
class Promises:
    """What every set must keep of a network F of one input, in SI (inc/penode/pen_promise.h). None: not promised."""

    increasing: bool = False
    decreasing: bool = False
    dissipative: float | None = None  # F(v) v >= -dissipative |v|
    max_slope: float | None = None
    max_force: float | None = None
    zero_at_zero: bool = False

    def __bool__(self) -> bool:
        return self != Promises()


@dataclass(frozen=True)
class NetworkPort:
    """What a network stands for: names and units of its inputs and of its output, and what is promised of it."""

    name: str
    input_units: tuple[str, ...]
    output_unit: str
    description: str = ""
    promises: Promises = Promises()


@dataclass(frozen=True)
class ParameterSet:
    """One choice of all that is tunable: a trained network for each port, and values for the tunable parameters."""

    name: str
    id: int
    networks: dict[str, Network]
    parameters: dict[str, float]


@dataclass(frozen=True)
class Guard:
    """What the C does about inputs and sets that are not as they should be; `trial`: samples that a new set is tried on, 0: none."""

    out_of_range: str = "report"
    on_damage: str = "report"
    trial: int = 0


@dataclass(frozen=True)
class FilterSensor:
    """A sensor that the filter uses: standard deviation of its noise, SI; above `gate` standard deviations it is refused, None: never."""

    name: str
    noise: float
    gate: float | None = None


@dataclass(frozen=True)
class FilterState:
    """A state of the model in the filter, SI: standard deviation at the start, and of the disturbance within one second; bounds."""

    name: str
    start: float
    noise: float = 0.0
    least: float | None = None
    most: float | None = None


@dataclass(frozen=True)
class FilterInput:
    """An input as a state of the filter, SI: `noise` is the standard deviation at the start, and `step` that of the change in each sample
    to `decay` times the last value. Of a `measured` one the state is the error of its measurement, else the input itself."""

    name: str
    noise: float
    step: float
    decay: float
    measured: bool


@dataclass(frozen=True)
class FilterParameter:
    """A tunable parameter as a state of the filter, SI: standard deviation at the start, and of what each sample adds; bounds. It starts
    where the set that the filter starts with has it."""

    name: str
    start: float
    step: float
    least: float
    most: float


@dataclass(frozen=True)
class FilterLimit:
    """A sum of the states of the filter that stays within bounds: coefficients by name (the largest is 1 or -1) and bounds."""

    name: str
    text: str
    unit: str
    least: float | None
    most: float | None
    coefficients: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Filter:
    """Contents of [filter]: an extended Kalman filter beside the step (inc/penode/pen_ekf.h)."""

    sensors: tuple[FilterSensor, ...]
    states: tuple[FilterState, ...]  # all states of the model, in their order
    inputs: tuple[FilterInput, ...]
    limits: tuple[FilterLimit, ...]
    parameters: tuple[FilterParameter, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its states."""
        return (*(s.name for s in self.states), *(i.name for i in self.inputs), *(p.name for p in self.parameters))


@dataclass(frozen=True)
class MonitorCause:
    """A change that is watched for: of parameters by name, SI, signs included."""

    name: str
    changes: dict[str, float]


@dataclass(frozen=True)
class Monitor:
    """Contents of [monitor]: tests on the innovations of the filter (inc/penode/pen_monitor.h). `mean_time` between false alarms [s], at
    least; `spread`: factor on the standard deviation of innovations that the test for anything else is made for."""

    mean_time: float
    spread: float
    causes: tuple[MonitorCause, ...]


@dataclass(frozen=True)
class Model:
    """A checked model. All values are SI; `digest` identifies the files it was read from."""

    name: str
    description: str
    sample_time: float
    method: str
    substeps: int
    interpolation: str
    outside: str
    fade_width: float
    pieces: int  # room for the straight pieces of a folded network; 0: evaluate layer by layer
    more_pieces: str
    parameters: dict[str, Parameter]
    inputs: tuple[Input, ...]
    bodies: tuple[Body, ...]
    elements: tuple[Element, ...]
    extra_states: tuple[State, ...]
    variables: tuple[Variable, ...]
    equations: tuple[Equation, ...]
    networks: dict[str, NetworkPort]
    outputs: tuple[Signal, ...]
    sensors: tuple[Signal, ...]
    sets: dict[str, ParameterSet]
    path: Path
    digest: str
    guard: Guard = Guard()
    set_owner: str = ""  # the model whose sets these are, if it is another
    points: tuple[Point, ...] = ()
    sampled: tuple[Sampled, ...] = ()
    filter: Filter | None = None
    monitor: Monitor | None = None

    @property
    def owner(self) -> str:
        """The model that the sets are named after: several methods of one model share them."""
        return self.set_owner or self.name

    @property
    def stepped(self) -> str:
        """The model that the filter steps: if it estimates parameters, one in which they are inputs (algebra/augmented.py)."""
        return f"{self.name}_augmented" if self.filter and self.filter.parameters else self.name

    def fits(self, step: float) -> bool:
        """Are its delays and holds whole numbers of steps [s]?"""
        return all(abs(s.time / step - round(s.time / step)) < 1e-6 for s in self.sampled)

    @property
    def drives(self) -> tuple[Input | Sampled, ...]:
        """The signals that drive the equations: inputs, then those of actuators that work on samples."""
        return (*self.inputs, *self.sampled)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of all states: positions, velocities, then the others."""
        return tuple(b.position for b in self.bodies) + tuple(b.velocity for b in self.bodies) + tuple(s.name for s in self.extra_states)

    @property
    def start(self) -> tuple[float, ...]:
        """Initial values of `states`, SI."""
        return tuple(b.start[0] for b in self.bodies) + tuple(b.start[1] for b in self.bodies) + tuple(s.start for s in self.extra_states)

    @property
    def tunable(self) -> tuple[Parameter, ...]:
        """The parameters that are part of every set, in the order of the model file."""
        return tuple(p for p in self.parameters.values() if p.tunable)
