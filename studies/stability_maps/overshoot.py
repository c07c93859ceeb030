"""How far does a scheme overshoot in its first steps when the step is long? An undamped oscillator, deflected."""

from __future__ import annotations

import numpy as np

from results_schema.arrays import Array
from results_schema.lazy_imports import xr
from results_schema.variable import outputs
from studies.protocol.parts import Work
from studies.results.formatting import listed, number
from studies.stability_maps.map_scene import Ground, MapScene
from studies.stability_maps.mapping import Asked, Map, dataset_of
from studies.stability_maps.methods import LABELS, METHODS, Method

FIRST_STEPS = 20
FREQUENCY_STEPS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)  # omega h
NOTABLE = 2.0
LONG, LONGER = 20.0, 100.0  # omega h of the sentences

OUTPUTS = outputs("""
    * | | | optional alone |
    overshoot_step | | | axis | omega h
        natural frequency times the time step
    displacement_overshoot | scheme overshoot_step | | nan | overshoot in displacement
        largest over the first, of an undamped oscillator released at rest, over its first 20 steps; NaN beyond the
        scheme's limit
    velocity_overshoot | scheme overshoot_step | | nan | overshoot in velocity
        largest over omega times the first displacement, of an undamped oscillator released at rest, over its first 20
        steps; NaN beyond the scheme's limit
""")


def compute(ground: Ground, asked: Asked, work: Work) -> xr.Dataset:
    """One mode of the body, without the mass, by every scheme."""
    x = np.array(FREQUENCY_STEPS)
    found = []
    for method in METHODS:
        work.check()
        peaks = overshoot(ground.passage(1, method.table), method, x)
        found.append(np.where(x < method.limit, peaks, np.nan))
    displacement, velocity = np.moveaxis(np.array(found), 1, 0)
    values = {"displacement_overshoot": displacement, "velocity_overshoot": velocity}
    along = {"scheme": list(LABELS), "overshoot_step": x}
    return dataset_of(OUTPUTS, along, values, (1, FIRST_STEPS))


def overshoot(scene: MapScene, method: Method, x: Array) -> Array:
    """(2, n) largest displacement over the first, and velocity over omega times it, at omega h = x (n,)."""
    from engine.methods.transition import held_transitions

    frozen, values = scene.frozen(scheme=method.scheme), scene.oscillators(x.size)
    step = x / scene.model.first_omega
    marched = [held_transitions(frozen, values, step, steps)[:, :, 0] for steps in range(1, FIRST_STEPS + 1)]
    return np.asarray(np.abs(np.array(marched)).max(axis=0).T)


def sentences(dataset: xr.Dataset) -> list[str]:
    """The schemes that overshoot most, in displacement at omega h = 20 and in velocity at 100."""
    far = _beyond(dataset["displacement_overshoot"].sel(overshoot_step=LONG))
    fast = _beyond(dataset["velocity_overshoot"].sel(overshoot_step=LONGER))
    return [
        f"Overshoot: stable is not harmless. Let an oscillator go that is far too fast for the step. At omega h = "
        f"{number(LONG)} {far} its first deflection; at omega h = {number(LONGER)} {fast} the velocity that it should "
        f"ever have. All other schemes stay below {number(NOTABLE)} times."
    ]


def _beyond(values: xr.DataArray) -> str:
    """The schemes that overshoot notably, the worst first."""
    found = sorted(zip(values.values.tolist(), values["scheme"].values.tolist(), strict=True), reverse=True)
    high = [f"{label} goes to {number(value)} times" for value, label in found if value > NOTABLE]
    return listed(high) if high else f"no scheme goes beyond {number(NOTABLE)} times"


MAP = Map(
    "overshoot",
    "how far schemes overshoot in their first steps",
    lambda asked: 0.17 * asked.fineness,
    OUTPUTS,
    compute,
    sentences,
)
