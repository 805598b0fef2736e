"""`plumbline simulate` and `effects`: a recording from the simulation, and the physical causes that it knows."""

import argparse
import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.argument_types import above_zero, whole_number
from gateway.cli.command import command, option
from gateway.cli.output import output_file

if TYPE_CHECKING:
    from gateway.twin.effects import Effect, Parameter

EXAMPLE = """examples:
  plumbline simulate rig.toml --out log.csv --effect viscous_damping
  plumbline simulate rig.toml --out log.mcap --effect wind_gust:accel_m_s2=0.3,0.1:start_s=20 --duration 60 --seed 7
  plumbline simulate rig.toml --out log.csv --initial tilt_x_deg=8 rate_y_deg_s=1
  plumbline simulate rig.toml --out log.csv --effects-from my_effects.py --effect my_effect"""
FORMATS = (".csv", ".mcap")
EFFECTS_FROM_OPTION = option(
    "--effects-from",
    action="append",
    default=[],
    type=Path,
    metavar="FILE.py",
    help="add effects of your own; the file is executed; several times for several files",
)
"""Effects of the user; `load_user_effects` adds them."""


@command(
    "effects",
    "list the effects that simulation and reconciliation know",
    "List the effects, or describe one: equation, parameters, and how to separate it from others.",
    "examples: plumbline effects | plumbline effects wind_gust",
    option("name", nargs="?", metavar="NAME", help="describe this effect"),
    EFFECTS_FROM_OPTION,
)
def run_effects(arguments: argparse.Namespace) -> int:
    """Print the list, or one description."""
    from gateway.extras import require_extra

    require_extra("twin")
    from gateway.errors import InputError
    from gateway.twin.effects import EFFECTS

    load_user_effects(arguments)
    if arguments.name is None:
        width = max(map(len, EFFECTS))
        print("\n".join(f"{name:<{width}}  {effect.explains}" for name, effect in EFFECTS.items()))
        return 0
    if arguments.name not in EFFECTS:
        raise InputError(f"{arguments.name!r} is no effect; known are {', '.join(sorted(EFFECTS))}")
    print("\n".join(_describe(EFFECTS[arguments.name])))
    return 0


def _describe(effect: "Effect") -> Iterator[str]:
    yield f"{effect.name}: {effect.explains}"
    yield f"equation     {effect.equation}"
    yield f"acts on      {effect.enters}{' for a limited time' if effect.transient else ''}"
    yield f"source       {effect.reference}"
    yield f"to separate  {effect.discriminating_experiment}"
    yield "parameters"
    for parameter in effect.parameters:
        yield f"  {_describe_parameter(parameter)}"


def _describe_parameter(p: "Parameter") -> str:
    components = f" [{', '.join(p.components)}]" if p.components else ""
    typical = ",".join(f"{each:g}" for each in p.typical) if isinstance(p.typical, tuple) else f"{p.typical:g}"
    unit = "" if p.unit == "1" else f" {p.unit}"
    return f"{p.name}{components}: {p.meaning}; {p.lower:g} to {p.upper:g}{unit}, typical {typical}"


def load_user_effects(arguments: argparse.Namespace) -> None:
    """Add the effects of installed packages and of the given files to the vocabulary. Raises `InputError`."""
    from gateway.twin.effect_loading import load_effect_file, load_installed_effects

    load_installed_effects()
    for path in arguments.effects_from:
        load_effect_file(path)


@command(
    "simulate",
    "write a recording from the simulation",
    "Simulate a rig with chosen effects and its sensor; an .mcap also passes through the gateway's pipeline.",
    EXAMPLE,
    option("rig", type=Path, metavar="RIG", help="rig.toml; the effects in its [model] act as well"),
    option("--out", type=output_file, metavar="LOG", required=True, help=".csv or .mcap"),
    option(
        "--effect",
        action="append",
        default=[],
        metavar="NAME[:PARAMETER=VALUE]...",
        help="add an effect, with typical values of the parameters that are not given; may be repeated",
    ),
    EFFECTS_FROM_OPTION,
    option("--duration", type=above_zero, default=120.0, metavar="S", help="length of the recording in s (120)"),
    option("--seed", type=whole_number, default=1, metavar="N", help="seed of the noise and of the initial state (1)"),
    option(
        "--initial",
        nargs="+",
        default=[],
        metavar="NAME=VALUE",
        help="initial state: tilt_x_deg, tilt_y_deg, rate_x_deg_s, rate_y_deg_s, heading_deg; rigging_tilt_x_deg ...; "
        "stretch_m",
    ),
)
def run_simulate(arguments: argparse.Namespace) -> int:
    """Simulate and write the recording."""
    from gateway.extras import require_extra

    require_extra("twin")
    from gateway.cli.output import write_text
    from gateway.errors import InputError
    from gateway.measurement.rig_file import read_rig
    from gateway.twin.model import Model, model_of, parse_effect_assignments
    from gateway.twin.recording import as_csv, write_mcap
    from gateway.twin.simulation import simulate

    out: Path = arguments.out
    if out.suffix not in FORMATS:
        raise InputError(f"--out {out}: should end in .csv or .mcap")
    load_user_effects(arguments)
    nominal = model_of(read_rig(arguments.rig), str(arguments.rig))
    model = Model(nominal.rig, parse_effect_assignments(nominal.effects, arguments.effect))
    simulated = simulate(model, arguments.duration, arguments.seed, _parse_initial_state(arguments.initial))
    if out.suffix == ".csv":
        write_text(out, as_csv(simulated))
    else:
        write_mcap(out, model.rig, simulated, arguments.seed)
    effects = ", ".join(model.effects) or "none"
    print(f"{out}: {len(simulated.time_s)} samples at {simulated.rate_hz:g} Hz; effects: {effects}")
    return 0


def _parse_initial_state(pairs: list[str]) -> dict[str, float]:
    """Return the coordinates by name, in radians."""
    from gateway.errors import InputError

    initial = {}
    for pair in pairs:
        name, _, text = pair.partition("=")
        try:
            value = float(text)
        except ValueError as error:
            raise InputError(f"--initial {pair}: should be NAME=VALUE, such as tilt_x_deg=5") from error
        if not math.isfinite(value):
            raise InputError(f"--initial {pair}: should be a number")
        name_in_radians = name.replace("_deg", "_rad")
        initial[name_in_radians] = value if name_in_radians == name else math.radians(value)
    return initial
