"""Shapes that swing: small SVG elements without script, animated from one end of the swing to the other (SMIL)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import NDArray

from results_schema.arrays import Array
from studies.pictures.scene_layout import UP, Layout, Placed

WIDTH, LEAST_HEIGHT = 320.0, 110.0  # of a picture, in its own units
PLAYED_WIDTH = 640.0
MARGIN = 12.0
SWING = 0.11  # largest motion over the size of what moves
BLOCK = 0.018  # half a carriage over the same
SIDE, FRONT, PLAN = np.eye(3)[[0, 2]], np.eye(3)[[1, 2]], np.eye(3)[[0, 1]]
SPACE = np.array([[0.883, 0.469, 0.0], [-0.176, 0.331, 0.927]])  # from the right, a third of a right angle above
FEW_POINTS = 400  # that are drawn bold
FLAT, STILL = 1e-6, 1e-4
EASE = 'calcMode="spline" keyTimes="0;.5;1" keySplines=".37 0 .63 1;.37 0 .63 1" dur="2.4s" repeatCount="indefinite"'


@dataclass(frozen=True, eq=False)
class Piece:
    """Something that moves: points (P, 3) and their motion (P, 3) at the end of a swing; dots: not joined by lines."""

    points: Array
    motion: Array
    dots: bool = False


def view_of(points: Array) -> Array:
    """(2, 3) the view that shows a scene: from the side where it lies in one plane, else from above at an angle."""
    extent = np.ptp(points, axis=0)
    if extent[1] <= FLAT * extent.max():
        return SIDE
    return FRONT if extent[0] <= FLAT * extent.max() else SPACE


def view_of_all(shapes: Sequence[Sequence[Piece]]) -> Array:
    """(2, 3) the view that shows every one of several shapes: none moves out of it alone."""
    found = []
    for piece in (piece for pieces in shapes for piece in pieces):
        largest = float(np.abs(piece.motion).max()) or 1.0
        far = np.where(np.abs(piece.motion) > STILL * largest, piece.motion, 0.0) / largest
        found += [piece.points, piece.points + float(np.ptp(piece.points, axis=0).max()) * far]
    return view_of(np.concatenate(found))


def body_pieces(body: Placed, amplitudes: Array) -> Iterator[Piece]:
    """A body that moves by its modes times `amplitudes` (N,)."""
    for line in body.outline.every_line:
        dots = line is body.outline.cloud
        yield Piece(body.at(line.points), line.motion @ amplitudes @ body.turn.T, dots)


def unseen(pieces: Sequence[Piece], largest: float) -> str:
    """Why nothing is seen of a shape: it moves along its own lines alone, or moves none of them, beside what moves by
    so much elsewhere; "" where something is seen."""
    across = along = 0.0
    for piece in pieces:
        if piece.dots or len(piece.points) < 2:
            return ""
        way = np.gradient(piece.points, axis=0)
        way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), np.finfo(float).tiny)
        own = (piece.motion * way).sum(axis=1, keepdims=True)
        across = max(across, float(np.linalg.norm(piece.motion - own * way, axis=1).max()))
        along = max(along, float(np.abs(own).max()))
    if across > STILL * max(along, STILL * largest):
        return ""
    return "along the member: nothing to see across" if along > STILL * largest else "twists: no line moves"


def scene_pieces(scene: Layout, amplitudes: Array) -> list[Piece]:
    """All bodies and carriages by the modes of all bodies and of sprung masses (N,)."""
    model, found = scene.model, list[Piece]()
    for body in scene.bodies.values():
        found += body_pieces(body, amplitudes[body.part.modes])
    size = BLOCK * float(np.ptp(scene.points, axis=0).max())
    for number, tie in enumerate(model.carriages):
        if tie.rides is not None or tie.name not in scene.positions or not model.reacts(number):
            continue
        modal = model.bodies[tie.body].modal
        place = scene.positions[tie.name]
        on = 0.0 <= place <= modal.length
        row = modal.shape([min(max(place, 0.0), modal.length)])[0] * on
        moved = [float(row @ amplitudes[model.bodies[tie.body].modes])]
        sprung = [spring.mode for spring in model.springs_of(number).values() if spring.mode is not None]
        moved += [float(amplitudes[mode]) for mode in sprung]
        for step, down in enumerate(moved):
            found.append(_block(scene.touched(tie.name) + 3.0 * step * size * UP, size, down))
    return found


def _block(foot: Array, size: float, down: float) -> Piece:
    corners = size * np.array([[-1, 0, 0], [1, 0, 0], [1, 0, 2], [-1, 0, 2], [-1, 0, 0]], dtype=np.float64)
    return Piece(foot + corners, np.tile([0.0, 0.0, -down], (5, 1)))


def moving(pieces: Sequence[Piece], view: Array, label: str) -> str:
    """An SVG element in which the pieces swing; grey: at rest."""
    largest = max(float(np.linalg.norm(piece.motion, axis=1).max()) for piece in pieces)
    points = np.concatenate([piece.points for piece in pieces])
    swing = SWING * float(np.ptp(points, axis=0).max()) / (largest or 1.0)
    ends = [[(piece.points + sign * swing * piece.motion) @ view.T for piece in pieces] for sign in (1.0, -1.0, 0.0)]
    every = np.concatenate([line for end in ends for line in end])
    low, high = every.min(axis=0), every.max(axis=0)
    scale = (WIDTH - 2.0 * MARGIN) / max(high[0] - low[0], 0.6 * (high[1] - low[1]))
    height = max(LEAST_HEIGHT, scale * (high[1] - low[1]) + 2.0 * MARGIN)
    middle = 0.5 * (low + high)

    def path(end: list[Array], dots: bool) -> str:
        chosen = [line for line, piece in zip(end, pieces, strict=True) if piece.dots == dots]
        return "".join(_path((line - middle) * [scale, -scale] + [0.5 * WIDTH, 0.5 * height], dots) for line in chosen)

    drawn, thin = [], 1.0 if len(points) <= FEW_POINTS else 0.5
    for dots, width in ((False, 1.6 * thin), (True, 2.6 * thin)):
        out, back, rest = (path(end, dots) for end in ends)
        if rest:
            drawn.append(f'<path class="rest" stroke-width="{0.6 * width:.2f}" d="{rest}"/>')
            swinging = f'<animate attributeName="d" values="{out};{back};{out}" {EASE}/>'
            drawn.append(f'<path class="moving" stroke-width="{width:.2f}" d="{out}">{swinging}</path>')
    box = f'viewBox="0 0 {WIDTH:.0f} {height:.0f}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {box} role="img" aria-label="{label}">{"".join(drawn)}</svg>'


def played(frames: Sequence[Sequence[Array]], marks: Mapping[str, Array], seconds: float, label: str) -> str:
    """An SVG element in which lines (P, 2) go through frames again and again, the grey ones of the first stay; marks:
    places (frames, 2) of names."""
    every = np.concatenate([line for lines in frames for line in lines])
    low, high = every.min(axis=0), every.max(axis=0)
    scale = (PLAYED_WIDTH - 8.0 * MARGIN) / (high[0] - low[0])
    height = scale * (high[1] - low[1]) + 4.0 * MARGIN
    pace = f'dur="{seconds:.2f}s" repeatCount="indefinite"'

    def on_page(points: Array) -> Array:
        return np.asarray((points - low) * [scale, -scale] + [MARGIN, height - 2.0 * MARGIN])

    drawn = []
    for number, line in enumerate(frames[0]):
        drawn.append(f'<path stroke="#c9ced6" stroke-width="0.8" d="{_path(on_page(line), False)}"/>')
        ways = ";".join(_path(on_page(lines[number]), False) for lines in frames[1:])
        moving_line = f'<animate attributeName="d" values="{ways}" {pace}/>'
        drawn.append(f'<path stroke="#0072b2" stroke-width="1.6" d="{ways.split(";")[0]}">{moving_line}</path>')
    for name, places in marks.items():
        ways = ";".join(f"{x:.1f} {y:.1f}" for x, y in on_page(places))
        go = f'<animateTransform attributeName="transform" type="translate" values="{ways}" {pace}/>'
        text = f'<text x="4" y="3" fill="#22272e" stroke="none" font-size="9">{escape(name)}</text>'
        drawn.append(f'<g transform="translate({ways.split(";")[0]})">{go}<circle r="2.2" fill="#d55e00"/>{text}</g>')
    box = f'viewBox="0 0 {PLAYED_WIDTH:.0f} {height:.0f}" font-family="sans-serif"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {box} fill="none" role="img" aria-label="{escape(label)}">'
        f'<rect width="100%" height="100%" fill="#ffffff"/>{"".join(drawn)}</svg>'
    )


def _path(points: NDArray[np.float64], dots: bool) -> str:
    texts = [f"{x:.1f} {y:.1f}" for x, y in points]
    return "".join(f"M{text}h0" for text in texts) if dots else f"M{texts[0]}L{' '.join(texts[1:])}"
