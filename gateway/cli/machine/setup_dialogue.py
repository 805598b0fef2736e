"""The questions of `plumbline setup` on a terminal: each with a default, each answer checked at once."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

from devices.host_clock import HostClock
from gateway.configuration.device_sections import DEVICE_SECTIONS
from gateway.configuration.loading import WITHOUT_SENSOR, Answers, ConfigurationError
from gateway.configuration.model import MountedOn
from gateway.daemon.sampling.device_search import FoundSensor, SearchProblem, search_sensors
from gateway.errors import InputError
from gateway.languages import LANGUAGES

NONE = "none"
CERTIFICATE_FILES = {"ca": "ca.pem", "certificate": "certificate.pem", "key": "key.pem"}
NETWORK_LISTENERS = ["tls/0.0.0.0:7447", "tcp/127.0.0.1:7447"]
WARN_SHARE, CLEAR_SHARE = 2 / 3, 1 / 3
"""Default levels as shares of the trip level. Basis: a choice; a warning comes well before the trip, and clears well below it."""


def ask_all(answers: Answers) -> None:
    """Ask for everything that has no safe default. Raises `InputError` where the terminal ends."""
    try:
        _ask_sensor(answers)
        _ask_names(answers)
        _ask_rope(answers)
        _ask_limits(answers)
        _ask_page(answers)
        _ask_certificates(answers)
    except EOFError as error:
        raise InputError("the answers have ended; nothing was written") from error


def confirm(question: str, *, default: bool) -> bool:
    """Return the answer to a question of yes or no; the end of the terminal is a no."""
    try:
        answer = input(f"{question} [{'Y/n' if default else 'y/N'}] ").strip().lower()
    except EOFError:
        return False
    return default if not answer else answer in ("y", "yes")


def _ask_sensor(answers: Answers) -> None:
    print("Searching for sensors ...")
    found: list[FoundSensor] = []
    for item in search_sensors(HostClock()):
        if isinstance(item, SearchProblem):
            print(f"  note: {item.text}")
        else:
            found.append(item)
            print(f"  {len(found)}  {item.text}")
    print(f"  {len(found) + 1}  another one, by its kind")

    def take(text: str) -> None:
        number = _whole(text)
        if not 1 <= number <= len(found) + 1:
            raise ConfigurationError(f"1 to {len(found) + 1}, not {text}")
        settings = dict(found[number - 1].settings) if number <= len(found) else {}
        if "kind" in settings:
            answers.set(**{f"device__{key}": value for key, value in settings.items()})
        else:
            _ask_kind(answers, settings)

    _repeat("Which one is in the housing?", "1", take)
    if answers.get("device.port") is None:
        _ask_key(answers, "device.serial", "Label on the housing, by which its calibration is found", "H-0001")
    _ask_key(answers, "device.axes_map", "Sensor axes that are the housing's x, y, z; z points up the rope", "x,y,z")


def _ask_kind(answers: Answers, settings: dict[str, Any]) -> None:
    """Ask for the kind of a sensor that does not identify itself, and for what it needs besides."""
    serial = "port" in settings
    possible = [kind for kind, section in DEVICE_SECTIONS.items() if ("port" in section.model_fields) or not serial]
    possible = [kind for kind in possible if kind not in WITHOUT_SENSOR]

    def take(kind: str) -> None:
        if kind not in possible:
            raise ConfigurationError(f"one of {', '.join(possible)}, not {kind}")
        needed = {key: field for key, field in DEVICE_SECTIONS[kind].model_fields.items() if field.is_required()}
        asked = {
            key: _plain_value(input(f"{key}: {field.description}: ").strip())
            for key, field in needed.items()
            if key not in ("kind", *settings)
        }
        answers.set(device__kind=kind, **{f"device__{key}": value for key, value in (settings | asked).items()})

    _repeat(f"Kind ({', '.join(possible)})", possible[0], take)


def _ask_names(answers: Answers) -> None:
    print("\nNames: letters, digits, '.', '_' and '-'; messages are published as plumbline/v1/SITE/CRANE/SENSOR.")
    for key, text, default in (
        ("gateway.site", "Site", "yard"),
        ("gateway.crane", "Crane", "crane-1"),
        ("gateway.sensor", "Sensor", "hook-1"),
    ):
        _ask_key(answers, key, text, default)


def _ask_rope(answers: Answers) -> None:
    print("\nRope: as measured with a tape; the period that the gateway measures takes precedence.")
    _ask_key(answers, "rope.length_m", "Length from the pivot to the load's centre, m", None)
    _ask_key(answers, "housing.above_load_m", "Distance of the housing above the load's centre, m", None)
    _ask_mounted_on(answers)
    _ask_key(answers, "site.latitude_deg", "Latitude of the site, for its gravity, degrees", "50")


def _ask_mounted_on(answers: Answers) -> None:
    def take(text: str) -> None:
        if text != NONE:
            answers.set(housing__mounted_on=text)

    possible = ", ".join(get_args(MountedOn))
    _repeat(f"What carries the housing ({possible}); {NONE}: found from the readings", NONE, take)


def _ask_limits(answers: Answers) -> None:
    print('\nLimits of the swing; how to choose them: installation guide, "Choose the limits".')

    def take_trip(text: str) -> None:
        trip_deg = _number(text)
        warn_deg, clear_deg = round(WARN_SHARE * trip_deg, 2), round(CLEAR_SHARE * trip_deg, 2)
        answers.set(alerts__trip_deg=trip_deg, alerts__warn_deg=warn_deg, alerts__clear_deg=clear_deg)

    _repeat("Trip level, degrees", "6", take_trip)
    for key, text in (
        ("alerts.warn_deg", "Warning level, degrees"),
        ("alerts.clear_deg", "Alerts clear below, degrees"),
    ):
        _ask_key(answers, key, text, f"{answers.get(key):g}")
    _ask_key(answers, "alerts.lean_trip_deg", "Trip level of the lean, by a side pull, degrees", "3")


def _ask_page(answers: Answers) -> None:
    print("\nThe operator's page: 127.0.0.1 is seen on this machine alone, 0.0.0.0 by the whole network.")
    _ask_key(answers, "page.listen", "Address and port", "127.0.0.1:8321")
    _ask_key(answers, "page.language", f"Language, {' or '.join(LANGUAGES)}", "en")


def _ask_certificates(answers: Answers) -> None:
    print(
        "\nOther computers reach the gateway with certificates only (plumbline keys issue gateway NAME makes a folder)."
    )

    def take(text: str) -> None:
        if text == NONE:
            return
        folder = Path(text).expanduser().absolute()
        files = {key: folder / name for key, name in CERTIFICATE_FILES.items()}
        if missing := [str(path) for path in files.values() if not path.is_file()]:
            raise ConfigurationError(f"{missing[0]}: no such file")
        answers.set(bus__listen=NETWORK_LISTENERS, bus__tls={key: str(path) for key, path in files.items()})
        print(f"  the service must be able to read them: chown -R plumbline {folder}")

    _repeat("Folder with the gateway's certificates", NONE, take)


def _ask_key(answers: Answers, name: str, text: str, default: str | None) -> None:
    """Ask for one key until its answer is valid."""
    numeric = name.endswith(("_m", "_deg"))

    def take(answer: str) -> None:
        answers.set(**{name.replace(".", "__", 1): _number(answer) if numeric else answer})

    _repeat(text, default, take)


def _repeat(text: str, default: str | None, take: Callable[[str], None]) -> None:
    while True:
        answer = input(f"{text}{'' if default is None else f' [{default}]'}: ").strip() or default
        if answer is None:
            print("  needs an answer: it differs from crane to crane")
            continue
        try:
            take(answer)
        except ConfigurationError as error:
            print(f"  {str(error).removeprefix('answer: ')}")
        else:
            return


def _plain_value(text: str) -> int | float | str:
    """Return a number where the answer is one: what a configuration file would contain."""
    try:
        return int(text) if text.isdecimal() else float(text)
    except ValueError:
        return text


def _whole(text: str) -> int:
    if not text.isdecimal():
        raise ConfigurationError(f"a number, not {text}")
    return int(text)


def _number(text: str) -> float:
    try:
        return float(text.replace(",", "."))
    except ValueError:
        raise ConfigurationError(f"a number, not {text}") from None
