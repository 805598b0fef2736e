"""The file `rig.toml`; where it leaves the rope's length out, the period of the recording states it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pydantic import ValidationError

from devices.tables.foreign import NOTHING_STATED, TableOptions
from gateway.errors import InputError, describe_problems
from gateway.file_input import read_toml
from gateway.measurement.source import Source, read_source
from gateway.pipeline.rig import Rig
from gateway.recording.reading.interval import WHOLE_RECORDING, RecordingInterval
from gateway.swing.detection.rope_length import rope_length_by_period
from gateway.swing.offline import estimate_swing

NO_LENGTH_M = 1e3
"""Stands for a length that is not stated, while the rest of a rig is validated. Basis: a choice; longer than any rope, so that no
check of a length fails."""


def rig_without_length(path: Path) -> float | None:
    """Return the site's gravity where a file states no rope length; None where it does, or cannot be read.

    Raises `InputError` where another value is wrong.
    """
    try:
        rope = read_toml(path).get("rope", {})
    except (OSError, ValueError):
        return None
    if not isinstance(rope, dict) or "length_m" in rope:
        return None
    return read_rig(path, {"length_m": NO_LENGTH_M}).site.gravity_m_s2


def read_rig(path: Path, rope: Mapping[str, float] | None = None) -> Rig:
    """Return the rig of a file, with values of the rope where the file states none. Raises `InputError` with the remedy."""
    try:
        table = read_toml(path)
        if rope is not None:
            table = table | {"rope": dict(rope) | table.get("rope", {})}
        return Rig.model_validate(table)
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file; check the path of the rig") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except ValidationError as error:
        is_missing = error.errors(include_url=False)[0]["type"] == "missing"
        remedy = "; needed are [rope] length_m and [housing] position_m" if is_missing else ""
        raise InputError(f"{path}: {describe_problems(error, 'rig')[0]}{remedy}") from error
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error


NOMINAL_RATIO, MAX_LENGTH_U_REL = 3.0, 0.2
"""Standard uncertainty of the nominal length over that by the period, and the largest. Basis: a choice; the fit finds the length
itself, and a rope a fifth longer starts in its reach."""
AGREEMENT_SIGMA = 3.0
"""Standard uncertainties within which a fitted length agrees with that by the period. Basis: a choice; 0.3 % by chance."""


@dataclass(frozen=True, slots=True)
class RigOfRecording:
    """A rig, and what was found for it in a recording."""

    rig: Rig
    remarks: tuple[str, ...] = ()
    length_u_m: float | None = None
    """Standard uncertainty of a length by the period; None: the rig states its length."""

    def refined_by(self, source: Source) -> "RigOfRecording":
        """Return the rig with the length of a pendulum fitted to its recording, which a twin needs to follow many periods.

        The length by the period remains where no pendulum fits, or one of a length that contradicts the period.
        """
        if self.length_u_m is None or source.housing is None:
            return self
        found = estimate_swing(
            source.recording.time_s, source.force_g, rig=source.housing, noise_g=source.noise_g
        ).length_m
        nominal_m = self.rig.rope.length_m
        if found is None or abs(found - nominal_m) > AGREEMENT_SIGMA * self.length_u_m:
            return self
        remark = f"rope length {found:.4g} m by a pendulum fitted to the swing"
        rope = self.rig.rope.model_copy(update={"length_m": found})
        return replace(self, rig=self.rig.model_copy(update={"rope": rope}), remarks=(*self.remarks, remark))


def read_rig_of_recording(
    path: Path,
    logs: Sequence[Path],
    interval: RecordingInterval = WHOLE_RECORDING,
    options: TableOptions = NOTHING_STATED,
) -> RigOfRecording:
    """Read a rig; a length that it does not state is that by the period of the recording. Raises `InputError`."""
    gravity_m_s2 = rig_without_length(path)
    if gravity_m_s2 is None:
        return RigOfRecording(read_rig(path))
    source = read_source(logs, None, interval, options)
    found = rope_length_by_period(source.recording.time_s, source.force_g, gravity_m_s2)
    if found is None:
        raise InputError(f"{path}: rope.length_m is missing, and nothing in {source.name} repeats as a swing; state it")
    u_rel = min(NOMINAL_RATIO * found.u_rel, MAX_LENGTH_U_REL)
    remark = (
        f"rope length {found.length_m:.3g} m ± {found.length_m * found.u_rel:.2g} m by the period of {found.period_s:.3g} s, "
        "because the rig states none"
    )
    # The length that swings like a rigid arm is shorter than the arm: a housing may be below it, so that is not checked.
    rig = read_rig(path, {"length_m": NO_LENGTH_M})
    by_period = {"length_m": found.length_m}
    if "length_u_rel" not in rig.rope.model_fields_set:
        by_period["length_u_rel"] = u_rel
    rope = rig.rope.model_copy(update=by_period)
    return RigOfRecording(rig.model_copy(update={"rope": rope}), (remark,), found.length_m * found.u_rel)
