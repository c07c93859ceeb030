"""The scene on which all maps stand, in the numbers that the theory speaks of, and what the real march does to it.

Masses are parts of the body's mass, speeds parts of omega_1 L/pi, frequencies parts of omega_1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from engine.model.lane_table import padded
from engine.scene.variants import VariantValues
from results_schema.arrays import Array, Counts, Mask

if TYPE_CHECKING:
    from engine.march.march import Marched
    from engine.march.tables import SceneTables
    from engine.methods.comparison import ComparisonScheme
    from engine.methods.transition import Frozen
    from engine.model.scene_model import SceneModel
    from engine.scene.carriages import Carriage
    from engine.scene.study import Study
    from studies.protocol.parts import Work

CARRIAGE = "load"
AVERAGE: Mapping[str, Any] = {"scheme": "average-acceleration"}
GROWS = 1e-6  # beyond 1: what rounding cannot do


@dataclass(frozen=True, eq=False)
class Ground:
    """The body and the carriage of a study, from which maps make scenes of their own."""

    study: Study

    @property
    def body(self) -> str:
        """Name of the body that the carriage rides on."""
        return self._carriage.on

    @property
    def is_pinned(self) -> bool:
        """Whether the closed forms for a beam pinned at both ends hold."""
        return self.study.body[self.body].is_simply_supported

    @property
    def length(self) -> float:
        """Length of the track, m."""
        return self.study.body[self.body].length

    @property
    def is_loose(self) -> bool:
        """Whether nothing holds the body."""
        return self._own.leading_body.modal.rigid_modes > 0

    @property
    def modes(self) -> int:
        """Modes that the study gives the body; 0 where it leaves them open."""
        modes = self.study.body[self.body].modes
        return 0 if modes == "auto" else int(modes)

    @property
    def damping_ratio(self) -> float:
        """The body's damping ratio."""
        return float(self.study.value(f"body.{self.body}.damping_ratio"))

    @property
    def mass_ratio(self) -> float:
        """The carriage's mass over the body's."""
        return self._carriage.moving_mass / self._own.leading_body.modal.mass

    @property
    def speed_ratio(self) -> float:
        """The carriage's speed over omega_1 L/pi."""
        speed = float(self.study.value(f"carriage.{next(iter(self.study.carriage))}.motion.speed"))
        return speed * math.pi / (self._own.first_omega * self.length)

    @property
    def weight(self) -> float:
        """The carriage's weight, N."""
        return self._carriage.weight(self.study.gravity)

    @property
    def _carriage(self) -> Carriage:
        return next(iter(self.study.carriage.values()))

    @cached_property
    def _own(self) -> SceneModel:
        from engine.model.scene_model import build_model

        return build_model(self.study, {}, {})

    def passage(self, modes: int, solver: Mapping[str, Any] = AVERAGE) -> MapScene:
        """A mass that crosses the body from end to end."""
        return self._scene(modes, {"kind": "cruise", "start": 0.0, "end": self.length, "speed": 1.0}, solver)

    def shuttle(self, modes: int, solver: Mapping[str, Any] = AVERAGE) -> MapScene:
        """A mass that swings once over the whole body, s = L/2 + L/2 sin(Om t)."""
        half = 0.5 * self.length
        motion = {"kind": "sinusoidal", "centre": half, "amplitude": half, "frequency": 1.0, "cycles": 1}
        return self._scene(modes, motion, solver)

    def _scene(self, modes: int, motion: Mapping[str, Any], solver: Mapping[str, Any]) -> MapScene:
        from engine.model.scene_model import build_model
        from engine.scene.study import Study

        study = Study(
            kind="passage",
            gravity=self.study.gravity,
            body={self.body: self.study.data["body"][self.body] | {"modes": modes}},
            carriage={CARRIAGE: {"on": self.body, "kind": "mass", "mass": 1.0, "motion": dict(motion)}},
            solver={"static_correction": False} | dict(solver),  # theory is of the kept modes
        )
        return MapScene(study, build_model(study, {}, {}))


@dataclass(frozen=True, eq=False)
class MapScene:
    """One scene of a map: a mass on the body, the variants' numbers in lanes."""

    study: Study
    model: SceneModel

    @cached_property
    def speed_unit(self) -> float:
        """omega_1 L/pi, m/s."""
        return self.model.first_omega * self.model.leading_body.modal.length / math.pi

    def values(self, mass: Array, pace: Array | None = None, damping: Array | None = None) -> VariantValues:
        """Variants (V,) with masses over the body's, speeds over omega_1 L/pi or frequencies over omega_1, and damping
        ratios."""
        key = f"carriage.{CARRIAGE}"
        columns = {f"{key}.mass": mass * self.model.leading_body.modal.mass}
        if pace is not None and self.study.carriage[CARRIAGE].motion.pace == "speed":
            columns[f"{key}.motion.speed"] = pace * self.speed_unit
        elif pace is not None:
            columns[f"{key}.motion.frequency"] = pace * self.model.first_omega / (2.0 * math.pi)
        if damping is not None:
            columns[f"body.{self.model.leading_body.name}.damping_ratio"] = damping
        return VariantValues(self.study, columns, mass.size)

    def oscillators(self, size: int) -> VariantValues:
        """So many variants without mass and damping: the modes alone."""
        nothing = np.zeros(size)
        return self.values(nothing, damping=nothing)

    def growth(self, steps: int, values: VariantValues) -> Array:
        """(V,) spectral radius of one passage or period in so many steps."""
        from engine.methods.transition import spectral_radius, transitions

        return spectral_radius(transitions(self._tables(steps), values))

    def march(self, steps: int, values: VariantValues, work: Work, sampled: Counts | None = None) -> Marched:
        """One passage from rest under the weight, V variants; signals and samples are of the contact force alone."""
        from engine.march.march import march

        tables, lanes = self.laid_out(steps, values)
        counts = np.zeros(0, dtype=np.int64) if sampled is None else sampled
        return march(tables, lanes, counts, values.size, work.halted, sampled=1)

    def laid_out(self, steps: int, values: VariantValues) -> tuple[SceneTables, VariantValues]:
        """Tables of so many steps, and the variants filled up to whole blocks of lanes."""
        lanes = padded(np.arange(values.size))
        columns = {path: column[lanes] for path, column in values.columns.items()}
        return self._tables(steps), VariantValues(values.study, columns, lanes.size)

    def step_growth(self, values: VariantValues, step: Array, steps: int = 1, **held: Any) -> Array:
        """(V,) spectral radius of one step (V,) in s, or several, the mass held at midspan; held: as of `frozen`."""
        from engine.methods.transition import spectral_radius, step_matrices

        return spectral_radius(step_matrices(self.frozen(**held), values, step, steps))

    def multipliers(self, values: VariantValues, step: Array, **held: Any) -> NDArray[np.complex128]:
        """(V, M) what one step (V,) in s multiplies the motions by, the mass held at midspan; held: as of `frozen`.
        All infinite where the march overflows."""
        from engine.methods.transition import step_matrices

        matrices = step_matrices(self.frozen(**held), values, step)
        finite = np.asarray(np.isfinite(matrices).all(axis=(-2, -1)))[:, None]
        found = np.linalg.eigvals(np.where(finite[..., None], matrices, 0.0)).astype(np.complex128)
        return np.where(finite, found, np.inf)

    def frozen(self, advance: float = 0.0, scheme: ComparisonScheme | None = None) -> Frozen:
        """The mass held at midspan with the terms of a speed of ``advance`` m per step, by the scene's own scheme or by
        one that is offered for comparison."""
        from engine.methods.transition import Frozen, FrozenCompared

        place = 0.5 * self.model.leading_body.modal.length
        if scheme is None:
            return Frozen(self.model, place, advance)
        return FrozenCompared(self.model, place, advance, scheme=scheme)

    def _tables(self, steps: int) -> SceneTables:
        from engine.march.tables import SceneTables

        return SceneTables(self.model, steps, "whole")


def threshold(grows: Callable[[Array], Mask], low: float, high: float) -> float:
    """The value between low > 0 and high at which something begins to grow, to nine digits; NaN where it does not.

    grows: says so for 15 values at once, which a march has lanes for.

    >>> round(threshold(lambda x: x > 2.0, 0.1, 100.0), 8)
    2.0
    """
    if not grows(np.array([high]))[0]:
        return math.nan
    while high / low > 1.0 + 1e-9:
        inner = np.geomspace(low, high, 17)[1:-1]
        first = int(np.argmax(np.append(grows(inner), True)))
        edges = np.array([low, *inner, high])
        low, high = float(edges[first]), float(edges[first + 1])
    return high
