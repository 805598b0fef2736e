"""Blunders with photographs of the laser's spot, and with the dates of records."""

import json
from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from gateway.cli.main import main
from tests.benchmarks.rendered_photographs import Scene, render
from tests.gateway.bench.blunders.faces import Row
from tests.gateway.bench.blunders.session import Session

Pixels = NDArray[np.uint8]


def scene(session: Session) -> Scene:
    """Return a small photograph of a board of 20 mm pitch."""
    draw = session.random.uniform
    return Scene(
        px_per_mm=3.0,
        size_px=(540, 540),
        tilt_deg=(draw(-8, 8), draw(-8, 8)),
        spots=((draw(-40, 40), draw(-45, -25)),),
        blur_px=draw(0.6, 1.0),
        seed=int(session.random.integers(1 << 30)),
    )


def photographs(
    session: Session,
    change: Callable[[Pixels], Pixels] = lambda pixels: pixels,
    *options: str,
    second: Callable[[Scene], Scene] = lambda one: one,
) -> list[str]:
    """Return the command for a zero and a moved spot; the second photograph is the changed one."""
    zero = scene(session)
    moved = second(replace(zero, spots=((zero.spots[0][0] + 2, zero.spots[0][1] + 60),), seed=zero.seed + 1))
    paths = [session.folder / name for name in ("zero.png", "moved.png")]
    for path, pixels in zip(paths, (render(zero), change(render(moved))), strict=True):
        cv2.imwrite(str(path), pixels)
    return ["calibrate", "laser", *map(str, paths), "--pitch-mm", "20", "--dot-mm", "10", *options]


def sound(session: Session) -> list[str]:
    return photographs(session)


def bent(pixels: Pixels) -> Pixels:
    y, x = np.mgrid[: pixels.shape[0], : pixels.shape[1]].astype(np.float32)
    waved = cv2.remap(pixels, x + np.float32(2.0) * np.sin(2 * np.pi * x / 360), y, cv2.INTER_CUBIC)
    return np.asarray(waved).astype(np.uint8)


def in_glare(session: Session) -> list[str]:
    def change(pixels: Pixels) -> Pixels:
        red = cv2.GaussianBlur(pixels[:, :, 2].astype(np.float32) - pixels[:, :, 1], (0, 0), 3)
        y0, x0 = np.unravel_index(int(red.argmax()), red.shape)
        y, x = np.mgrid[: pixels.shape[0], : pixels.shape[1]]
        glare = 600 * np.exp(-((x - x0 - 12) ** 2 + (y - y0) ** 2) / 2 / 9**2)
        return np.asarray(np.clip(pixels + glare[..., None], 0, 255), dtype=np.uint8)

    return photographs(session, change)


def twice(session: Session) -> list[str]:
    command = photographs(session)
    return [*command[:3], command[2], *command[3:]]


def dated(days: int) -> Callable[[Session], list[str]]:
    """Return the drift of a sensor whose record is dated by so many days after the day on which it is judged."""

    def make(session: Session) -> list[str]:
        path = session.folder / "record.json"
        main([*session.rests(session.faces(), "six-position"), "--json", str(path)])
        day = np.datetime64(json.loads(path.read_text())["created_utc"][:10]) - np.timedelta64(days, "D")
        return ["fleet", "drift", str(path), "--on", str(day)]

    return make


ROWS: dict[str, list[Row]] = {
    "laser": [
        ("the same photograph twice", r"same photograph", twice),
        ("a bent board", r"flat", lambda session: photographs(session, bent)),
        ("the spot at the rim of a glare", r"glare|laser spot", in_glare),
        (
            "another lattice stated",
            r"lattice",
            lambda session: photographs(session, lambda pixels: pixels, "--lattice", "7x5"),
        ),
        (
            "the laser off",
            r"no red laser spot",
            lambda session: photographs(session, second=lambda one: replace(one, laser=0.0)),
        ),
        (
            "a reflection beside the spot",
            r"two laser spots",
            lambda session: photographs(
                session, second=lambda one: replace(one, spots=(*one.spots, (-12 - one.spots[0][0], -30.0)))
            ),
        ),
        (
            "the camera turned by a quarter",
            r"turned",
            lambda session: photographs(session, lambda pixels: np.ascontiguousarray(np.rot90(pixels))),
        ),
        (
            "the board half outside",
            r"lattice",
            lambda session: photographs(session, second=lambda one: replace(one, centre_mm=(60.0, 0.0))),
        ),
        (
            "the photograph too dark",
            r"dark|lattice|spot",
            lambda session: photographs(session, lambda pixels: (pixels // 6).astype(np.uint8)),
        ),
    ],
    "drift": [("a record dated half a year ahead", r"after today|clock", dated(180))],
}
