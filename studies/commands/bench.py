"""Throughput of the march that `run` uses, on a fixed scene, so that machines and versions can be compared."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from engine.batch.execution import march_seconds, warm_up
from engine.batch.plan import make_plan
from engine.march.step_rules import allow_any_steps
from engine.scene.settings import ALL_SCHEMES
from engine.scene.study import Study
from results_schema.cores import cores
from results_schema.errors import BadInput

BEST_OF = 7
MOST_REPEATS = 20
TIMED_SECONDS = 0.5  # about that long is each timing, so that starting threads does not count
MIDSPAN = "midspan"
LEAST_SPEED, MOST_SPEED = 1.0, 20.0  # m/s
INSIDE = 1.1  # so much smaller than the stability limit is the largest omega h
LENGTH = 15.0  # m
FLEXURAL_SPEED = (2.1e11 * 8.33e-6 / (7850.0 * 0.01)) ** 0.5  # (E I/rho A)^1/2, m^2/s
PARAMETERS: Mapping[str, Mapping[str, float]] = {
    "newmark": {"beta": 0.3025, "gamma": 0.6},
    "hht-alpha": {"alpha": -0.05},
    "generalized-alpha": {"rho_inf": 0.8},
}


@dataclass(frozen=True)
class Scene:
    """Size of the fixed scene: a mass crosses the pinned beam of DLR 2012, section 2.3, in `steps` steps; or several,
    one behind another at equal distances, all of them on the beam from the first step to the last.

    ties: how many masses. Mass 10-500 kg in all, speed 1-20 m/s and damping 0-5 % of the variants are random with
    seed 0. The slowest are left out where the scheme would leave its stability limit, since numbers that blow up take
    time of their own.
    """

    modes: int = 10
    steps: int = 1000
    variants: int = 16384
    scheme: str = "average-acceleration"
    ties: int = 1

    def study(self) -> Study:
        """The scene as a study whose variants are listed one by one."""
        random = np.random.default_rng(0)
        carriages = self.carriages()
        speeds, masses = ([f"carriage.{name}.{key}" for name in carriages] for key in ("motion.speed", "mass"))
        axes = {
            "speed": (speeds, random.uniform(self.least_speed(), MOST_SPEED, self.variants)),
            "mass": (masses, random.uniform(10.0, 500.0, self.variants) / self.ties),
            "damping_ratio": ("body.beam.damping_ratio", random.uniform(0.0, 0.05, self.variants)),
        }
        return Study(
            kind="passage",
            gravity=9.81,
            body={"beam": _BEAM | {"modes": self.modes}},
            carriage=carriages,
            sensor={MIDSPAN: {"body": "beam", "at": 7.5, "quantity": "displacement"}},
            sweep={"zip": True} | {name: {"of": path, "values": values} for name, (path, values) in axes.items()},
            solver={"steps": self.steps, "static_correction": False, "scheme": self.scheme, **self.parameters},
            output={"histories": "none"},
        )

    def carriages(self) -> dict[str, dict[str, Any]]:
        """The masses; each goes as far as puts the first one at the end of the beam."""
        apart = LENGTH / (self.ties + 1)
        motions = [{"start": i * apart, "end": (i + 2) * apart} for i in range(self.ties)]
        return {
            f"mass_{i + 1}": _CARRIAGE | {"motion": {"kind": "cruise", "speed": 10.0, **motion}}
            for i, motion in enumerate(motions)
        }

    @property
    def parameters(self) -> Mapping[str, float]:
        """Of the scheme."""
        return PARAMETERS.get(self.scheme, {})

    def least_speed(self) -> float:
        """m/s; raises BadInput for an unknown scheme, and where none is slow enough for the scheme's limit."""
        if self.scheme not in ALL_SCHEMES:
            expected = f"one of {', '.join(ALL_SCHEMES)}"
            raise BadInput("no such scheme", where="--scheme", expected=expected, received=self.scheme)
        limit = ALL_SCHEMES[self.scheme](self.parameters).stability_limit
        highest = (self.modes * np.pi / LENGTH) ** 2 * FLEXURAL_SPEED
        least = max(LEAST_SPEED, INSIDE * highest * LENGTH / (self.steps * limit))
        if least >= MOST_SPEED:
            what, where = "the highest mode is too fast for the scheme at every speed of the scene", "--scheme"
            raise BadInput(what, where=where, expected=f"omega h <= {limit:.4g}", remedy="more steps or fewer modes")
        return float(least)


_BEAM = {
    "kind": "beam",
    "length": LENGTH,
    "area": 0.01,
    "second_moment": 8.33e-6,
    "youngs_modulus": 2.1e11,
    "density": 7850.0,
    "supports": "pinned-pinned",
}
_CARRIAGE = {
    "on": "beam",
    "kind": "mass",
    "mass": 100.0,
}


@dataclass(frozen=True)
class Throughput:
    """The best of several marches of the whole scene; compiling, tabulating and gathering are left out."""

    case_mode_steps_per_second: float
    variants_per_second: float
    seconds: float
    modes: int
    steps: int
    variants: int
    threads: int
    best_of: int
    scheme: str
    ties: int


def measure(scene: Scene, threads: int | None = None, best_of: int = BEST_OF) -> Throughput:
    """March the scene several times and take the best; threads: None takes all cores."""
    plan = make_plan(scene.study(), check_steps=allow_any_steps)
    warm_up(plan)
    threads = threads or cores()
    repeats = min(max(1, round(TIMED_SECONDS * threads / plan.seconds)), MOST_REPEATS)
    seconds = min(march_seconds(plan, threads, repeats) for _ in range(best_of))
    rate = scene.variants / seconds
    return Throughput(
        case_mode_steps_per_second=rate * scene.modes * scene.steps,
        variants_per_second=rate,
        seconds=seconds,
        threads=threads,
        best_of=best_of,
        **asdict(scene),
    )
