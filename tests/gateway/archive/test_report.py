"""The report over an archive: what is counted, what is marked, and the commands that it names."""

import re
import shlex
from datetime import UTC, datetime, time
from pathlib import Path

import numpy as np
import pytest

from gateway.archive.alternatives import limit_costs
from gateway.archive.report import ReportQuestion, make_report
from gateway.archive.tables import Archive
from gateway.cli.main import main
from gateway.errors import BAD_INPUT
from tests.clocks import START_NS
from tests.gateway.archive.small_recordings import NS_PER_S, SmallCrane, indexed
from tests.gateway.calibration.test_drift_table import sensor
from tests.gateway.recorded_crane import RecordedCrane

DAY = datetime(2026, 1, 1, tzinfo=UTC)
NEXT_DAY = datetime(2026, 1, 2, tzinfo=UTC)
NOON_NS = START_NS + 12 * 3600 * NS_PER_S


def question(**changes: object) -> ReportQuestion:
    return ReportQuestion(**({"begin": DAY, "end": NEXT_DAY, "limit_deg": 5.0} | changes))  # type: ignore[arg-type]


@pytest.mark.slow
def test_exceedances_are_counted_by_crane(clean: Path) -> None:
    report = make_report(Archive(str(clean)), question(), DAY)
    found = {each.gateway: (each.exceedances, each.exceeded_minutes) for each in report.gateways}
    assert found == {"yard/crane-1/hook": (1, 1), "yard/crane-2/hook": (0, 0), "yard/crane-3/hook": (1, 1)}
    assert [each.largest_deg for each in report.gateways] == pytest.approx([8.0, 6.0, 3.0], abs=0.03)
    assert all(each.recorded_s == 59 and each.known_s == 57 for each in report.gateways)
    assert all(each.is_verified for each in report.gateways)


@pytest.mark.slow
def test_neighbouring_minutes_are_one_exceedance_and_those_apart_are_two(tmp_path: Path) -> None:
    SmallCrane(tmp_path / "source" / "a", segments=2, segment_s=90, boot="a").record()
    SmallCrane(tmp_path / "source" / "b", segments=1, segment_s=20, boot="b", start_ns=NOON_NS).record()
    indexed(tmp_path / "source", tmp_path / "table")
    (crane,) = make_report(Archive(str(tmp_path / "table")), question(), DAY).gateways
    assert (crane.exceedances, crane.exceeded_minutes) == (2, 4)
    assert crane.recorded_s == 179 + 19


@pytest.mark.slow
def test_hours_and_shifts_are_those_of_the_zone(tmp_path: Path) -> None:
    SmallCrane(tmp_path / "source" / "b", segments=1, start_ns=NOON_NS).record()
    indexed(tmp_path / "source", tmp_path / "table")
    shifts = (time(6), time(13), time(22))
    archive = Archive(str(tmp_path / "table"))
    there = make_report(archive, question(zone="Europe/Berlin", shifts=shifts), DAY)
    assert np.flatnonzero(there.by_hour).tolist() == [13]
    assert [each[:2] for each in there.by_shift] == [
        ("06:00 to 13:00", 0),
        ("13:00 to 22:00", 1),
        ("22:00 to 06:00", 0),
    ]
    here = make_report(archive, question(shifts=shifts), DAY)
    assert np.flatnonzero(here.by_hour).tolist() == [12]
    assert [each[1] for each in here.by_shift] == [1, 0, 0]


@pytest.mark.slow
def test_a_shift_over_midnight_begins_on_the_day_before(clean: Path) -> None:
    report = make_report(Archive(str(clean)), question(shifts=(time(6), time(22))), DAY)
    assert [each[:2] for each in report.by_shift] == [("06:00 to 22:00", 0), ("22:00 to 06:00", 2)]


def test_the_cost_of_a_limit_counts_alarms_and_the_false_ones_among_them() -> None:
    place = np.array([0, 1, 2, 10, 11, 2**32])
    angle_deg = np.array([4.0, 5.2, 4.0, 4.8, 4.8, 6.0])
    compared_deg = angle_deg + 0.3
    found = {
        each.limit_deg: (each.alarms, each.false_alarms)
        for each in limit_costs(place, angle_deg, compared_deg, (3, 5, 5.4, 7))
    }
    assert found == {3: (3, 0), 5: (3, 1), 5.4: (2, 1), 7: (0, 0)}


@pytest.mark.slow
def test_time_that_is_not_known_is_told_by_reason(clean: Path) -> None:
    found = make_report(Archive(str(clean)), question(), DAY).unknown
    assert ("only # s of data", "not_known", 3) in [(each.reason, each.validity, each.gateways) for each in found]


@pytest.mark.slow
def test_a_type_of_sensor_proposes_an_earlier_calibration_to_its_others(tmp_path: Path) -> None:
    """Three sensors that drift are calibrated twice; a fourth one of their type once."""
    calibrated = {
        "crane-1": ([0, 200], 0.01),
        "crane-2": ([0, 200], -0.02),
        "crane-3": ([0, 200], 0.03),
        "crane-4": ([200], 0.0),
    }
    for crane, (days, mg_per_day) in calibrated.items():
        for number, record in enumerate(sensor(f"part-{crane}", list(map(float, days)), mg_per_day)):
            content = record.model_dump(mode="json")
            start_ns = START_NS + number * 60 * NS_PER_S
            folder = tmp_path / "source" / crane
            SmallCrane(folder, crane, segments=1, boot=f"b{number}", start_ns=start_ns, calibration=content).record()
    indexed(tmp_path / "source", tmp_path / "table")
    report = make_report(Archive(str(tmp_path / "table")), question(), datetime(2027, 1, 1, tzinfo=UTC))
    found = report.types["adxl355"]
    assert found.sensors == 3
    assert 0 < found.low_days < found.days < found.high_days
    (fourth,) = (each for each in report.proposals if each.device_id == "part-crane-4")
    (own,) = (each for each in report.sensors if each.device_id == "part-crane-4")
    assert own.basis == "interval"
    assert (fourth.next_utc - fourth.proposed_utc).days == pytest.approx(365 - found.low_days, abs=1)


@pytest.mark.slow
def test_the_command_of_the_worst_swing_opens_it(
    recorded: RecordedCrane, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table, page = tmp_path / "table", tmp_path / "report.html"
    indexed(recorded.folder, table)
    arguments = ["archive", "report", "--table", str(table), "--html", str(page), "--source", str(recorded.folder)]
    assert main([*arguments, "--from", "2026-01-01", "--to", "2026-01-02", "--shifts", "06:00,18:00"]) == 0
    assert "1 exceedances of 5 deg on 1 of 1 gateways" in capsys.readouterr().out
    text = page.read_text()
    (command,) = set(re.findall(r"plumbline (record incident [^<]*)<", text))
    assert main([*shlex.split(command), "--out", str(tmp_path / "incident"), "--margin", "5"]) == 3  # without the key
    assert "trip" in (tmp_path / "incident" / "incident.html").read_text()
    assert "5 recordings are not verified" in text
    assert "yard/crane-2/hook *" in text
    assert "simulated-1" in text  # its calibration
    assert re.findall(r"(?:src|href)=.(?!#)", text) == []  # complete in itself


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--from", "2026-01-02", "--to", "2026-01-01"], "--from 2026-01-02: is not before --to 2026-01-01"),
        (["--from", "2020-01-01", "--to", "2020-02-01"], "has nothing from 2020-01-01 to 2020-02-01"),
    ],
)
def test_a_time_without_anything_is_one_line_and_no_page(
    arguments: list[str], said: str, clean: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "report.html"
    assert main(["archive", "report", "--table", str(clean), "--html", str(page), *arguments]) == BAD_INPUT
    assert said in capsys.readouterr().err
    assert not page.exists()


@pytest.mark.parametrize(("option", "value"), [("--zone", "Mars"), ("--shifts", "6 o'clock"), ("--from", "soon")])
def test_an_option_that_cannot_be_read_is_one_line(option: str, value: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["archive", "report", "--table", "t", "--html", "r.html", option, value])
    assert ended.value.code == BAD_INPUT
    assert "such as" in capsys.readouterr().err
