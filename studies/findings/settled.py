"""How fast the start dies out of what goes to and fro, which variants have settled by the last cycle, and how far these
differ forward and backward."""

from typing import Annotated

import numpy as np
from pydantic import Field, Strict

from engine.methods.cycle_growth import GROWS, growth_per_cycle
from engine.study_file.spec import Spec
from engine.study_file.units import Dimensionless
from results_schema.arrays import Array, Counts, Mask
from results_schema.status import Fidelity
from studies.findings import theory
from studies.protocol.study import question_of
from studies.results.findings_common import in_words
from studies.results.formatting import counted, number, percent
from studies.results.kept import kept
from studies.results.places import chosen, extreme
from studies.results.results import Results

BASIS = 12  # modes of the body, of whose vibrations with mass and dampers the slowest decay counts
SLOW = 6  # eigenvalues of these, the smallest: three vibrations, of which the third swings by a hundredth of the first
FAR_ABOVE = 2.0  # times the static value, or parts of its range: what vibrates so much may grow from cycle to cycle
MOST_GROWING = 128  # variants of which that is asked: some milliseconds, two seconds where each has a scene of its own
SHOWN = 3  # sensors, of many, that sentences and figures are about
MOST = 1000  # different bodies, masses and dampers in a sweep, an eighth of a second; of more no decay is known
PLACES = 65  # along the way, at the heaviest of which the mass stands: there the vibration dies out the slowest
#: Of keys of swept numbers, with the end of their range at which a variant settles last.
ENDS = (
    (".motion.speed", np.min, "from {} on"),
    (".motion.frequency", np.min, "from {} on"),
    (".damping_ratio", np.max, "up to {}"),
)


def decay_rates(results: Results) -> Array:
    """1/s, for every variant; NaN where dampers damp the body in a way that is not known here.

    Without dampers zeta_1 omega_1/(1 + m phi_1^2), phi_1 at the place of the way where it is largest.
    """
    zeta, first = (results.everywhere(v) for v in (theory.damping_ratio(results), theory.first_omega(results)))
    mass, dampers = _mass(results), [(at, results.everywhere(rate)) for at, rate in theory.dampers(results)]
    omega, shapes = theory.elastic_modes(results, results.carriage.motion.path(np.linspace(0.0, 1.0, PLACES)).S)
    heaviest = shapes[np.abs(shapes[:, 0]).argmax(), :BASIS]
    alone = zeta * first / (1.0 + mass * heaviest[0] ** 2)
    damped = sum((rate for _, rate in dampers), np.zeros(results.shape)) > 0.0
    if not damped.any():
        return np.asarray(alone)
    columns = np.stack([part.reshape(-1) for part in (zeta, first, mass, *(rate for _, rate in dampers))], axis=1)
    rows, own = np.unique(columns, axis=0, return_inverse=True)
    if len(rows) > MOST or any(isinstance(at, str) for at, _ in dampers):
        return np.where(damped, np.nan, alone)
    held = theory.elastic_modes(results, np.array([float(at) for at, _ in dampers]))[1][:, :BASIS]
    found = np.array([_slowest(row, omega[:BASIS], heaviest, held) for row in rows])
    return np.where(damped, found[own.reshape(-1)].reshape(results.shape), alone)


def remainder_of_start(results: Results) -> Array:
    """Part of the vibration of the start that is left in the last cycle of a motion to and fro, for every variant; NaN
    where that is not known, infinite where it grows from cycle to cycle."""
    return np.where(growth(results) > GROWS, np.inf, _died_out(results))


def _died_out(results: Results) -> Array:
    """The same as if nothing grew."""
    return np.asarray(np.exp(-decay_rates(results) * theory.cycle_time(results) * (theory.cycles(results) - 1.0)))


@kept
def growth(results: Results) -> Array:
    """By how much the vibration grows from cycle to cycle, in the sweep's shape, of the variants whose start has not
    died out, or which are far above statics or diverged: of many those furthest above; NaN elsewhere."""
    asked, found = _doubted(results)[:MOST_GROWING], np.full(results.size, np.nan)
    found[asked] = growth_per_cycle(results.study, asked)
    return found.reshape(results.shape)


def _doubted(results: Results) -> Counts:
    """Flat numbers of these variants, the furthest above statics first."""
    above = next(name for name in ("dynamic_amplification", "odd_rms") if name in results.dataset)
    gains = [results.everywhere(results.of_sensor(above, name)) for name in results.sensors]
    gain = np.where(results.kept.values, np.max(np.nan_to_num(gains), axis=0), np.inf).ravel()
    doubted = (gain > FAR_ABOVE) | (_died_out(results).ravel() > results.study.solver.tolerance)
    doubted &= ~np.isin(results.dataset["fidelity_used"].values.ravel(), (Fidelity.STATIC, Fidelity.FORCE))
    furthest = np.argsort(-gain, kind="stable")
    return np.asarray(furthest[doubted[furthest]])


def told_growing(results: Results) -> list[str]:
    """In how many variants the vibration grows from cycle to cycle, by how much and where; nothing where in none."""
    factor = growth(results)
    grows, place = factor > GROWS, extreme(factor)
    if place is None or not grows.any():
        return []
    asked = min(_doubted(results).size, MOST_GROWING)
    of = f", of {asked} that were looked at," if asked < _doubted(results).size else ""
    most = f"up to {number(float(factor[place]), 4)}" if np.isfinite(factor[place]) else "very many"
    who = f"In {int(grows.sum()):,} of {counted(results.size, 'variant')}{of} the vibration grows"
    return [
        f"{who}: after each cycle it is {most} times what it was (the largest Floquet multiplier"
        f"{in_words(results, place)}), as the mass that goes to and fro shakes its body. What is said of these depends "
        "on how many cycles are marched, and no number of cycles settles them; more damping, another mass or another "
        "frequency may."
    ]


def _slowest(row: Array, frequencies: Array, heaviest: Array, held: Array) -> float:
    """The slowest decay of (1 + m phi phi^T) q'' + (2 zeta omega + sum c psi psi^T) q' + omega^2 q = 0."""
    zeta, first, mass, *dampers = row
    omega, N = frequencies * first / frequencies[0], frequencies.size
    inertia = np.eye(N) + mass * np.outer(heaviest, heaviest)
    damping = np.diag(2.0 * zeta * omega) + held.T @ (np.array(dampers)[:, None] * held)
    state = np.zeros((2 * N, 2 * N))
    state[:N, N:] = np.eye(N)
    state[N:] = -np.linalg.solve(inertia, np.concatenate([np.diag(omega**2), damping], axis=1))
    values = np.linalg.eigvals(state)
    return float(-values[np.argsort(np.abs(values))[:SLOW]].real.max())


def _mass(results: Results) -> Array:
    """kg that move with the track, for every variant; none of what is sprung."""
    name, parts = results.carriage_name, results.carriage.touching
    found = (results.everywhere(results.parameter(f"carriage.{name}.{part}")) for part in parts)
    return sum(found, np.zeros(results.shape))


class Asked(Spec):
    """The table [question]. odd_rms: parts of the static range, of which is told where the odd part exceeds them."""

    odd_rms: Annotated[tuple[Annotated[Dimensionless, Field(gt=0)], ...], Strict(False), Field(min_length=1)] = (
        0.01,
        0.05,
    )


def thresholds(results: Results) -> tuple[float, ...]:
    """What the question names of the odd part, ascending."""
    return tuple(sorted(question_of(results.study, Asked).odd_rms))


def settled(results: Results) -> Mask:
    """The variants, in the sweep's shape, of whose start no more is left in the last cycle than the smallest odd part
    that is asked for, or of which that is not known."""
    return np.asarray(~(remainder_of_start(results) > thresholds(results)[0]))


def odd_parts(results: Results) -> Array:
    """(..., sensor) the odd part where a variant has settled, or everywhere if none has; NaN elsewhere."""
    odd = np.asarray(results.dataset["odd_rms"].transpose(*results.dims, "sensor").values, dtype=np.float64)
    fine = settled(results)
    return np.where(fine[..., None], odd, np.nan) if fine.any() else odd


def shown_sensors(results: Results) -> list[str]:
    """The sensors that sentences and figures are about, in the order of the file: all, or of many the one whose two
    ways differ most and others, evenly spread."""
    sensors, odd = list(results.sensors), odd_parts(results).reshape(-1, len(results.sensors))
    found = list(chosen(sensors, SHOWN))
    if len(sensors) > SHOWN and np.isfinite(odd).any():
        most = sensors[int(np.argmax(np.nan_to_num(odd, nan=-1.0).max(axis=0)))]
        found = found if most in found else [found[0], found[-1], most]
    return [name for name in sensors if name in found]


def where_late(results: Results, late: Mask) -> str:
    """From which speed on and up to which damping ratio variants have not settled, in brackets."""
    said = list[str]()
    for ending, pick, words in ENDS:
        axis = results.axis(ending)
        if axis is not None:
            value = float(pick(results.everywhere(results.dataset[axis.name])[late]))
            said.append(words.format(f"{axis.noun} {axis.in_words(value)}"))
    return f" ({', '.join(said)})" if said else ""


def told_unsettled(results: Results) -> list[str]:
    """How many marched variants still carry more of the vibration of the start in their last cycle than the study's
    tolerance, and with how many cycles they would not; nothing where none is known to."""
    left, held = remainder_of_start(results), results.study.solver.tolerance
    late = (left > held) & np.isfinite(left) & (results.dataset["fidelity_used"].values != int(Fidelity.STATIC))
    if not late.any():
        return []
    most, part, cycles = float(left[late].max()), left[late], theory.cycles(results)[late]
    known = bool(((cycles > 1.0) & (part < 1.0)).all())
    enough = float(np.max(1.0 + (cycles - 1.0) * np.log(held) / np.log(part))) if known else np.inf
    advice = f"{np.ceil(enough):,.0f} cycles would be enough" if known else "more cycles, or damping, help"
    told = f"of the start's vibration is left in the last cycle{where_late(results, late)}"
    return [
        f"In {int(late.sum()):,} of {counted(results.size, 'variant')} more than {percent(held)} {told}: what is "
        f"said of these includes it, at most {percent(most)} of it; {advice}."
    ]
