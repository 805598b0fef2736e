"""The plot of the error over the mounting."""

import numpy as np

from tests.benchmarks.swing_cases import RHOS

PLOT_FLOOR_DEG, PLOT_TOP_DEG = 1e-4, 30.0
COLOURS = {"eq. 22": "#c1272d", "eq. 23": "#d98200", "eq. 24": "#0b7a53", "eq. 25": "#7a4fb5", "estimate": "#0b57a4"}
LEFT, RIGHT, TOP, BOTTOM = 70, 590, 50, 400


def svg(rho: np.ndarray, errors: dict[str, np.ndarray]) -> str:
    """Absolute error over rho on a logarithmic axis: a dot for each recording, a line through the rms."""
    drawing = [
        _text(LEFT, 26, "Error of phi_max, formulas as published: dots single recordings, lines rms", 15, "start")
    ]
    drawing += _axes()
    for place, (name, error_deg) in enumerate(errors.items()):
        drawing += _series(rho, error_deg, COLOURS[name], place - (len(errors) - 1) / 2)
        y = TOP + 20 + 24 * place
        drawing.append(f'<path d="M{RIGHT + 20} {y} h26" stroke="{COLOURS[name]}" stroke-width="2.5"/>')
        drawing.append(_text(RIGHT + 54, y + 5, name, 13, "start"))
    head = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 700 450" font-family="sans-serif">'
    return "\n".join([head, '<rect width="700" height="450" fill="#ffffff"/>', *drawing, "</svg>\n"])


def _axes() -> list[str]:
    lines = []
    for exponent in range(-4, 2):
        y = _y(10.0**exponent)
        lines.append(f'<path d="M{LEFT} {y:.1f} H{RIGHT}" stroke="#dddddd"/>')
        lines.append(_text(LEFT - 8, y + 4, f"{10.0**exponent:g}°" if exponent > -4 else "0.0001°", 12, "end"))
    for rho in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0):
        lines.append(f'<path d="M{_x(rho):.1f} {BOTTOM} v5" stroke="#444444"/>')
        lines.append(_text(_x(rho), BOTTOM + 20, f"{rho:g}", 12, "middle"))
    lines.append(f'<path d="M{LEFT} {TOP} V{BOTTOM} H{RIGHT}" stroke="#444444" fill="none"/>')
    lines.append(_text((LEFT + RIGHT) / 2, BOTTOM + 42, "rho: 0 housing at the pivot, 1 at the load", 13, "middle"))
    return lines


def _series(rho: np.ndarray, error_deg: np.ndarray, colour: str, aside: float) -> list[str]:
    """Dots stand a little aside, so that those of one rho can be told apart."""
    known = ~np.isnan(error_deg)
    dots = [
        f'<circle cx="{_x(r) + 4 * aside:.1f}" cy="{_y(e):.1f}" r="2.2"/>'
        for r, e in zip(rho[known], error_deg[known], strict=True)
    ]
    means = [(r, np.sqrt(np.mean(error_deg[known & (rho == r)] ** 2))) for r in RHOS if (known & (rho == r)).any()]
    points = " ".join(f"{_x(r) + 4 * aside:.1f},{_y(e):.1f}" for r, e in means)
    group = [f'<g fill="{colour}" fill-opacity="0.45">', *dots, "</g>"]
    return [*group, f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2.2"/>']


def _x(rho: float) -> float:
    return LEFT + 16 + rho * (RIGHT - LEFT - 32)


def _y(error_deg: float) -> float:
    share = np.log(max(error_deg, PLOT_FLOOR_DEG) / PLOT_FLOOR_DEG) / np.log(PLOT_TOP_DEG / PLOT_FLOOR_DEG)
    return float(BOTTOM - share * (BOTTOM - TOP))


def _text(x: float, y: float, text: str, size: int, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" text-anchor="{anchor}" fill="#222222">{text}</text>'
