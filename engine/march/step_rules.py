"""The steps that a march must take whatever its accuracy, and what is refused where the study fixes fewer.

Three rules: a conditionally stable scheme stays inside its limit; the highest mode under a moving mass must not
resonate with the march (the alias rule, mechanics section 7.2); no step is longer than a period of a contact on its
spring. With the mass held by nothing and the contact by the kept modes alone, spring k swings at
omega_c^2 = k (1/m + 1/m_c),  1/m_c = mu/(1 + m_w mu),  mu = largest sum of phi^2 along the track: no frequency of the
coupled scene exceeds (omega_N^2 + sum omega_c^2)^1/2. A body on its contacts has sum v^2, its own mobility there, in
place of 1/m. Where a step is many contact periods long, the tie is as good as rigid at position level and the march may
grow: measured at omega_c h = 200, 6e5 times per passage with average acceleration, 2.8e3 times with HHT-alpha -0.02, at
most 1.4 with -0.05, whose steps may be longer. Up to omega_c h = 2 pi it was 1.3 at most.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from engine.kernels.schemes import damps_contacts, is_damped
from engine.model.lane_table import moving_mass
from results_schema.arrays import Array, Counts

if TYPE_CHECKING:
    from engine.kernels.schemes import Scheme
    from engine.model.scene_model import SceneModel
    from engine.model.ties import CarriageTie, SpringTie
    from engine.scene.variants import VariantValues


SOFT = 0.25  # of the highest frequency of the bodies' modes: springs raise it by 3 % at most, within LIMIT_MARGIN
#: Of a contact on its spring, in a step: 64 undamped scenes, marched by HHT-alpha -0.05 with omega_c h of 16 to 6,000,
#: had the largest forces of fine marches within 0.9 %.
MOST_PERIODS = 300
FREE_STEPS = 200  # per first period of free vibration where the study fixes the steps: 8e-5 of phase a period
LIMIT_MARGIN = 1.05  # a conditionally stable scheme stays this far inside its limit, which a mass on it lowers a little
# Steps must be so many times the alias rule's. Right above the rule average acceleration still grows by up to 1.23 per
# passage in narrow bands, conditionally stable schemes by 10 to 7000; from here on by 1.12 or less (rarely 1.18).
LEAST_MARGIN = 1.1
MOST_STEPS = 100_000_000  # over one passage or cycle: a variant of so many takes minutes
SLOWEST = 200  # steps per first period that a study whose steps are open must be able to take within that
LIGHT = 1e-3  # of the modal masses where it rides: the waves of a lighter mass are those of its weight
ALIAS_CELL = 0.01  # of a time scale: the alias rule is solved once for variants that are no further apart


def least_steps(model: SceneModel, values: VariantValues) -> Array:
    """(V,) the fewest steps per unit of scene time that a march may take whatever its accuracy: inside the scheme's
    stability limit, by the alias rule, and none longer than a period of a contact on its spring."""
    scale = values.scene_time_scale
    found = np.asarray(LIMIT_MARGIN * float(model.omega.max()) * scale / model.scheme.stability_limit)
    found = np.maximum(found, LEAST_MARGIN * _alias(model, scale))
    found = np.maximum(found, LIMIT_MARGIN * pulsation_steps(model, values))
    if model.springs:
        found = np.maximum(found, contact_steps(model, values))
        found = np.maximum(found, limit_with_springs(model, values))
    return found


def pulsation_steps(model: SceneModel, values: VariantValues) -> Array:
    """(V,) steps of which two make a period of the fastest pulsating force, and with which it is within the limit of
    the scheme, and its coordinate takes no mass; 0 without any."""
    fastest = _fastest(model, values)
    limit = min(math.pi, model.scheme.oscillator_limit, model.scheme.scaled_from)
    return np.asarray(model.scheme.stride * fastest * values.scene_time_scale / limit)


def between_stations(model: SceneModel, values: VariantValues, steps: int) -> Array:
    """(V,) by which part of itself a peak of what pulsating forces swing may exceed the stations beside it with so many
    steps per unit of scene time, (Omega h)^2/8: other marches may have the same stations. 0 without any."""
    return np.asarray((_fastest(model, values) * values.scene_time_scale / steps) ** 2 / 8.0)


def _fastest(model: SceneModel, values: VariantValues) -> Array:
    """(V,) rad/s of the fastest pulsating force; 0 without any."""
    found = np.zeros(values.size)
    for number in model.pulsating:
        found = np.maximum(found, values.pulsation(model.carriages[number].name)[1])
    return found


def _alias(model: SceneModel, scale: Array) -> Array:
    """(V,) steps of the alias rule, of time scales rounded up: they rise with it."""
    if is_damped(model.scheme):
        return np.zeros_like(scale)
    cells, inverse = np.unique(np.ceil(np.log(scale) / ALIAS_CELL), return_inverse=True)
    return np.asarray(alias_steps(model, np.exp(ALIAS_CELL * cells))[inverse.reshape(-1)])


def free_steps(model: SceneModel) -> int:
    """Steps per first period of free vibration, after the last carriage."""
    return max(FREE_STEPS, math.ceil(free_limit(model)))


def free_limit(model: SceneModel) -> float:
    """The least of them within a scheme's limit; springs that are soft beside the modes have that of the modes."""
    limit = model.scheme.oscillator_limit if model.springs else model.scheme.stability_limit
    return LIMIT_MARGIN * float(model.omega.max()) * 2.0 * math.pi / model.first_omega / limit


def alias_steps(model: SceneModel, time_scale: Array) -> Array:
    """(V,) least steps per passage or cycle of the alias rule for the masses that ride on their bodies; 0 without any.

    A mass sees the highest mode's wave pass at k_N s' while the scheme turns that mode by its own phase; together they
    must stay below half a turn per step, k_N s' h + phase(omega_N h) < pi, else the march may resonate with itself.
    For average acceleration that is k_N s' h < 2 atan(2/(omega_N h)) (mechanics section 7.2).
    """
    found = np.zeros_like(time_scale)
    joined = {spring.carriage for spring in model.springs if spring.rigid}
    for number, carriage in enumerate(model.carriages):
        if carriage.inertia != "force" or number in joined:
            body = model.bodies[carriage.body].modal
            sides = [body.sides[push.direction].wave_number for push in model.pushes if push.carriage == number]
            wave = float(np.max([body.wave_number, *sides])) * carriage.rider.top_speed
            found = np.maximum(found, _alias_root(model.scheme, wave, float(body.omega.max()) * time_scale))
    return model.scheme.stride * found


def pace_of_waves(model: SceneModel, values: VariantValues) -> Array:
    """(V,) the largest speed of a mass that rides over the phase speed of its body's highest wave that is kept,
    v k_N/omega_N: of a uniform beam speed over critical speed and number of modes; 0 of masses that move nothing."""
    found = np.zeros(values.size)
    for number, carriage in enumerate(model.carriages):
        body = model.bodies[carriage.body].modal
        if carriage.inertia != "force" and body.omega.any():
            wave = float(np.max(body.wave_number)) * carriage.rider.top_speed
            own = wave / (float(body.omega.max()) * values.scene_time_scale)
            heavy = moving_mass(model, values, number) * body.mobility > LIGHT
            found = np.where(heavy, np.maximum(found, own), found)
    return found


def _alias_root(scheme: Scheme, wave: float, angle: Array) -> Array:
    """(V,) steps n at which wave/n + phase(angle/n) = pi, found once: a march, its reference and its audit all ask."""
    return np.frombuffer(_alias_roots((scheme, wave, angle.tobytes())))


@lru_cache(maxsize=256)
def _alias_roots(asked: tuple[Scheme, float, bytes]) -> bytes:
    """The same of bytes: the left side falls with n, so bisection finds the root."""
    scheme, wave, angle = *asked[:2], np.frombuffer(asked[2])
    low, high = np.zeros_like(angle), np.full_like(angle, 60.0)
    for _ in range(60):
        middle = 0.5 * (low + high)
        steps = np.exp(middle)
        short = wave / steps + scheme.phase(angle / steps) >= math.pi
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    return np.exp(high).tobytes()


def allow_any_steps(model: SceneModel, values: VariantValues, steps: Counts) -> None:
    """In place of `check_steps` where accuracy is not the question."""


def _check_limit(model: SceneModel, time_scale: Array, steps: Array | Counts) -> None:
    limit = model.scheme.stability_limit
    highest = float(model.omega.max())
    found = highest * float(np.max(time_scale / steps))
    if found > limit:
        raise model.study.source.fault(
            "solver.steps",
            "the step is beyond the scheme's stability limit",
            expected=f"omega h <= {limit:.4g} with the highest mode kept ({highest:.4g} rad/s)",
            received=f"omega h = {found:.4g}",
            remedy=f'{_enough(model, time_scale)}, steps = "auto", or scheme = "average-acceleration"',
        )


def _check_alias(model: SceneModel, time_scale: Array, steps: Array | Counts) -> None:
    slowest = _slowest(time_scale, steps)
    least, steps = LEAST_MARGIN * alias_steps(model, time_scale[slowest]), steps[slowest]
    worst = int(np.argmax(least / steps))
    if least[worst] > steps[worst]:
        raise model.study.source.fault(
            "solver.steps",
            "too few steps for the highest mode under a moving mass: the march could resonate with itself and grow",
            expected=f"at least {math.ceil(float(least[worst]))} steps over a passage or cycle (the alias rule)",
            received=str(int(steps[worst])),
            remedy=f'{_enough(model, time_scale)}, steps = "auto", fewer modes, or scheme = "hht-alpha" with '
            "alpha = -0.05, which damps it",
        )


def _slowest(time_scale: Array, steps: Array | Counts) -> Counts:
    """The slowest variant of each number of steps, which needs most of them by any rule."""
    order = np.lexsort((time_scale, steps))
    return order[np.flatnonzero(np.append(np.diff(steps[order]) != 0, True))]


def _enough(model: SceneModel, time_scale: Array) -> str:
    """A number of steps that these two rules refuse for no variant."""
    inside = float(model.omega.max()) * time_scale / model.scheme.stability_limit
    enough = LIMIT_MARGIN * float(np.max(np.maximum(inside, LEAST_MARGIN * alias_steps(model, time_scale))))
    stride = model.scheme.stride
    return f"steps = {stride * math.ceil(enough / stride)} or more"


def check_even_steps(model: SceneModel, steps: Counts) -> None:
    """Refuse a number of steps that a Richardson pair cannot halve. Raises BadInput."""
    odd = steps[steps % model.scheme.stride != 0]
    if odd.size:
        raise model.study.source.fault(
            "solver.steps",
            "a Richardson pair halves the number of steps",
            expected="an even number",
            received=str(int(odd[0])),
            remedy=f"steps = {int(odd[0]) + 1}",
        )


def check_slowest(model: SceneModel, values: VariantValues) -> None:
    """Refuse variants so slow that no march could resolve them. Raises BadInput."""
    periods = values.scene_time_scale * model.first_omega / (2.0 * math.pi)
    check_most_steps(model, SLOWEST * periods)


def check_most_steps(model: SceneModel, steps: Array | Counts) -> None:
    """Refuse step counts beyond the cap (fault 13), by the number that makes them where one stands out. Raises
    BadInput."""
    if not steps.size or float(np.max(steps)) <= MOST_STEPS:
        return
    for doubt in model.study.doubts():
        values = {key: model.study.value(key) for key in doubt.needs}
        if not doubt.met(values):
            raise model.study.source.fault(
                doubt.where,
                f"{doubt.what}, and its march would take {float(np.max(steps)):.2g} steps",
                expected=doubt.expected,
                received=doubt.amount(values),
                remedy=doubt.meant(values),
            )
    frequency = model.first_omega / (2.0 * math.pi)
    raise model.study.source.fault(
        "solver.steps",
        "too many steps over one passage or cycle",
        expected=f"at most {MOST_STEPS}",
        received=f"{float(np.max(steps)):.3g}, with a first natural frequency of {frequency:.3g} Hz",
        remedy="look at the units of the body and of the motion; or a larger tolerance, a faster motion, larger steps",
    )


def contact_omega(model: SceneModel, values: VariantValues) -> Array:
    """(V,) rad/s: omega_c of all springs, the root of the sum of squares; 0 without any."""
    return np.sqrt(sum((_contact_square(model, values, one) for one in model.springs), np.zeros(values.size)))


def contact_steps(model: SceneModel, values: VariantValues) -> Array:
    """(V,) steps none of which is longer than a period of a contact on its spring, or than so much of it that a scheme
    that damps still does not grow."""
    turn = 2.0 * math.pi * (MOST_PERIODS if damps_contacts(model.scheme) else 1)
    return np.asarray(model.scheme.stride * contact_omega(model, values) * values.scene_time_scale / turn)


def _contact_square(model: SceneModel, values: VariantValues, spring: SpringTie) -> Array:
    if spring.rigid:
        return np.zeros(values.size)
    body = model.bodies[spring.body].modal
    mobility, stiffness = body.mobility, values.column(spring.keys.stiffness)
    if spring.held is not None:
        held = model.bodies[spring.held.body]
        above = spring.held.fixed_row(held.modal) ** 2 @ values.mobility(held.name, held.modal.omega.size)
        return np.asarray(stiffness * (above + mobility))
    contact = mobility / (1.0 + values.touching_mass(model.carriages[spring.carriage].name) * mobility)
    return np.asarray(stiffness * (1.0 / values.column(spring.keys.mass) + contact))


def check_steps(model: SceneModel, values: VariantValues, steps: Counts) -> None:
    """Refuse fixed steps (V,) that cannot be right: beyond the scheme's stability limit (fault 12), too few for the
    alias rule where the scheme does not damp enough, or longer than a contact's period. Raises BadInput with limit and
    suggestion."""
    time_scale = values.scene_time_scale
    _check_limit(model, time_scale, steps)
    if not is_damped(model.scheme):
        _check_alias(model, time_scale, steps)
    if model.pulsating:
        least = pulsation_steps(model, values)
        _refuse(model, least, steps, "a step is longer than half a period of a pulsating force")
    if not model.springs:
        return
    check_free_vibration(model, values)
    least = limit_with_springs(model, values) / LIMIT_MARGIN
    _refuse(model, least, steps, "the step is beyond the scheme's stability limit")
    most = f"{MOST_PERIODS} periods" if damps_contacts(model.scheme) else "a period"
    what = f"a step is longer than {most} of the contact on its spring: the march could grow"
    _refuse(model, contact_steps(model, values), steps, what)


def vibrates_freely(carriage: CarriageTie) -> bool:
    """Whether a carriage leaves free vibration behind."""
    return carriage.rider.motion.free_vibration > 0.0


def are_soft(model: SceneModel, values: VariantValues) -> bool:
    """Whether springs are so soft in all variants that the steps of free vibration, which follow from the bodies' modes
    alone, are within a scheme's limit."""
    return not model.springs or float(contact_omega(model, values).max()) <= SOFT * float(model.omega.max())


def check_free_vibration(model: SceneModel, values: VariantValues) -> None:
    """Refuse free vibration with springs that are not soft by a conditionally stable scheme. Raises BadInput."""
    if math.isinf(model.scheme.oscillator_limit) or are_soft(model, values):
        return
    for carriage in model.carriages:
        if vibrates_freely(carriage):
            what = "free vibration with springs as stiff needs a scheme that is stable with any step"
            remedy = 'scheme = "average-acceleration"'
            raise model.study.source.fault(f"carriage.{carriage.name}.motion.after", what, expected="0", remedy=remedy)


def limit_with_springs(model: SceneModel, values: VariantValues) -> Array:
    """(V,) steps with which the coupled scene stays inside the scheme's limit; none where that has no limit.

    No frequency is above (omega_N^2 + omega_c^2)^1/2, and of modes that take mass none above ``scaled_from``/h.
    """
    limit, springs = model.scheme.oscillator_limit / LIMIT_MARGIN, contact_omega(model, values)
    fewest = np.hypot(float(model.omega.max()), springs) / limit
    if math.isfinite(model.scheme.scaled_from):
        fewest = np.minimum(fewest, springs / math.sqrt(limit**2 - model.scheme.scaled_from**2))
    return np.asarray(fewest * values.scene_time_scale)


def _refuse(model: SceneModel, least: Array, steps: Counts, what: str) -> None:
    worst = int(np.argmax(least / steps))
    if least[worst] > steps[worst]:
        stride = model.scheme.stride
        enough = stride * math.ceil(LIMIT_MARGIN * float(least.max()) / stride)
        raise model.study.source.fault(
            "solver.steps",
            what,
            expected=f"at least {math.ceil(float(least[worst]))} steps over a passage or cycle",
            received=str(int(steps[worst])),
            remedy=f'steps = {enough} or more, or steps = "auto"',
        )
