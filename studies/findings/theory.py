"""Closed forms that figures and findings compare with, for every variant of a sweep (mechanics.md, 7 and 9)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from engine.model.scene_model import PROBED, UNFELT, SceneModel
from results_schema.arrays import Array
from results_schema.lazy_imports import interpolate, xr
from studies.results.results import Results

CYCLE_POINTS = 720
ORDERS = (2, 4, 6, 8)  # harmonics that a shuttle about the middle excites
ONE_PEAK = 1 / 8
NEARLY = 0.01  # of the length: what counts as the middle
MOSTLY = 0.5  # of a deflection: more than all other modes together
LONG_SWING = 0.45  # of the length: an amplitude that reaches the ends
_PLACES = ("centre", "amplitude")


def first_omega(results: Results) -> xr.DataArray | float:
    """Lowest elastic natural frequency (rad/s) of the first carriage's body, over the axes that change that body."""
    recorded = results.recorded(results.carriage.on)
    if recorded is not None:
        stored = recorded["first_frequency"]
        found = 2.0 * math.pi * stored.values
        return xr.DataArray(found, dims=stored.dims) if stored.dims else float(found)
    axes = [axis for axis in results.axes if any(_changes_modes(results, path) for path in axis.paths)]
    dims = list(dict.fromkeys(axis.dim for axis in axes))
    if not dims:
        return results.base_model.first_omega
    sizes = [len(results.dataset[dim]) for dim in dims]
    omega = np.empty(sizes)
    for place in np.ndindex(*sizes):
        index = dict(zip(dims, place, strict=True))
        changed = {path: value for a in axes for path, value in a.columns(index[a.dim]).items()}
        omega[place] = _model(results, changed).first_omega
    return xr.DataArray(omega, dims=dims)


def damping_ratio(results: Results) -> Any:
    """Damping ratio of that mode: one for all modes, the first of a list, or Rayleigh's a/(2 omega) + b omega/2."""
    key = f"body.{results.carriage.on}.damping_ratio"
    body = results.study.body[results.carriage.on]
    if body.rayleigh is not None and not _is_swept(results, key):
        omega = first_omega(results)
        mass, stiffness = (results.parameter(f"{key}.rayleigh.{i}") for i in (0, 1))
        return 0.5 * (mass / omega + stiffness * omega)
    if body.modal_ratios and not _is_swept(results, key):
        return results.parameter(f"{key}.{min(_rigid_modes(results), len(body.modal_ratios) - 1)}")
    return results.parameter(key)


def lag(results: Results, sensor: str) -> Any:
    """The lag in m that damping alone causes at low speed, -2 zeta v/omega_1 at a fixed place.

    Under the carriage it is half of that: there w = phi(s) q, of which q alone is late, and with w_s = phi^2 q_0 the
    odd part -(2 zeta v/omega_1) phi phi' q_0 is half as much of dw_s/ds.
    """
    speed = results.parameter(f"carriage.{results.carriage_name}.motion.speed")
    damping = damping_ratio(results) + dampers_ratio(results)
    told = -lag_factor(results, sensor) * damping * speed / first_omega(results)
    return told if lag_is_known(results) else np.nan * told


def lag_is_known(results: Results) -> bool:
    """Whether the first elastic mode alone tells what is late, and what its dampers do to it."""
    damped = [at for at, rate in dampers(results) if np.any(rate > 0.0)]
    unknown = any(isinstance(at, str) for at in damped)
    swept = any(_changes_modes(results, path) and not path.endswith(".damping") for path in _swept(results))
    return first_mode_bears(results) and not unknown and not (damped and swept)


def dampers_ratio(results: Results) -> Any:
    """What dampers at places of the track add to the damping ratio of the first mode, sum c phi_1^2/(2 omega_1)."""
    held = [(at, rate) for at, rate in dampers(results) if not isinstance(at, str) and np.any(rate > 0.0)]
    if not held:
        return 0.0
    first = elastic_modes(results, np.array([at for at, _ in held]))[1][:, 0]
    added = [rate * shape**2 for (_, rate), shape in zip(held, first, strict=True)]
    return sum(added) / (2.0 * first_omega(results))


def dampers(results: Results) -> list[tuple[float | str, Any]]:
    """Places of the dampers under the first carriage's body, and their coefficients, N s/m."""
    name = results.carriage.on
    found = results.study.body[name].dampers()
    return [(at, results.parameter(f"body.{name}.{key}")) for key, at, _ in found]


def first_mode_bears(results: Results) -> bool:
    """Whether the first elastic mode bears most of what the first carriage's weight deflects under it, without sweep:
    the first of a frame may be a sway that hardly moves its track."""
    recorded = results.recorded(results.carriage.on)
    if recorded is not None:
        omega, shapes = 2.0 * np.pi * recorded["frequency"].values, recorded["mode_shape"].values.T
    else:
        modal = results.base_model.leading_body.modal
        omega, shapes = modal.omega, modal.shape(np.linspace(0.0, modal.length, PROBED))
    elastic = omega > 0.0
    borne = np.mean(shapes[:, elastic] ** 2, axis=0) / omega[elastic] ** 2
    felt = np.flatnonzero(borne > UNFELT**2 * borne.max())
    return bool(borne[felt[0]] > MOSTLY * borne.sum())


def lag_factor(results: Results, sensor: str) -> int:
    """2 for a sensor at a fixed place, 1 under or on a carriage."""
    spec, riding = results.study.sensor[sensor], {other.riding_body for other in results.study.carriage.values()}
    return 2 if spec.rides is None and spec.body not in riding else 1


def lag_formula(results: Results, sensor: str) -> str:
    """The formula in words."""
    twice = "2 × " if lag_factor(results, sensor) == 2 else ""
    more = ", of the first mode with its dampers" if any(np.any(rate > 0.0) for _, rate in dampers(results)) else ""
    return f"what damping alone gives ({twice}damping ratio × speed / first circular frequency{more})"


def frequency_ratio(results: Results) -> Any:
    """Cycles per second of the first carriage's motion over the body's first natural frequency."""
    return 2.0 * math.pi * cycle_frequency(results) / first_omega(results)


def cycle_frequency(results: Results) -> Any:
    """Cycles per second of the first carriage's motion."""
    motion, key = results.carriage.motion, f"carriage.{results.carriage_name}.motion"
    if motion.pace == "frequency":
        return results.parameter(f"{key}.frequency")
    return results.parameter(f"{key}.speed") / motion.max_speed


def cycles(results: Results) -> Array:
    """How many cycles every variant runs."""
    return _of_motion(results, "cycles")[0]


def cycle_time(results: Results) -> Array:
    """How long a cycle takes, s, for every variant."""
    if results.study.carriage[results.carriage_name].motion.pace == "frequency":
        (frequency,) = _of_motion(results, "frequency")
        return 1.0 / frequency
    start, end, speed, turn = _of_motion(results, "start", "end", "speed", "turn")
    return np.asarray(2.0 * ((math.pi - 2.0) * turn + 1.0) * np.abs(end - start) / speed)


def _of_motion(results: Results, *names: str) -> list[Array]:
    """Numbers of the carriage's motion for every variant."""
    keys = (f"carriage.{results.carriage_name}.motion.{name}" for name in names)
    return [results.everywhere(results.parameter(key)) for key in keys]


def loaded_frequency(results: Results, mass_ratio: Array) -> Array:
    """First natural frequency (n,) with the carriage's mass on its way, over that without, for mass ratios (n,).

    omega_eff = omega_1 (1 + m <phi_1^2>)^(-1/2), the mean taken over the cycle; for a shuttle about the middle of a
    pinned beam <phi_1^2> is (1 + J0(2 pi a/L)) over the beam's mass.
    """
    tau = np.arange(CYCLE_POINTS) / CYCLE_POINTS
    first = elastic_modes(results, results.carriage.motion.path(tau).S)[1][:, 0]
    mass = body_mass(results, results.carriage.on)
    return np.asarray((1.0 + mass_ratio * mass * float(np.mean(first**2))) ** -0.5)


def body_mass(results: Results, name: str) -> float:
    """Mass of a body without sweep, kg."""
    from engine.bodies.build import build_body

    recorded = results.recorded(name)
    return float(build_body(results.study.body[name]).mass if recorded is None else recorded["mass"])


def moves_away(results: Results) -> bool:
    """Whether nothing holds the first carriage's body fully."""
    return _rigid_modes(results) > 0


def _rigid_modes(results: Results) -> int:
    """Number of rigid-body modes of the first carriage's body."""
    recorded = results.recorded(results.carriage.on)
    if recorded is not None:
        return int(np.count_nonzero(recorded["frequency"].values == 0.0))
    return results.base_model.leading_body.modal.rigid_modes


def elastic_modes(results: Results, places: Array) -> tuple[Array, Array]:
    """omega (N,), rad/s, of the first carriage's body without sweep, and its shapes (S, N) at places (S,) of its track,
    kg^(-1/2); without motions as a rigid body."""
    recorded = results.recorded(results.carriage.on)
    if recorded is None:
        modal = results.base_model.leading_body.modal
        return modal.omega[modal.rigid_modes :], modal.shape(places, 0)[:, modal.rigid_modes :]
    omega = 2.0 * np.pi * recorded["frequency"].values
    shapes = interpolate.CubicSpline(along_track(recorded), recorded["mode_shape"].values, axis=1)(places)
    return omega[omega > 0.0], shapes[omega > 0.0].T


def along_track(body: xr.Dataset) -> Array:
    """Places (S,), m, of the mode shapes that an archive holds of a body: their last dimension, whatever its name."""
    return np.asarray(body[body["mode_shape"].dims[-1]].values)


def breakdown(results: Results, mass_ratio: Array, order: int) -> Array:
    """Frequency ratios (n,) at which the `order`-th harmonic of the cycle meets the loaded frequency."""
    return loaded_frequency(results, mass_ratio) / order


def shuttle_amplification(results: Results, sensor: str) -> Array | None:
    """1 + (2.5 + 8.1 mu)(Omega/omega_1)^2 for every variant; None unless a mass swings about the middle of a pinned
    beam from one end to the other and the sensor is at midspan."""
    body, motion = results.study.body[results.carriage.on], results.carriage.motion
    ratio = results.dataset.coords.get("mass_ratio")
    swept = _swept(results)
    fixed = {f"body.{results.carriage.on}.length", *(f"carriage.{results.carriage_name}.motion.{k}" for k in _PLACES)}
    if ratio is None or swept & fixed or not motion.is_harmonic:
        return None
    if results.carriage.masses != ("mass",):  # a spring keeps part of the mass from following
        return None
    if not body.is_simply_supported:
        return None
    at, (low, high) = results.study.sensor[sensor].at, motion.range()
    if at is None or 0.5 * (high - low) < LONG_SWING * body.length:
        return None
    if max(abs(place / body.length - 0.5) for place in (at, 0.5 * (low + high))) > NEARLY:
        return None
    mass = results.everywhere(ratio)
    return np.asarray(1.0 + (2.5 + 8.1 * mass) * results.everywhere(frequency_ratio(results)) ** 2)


def end_spring_difference(results: Results, sensor: str) -> Array | None:
    """(E I/L^3)|1/k_a - 1/k_b| for every variant; None unless a beam stands on two springs at its ends and the sensor
    is at midspan. One peak per slow cycle instead of two where it is above 1/8."""
    name = results.carriage.on
    body, at = results.study.body[name], results.study.sensor[sensor].at
    key = f"body.{name}"
    varied = any(path == f"{key}.length" or path.endswith(".at") for axis in results.axes for path in axis.paths)
    if len(body.springs) != 2 or varied or at is None:
        return None
    ends = sorted(spring.at for spring in body.springs)
    if ends != [0.0, body.length] or abs(at / body.length - 0.5) > NEARLY:
        return None
    if any(spring.rotational for spring in body.springs):
        return None
    first, second = (results.parameter(f"{key}.supports.{i}.stiffness") for i in (0, 1))
    bending: Any = results.parameter(f"{key}.youngs_modulus") * results.parameter(f"{key}.second_moment")
    return results.everywhere(bending / body.length**3 * abs(1.0 / first - 1.0 / second))


def _swept(results: Results) -> set[str]:
    return {path for axis in results.axes for path in axis.paths}


def _is_swept(results: Results, key: str) -> bool:
    return key in _swept(results)


def _changes_modes(results: Results, path: str) -> bool:
    here = f"body.{results.carriage.on}."
    return path.startswith(here) and not path.startswith((f"{here}damping_ratio", f"{here}modes"))


def _model(results: Results, values: dict[str, float]) -> SceneModel:
    from engine.model.scene_model import build_model

    return build_model(results.study.without_sweep().with_values(values), {}, {})
