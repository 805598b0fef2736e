"""The page of a site: real messages on a real router, the command's own process, and a browser."""

import json
import re
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import zenoh
from axe_playwright_python.sync_playwright import Axe
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from playwright.sync_api import Browser, Page, expect

from gateway.authorization.message_signature import MessageSigner, Question
from gateway.bus.authenticity import CHALLENGE
from gateway.fleet.fleet_servers import CARD_STYLES
from gateway.fleet.gateway_status import STATE_LABELS
from gateway.languages import LANGUAGES, read_texts
from gateway.messages import Health
from gateway.pki.signing_key import SigningKey
from gateway.stages.condition import DISTURBING, UNUSABLE
from gateway.topics import TOPIC_OF, encode
from tests.gateway.page.conftest import PageUnderTest
from tests.gateway.scene import Scene
from tests.ports import unused_port
from tests.waiting import PATIENCE_S, wait_until

pytestmark = pytest.mark.slow

SIZES = {"panel": (800, 480), "desktop": (1280, 800), "phone": (390, 844)}
GATEWAY = Path(__file__).parents[3] / "gateway"
DAEMON = GATEWAY / "daemon"
INSPECTION = Path(__file__).with_name("layout.js").read_text(encoding="utf-8")
SMALLEST_TEXT_PX = 15.9
CRANES_KEY = SigningKey(Ed25519PrivateKey.from_private_bytes(bytes(32)))
"""The same in all tests: the key of a name stays pinned."""
URL = "http://crane-2.example:8321/"
LONG_REASON = "the magnitude is not that of a hanging load, which a swing would have at its turning point; " * 4


class Site:
    """A router, and cranes that send their states."""

    def __init__(self) -> None:
        self.endpoint = f"tcp/127.0.0.1:{unused_port()}"
        config = zenoh.Config()
        config.insert_json5("mode", '"router"')
        config.insert_json5("listen/endpoints", json.dumps([self.endpoint]))
        config.insert_json5("scouting/multicast/enabled", "false")
        self.session = zenoh.open(config)
        self.scenes: dict[str, Scene] = {}
        self.pages: dict[str, str] = {}
        self._tokens: dict[str, zenoh.LivelinessToken] = {}
        self._signer = MessageSigner(lambda: CRANES_KEY, "0123456789ab", time.monotonic_ns)
        challenged = f"{self._key('*')}/{CHALLENGE}"
        self._answering = self.session.declare_queryable(challenged, self._answer)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._speak)
        self._thread.start()

    def add(self, crane: str, page: str | None = None) -> Scene:
        if page is not None:
            self.pages[crane] = page
        self._tokens[crane] = self.session.liveliness().declare_token(f"{self._key(crane)}/alive")
        return self.scenes.setdefault(crane, Scene())

    def remove(self, crane: str) -> None:
        del self.scenes[crane]
        self._tokens.pop(crane).undeclare()

    def close(self) -> None:
        self._ended.set()
        self._thread.join()
        self.session.close()

    def _key(self, crane: str) -> str:
        return f"plumbline/v1/north-yard/{crane}/hook"

    def _answer(self, query: zenoh.Query) -> None:
        """Prove to who asks which key the cranes have, and what their time is."""
        sent = [b"" if part is None else part.to_bytes() for part in (query.payload, query.attachment)]
        name, payload = str(query.key_expr), b"{}"
        query.reply(name, payload, attachment=self._signer.sign_answer(name, payload, Question(*sent), accepted=True))

    def _speak(self) -> None:
        sequence = 0
        while not self._ended.wait(0.2):
            sequence += 1
            for crane, scene in list(self.scenes.items()):
                for message in scene.messages(sequence, time.time_ns()):
                    stated = replace(message, page=self.pages.get(crane)) if isinstance(message, Health) else message
                    name, payload = f"{self._key(crane)}/{TOPIC_OF[type(message)].name}", encode(stated)
                    self.session.put(name, payload, attachment=self._signer.sign_message(name, payload))


@pytest.fixture
def site() -> Iterator[Site]:
    running = Site()
    yield running
    running.close()


@pytest.fixture(params=LANGUAGES)
def language(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def serve(site: Site) -> Iterator[Callable[..., str]]:
    """Starts the command; returns the address of its page."""
    processes: list[subprocess.Popen[bytes]] = []

    def start(*arguments: str) -> str:
        port = unused_port()
        command = [sys.executable, "-m", "gateway", "fleet", "page", "--listen", f"127.0.0.1:{port}"]
        processes.append(
            subprocess.Popen([*command, "--connect", site.endpoint, *arguments], stdout=subprocess.DEVNULL)
        )
        wait_until(lambda: _answers(port), "the page of the site")
        return f"http://127.0.0.1:{port}"

    yield start
    for process in processes:
        process.terminate()
        assert process.wait(PATIENCE_S) == 0


def _answers(port: int) -> bool:
    try:
        socket.create_connection(("127.0.0.1", port), timeout=1).close()
    except OSError:
        return False
    return True


def _fleet(url: str) -> Any:
    with urllib.request.urlopen(f"{url}/api/fleet", timeout=PATIENCE_S) as answer:
        return json.load(answer)


def _open(browser: Browser, url: str, size: tuple[int, int] = SIZES["panel"]) -> Page:
    window = browser.new_page(viewport={"width": size[0], "height": size[1]})
    window.add_init_script(INSPECTION)
    window.goto(url)
    return window


def test_what_asks_for_action_comes_first(site: Site, serve: Callable[..., str], browser: Browser) -> None:
    site.add("crane-1")
    site.add("crane-2", page=URL).level = "trip"
    site.add("crane-3").calibration = "uncalibrated"
    url = serve()
    window = _open(browser, url)
    names = window.locator("#cards .name")
    words = window.locator("#cards strong")
    expect(names).to_have_text(
        ["north-yard / crane-2 / hook", "north-yard / crane-3 / hook", "north-yard / crane-1 / hook"]
    )
    expect(words).to_have_text(["LIMIT", "UNCALIBRATED", "OK"])
    expect(window.locator("#summary")).to_have_text("2 of 3 ask for action")
    expect(window.locator("#cards .swing")).to_have_text(["2.3°", "—", "2.3°"])
    expect(window.locator("#cards a")).to_have_attribute("href", URL)
    expect(window.locator("#cards a")).to_have_count(1)
    site.scenes["crane-1"].level = "trip"
    site.scenes["crane-2"].level = "normal"
    expect(words).to_have_text(["LIMIT", "UNCALIBRATED", "OK"])
    expect(names.first).to_have_text("north-yard / crane-1 / hook")
    site.remove("crane-1")
    expect(words.first).to_have_text("GONE")
    expect(window.locator("#cards .last")).to_have_text(["last: LIMIT", "", ""])
    site.scenes["crane-2"].level = "warn"
    expect(words).to_have_text(["WARNING", "GONE", "UNCALIBRATED"])
    window.close()


def test_a_card_shows_the_number_of_the_cranes_own_page(
    site: Site, serve: Callable[..., str], browser: Browser
) -> None:
    scene = site.add("crane-1")
    scene.level, scene.expected_deg, scene.phi_max_deg = "trip", 6.2, 3.9
    window = _open(browser, serve())
    number, expected = window.locator("#cards .swing"), window.locator("#cards .expected")
    expect(number).to_have_text("6.2°")
    expect(expected).to_have_text("expected")
    scene.time_to_peak_s, scene.angle_share = 0.0, 1.0
    expect(expected).to_have_text("")
    scene.expected_deg, scene.level, scene.state, scene.lean_deg = 0.1, "normal", "rest", 0.0
    expect(number).to_have_text("≤ 0.3°")
    window.close()


def test_cards_say_why_in_the_language_of_the_page(
    site: Site, serve: Callable[..., str], browser: Browser, tmp_path: Path
) -> None:
    site.add("crane-1").level = "trip"
    site.add("crane-2").calibration = "uncalibrated"
    site.add("crane-3").standing_faults = {
        "recording": "no space left on device",
        "state-files": "the state-files thread has made no progress for 20 s",
    }
    site.add("crane-4").battery_low = True
    site.add("crane-5").level = "unknown"
    disturbed = site.add("crane-6")
    disturbed.condition, disturbed.trusted = "disturbed", False
    site.add("crane-7")
    site.add("crane-9").changed_limits = ["alerts.trip_deg is 15, changed over the bus"]
    expected = tmp_path / "expected.txt"
    expected.write_text("north-yard/crane-8/hook\n")
    window = _open(browser, serve("--language", "de", "--expect", str(expected)))
    expect(window.locator("#cards li")).to_have_count(9)  # what was never seen cannot go
    site.remove("crane-7")
    expect(window.locator("#cards .why")).to_have_text(
        [
            "Grenzwert 6,0° war überschritten. Wird klar unter 5,4° zur Warnung.",
            "Gateway aus: niemand überwacht das Pendeln.",
            "Erwartet, und nie gesehen.",
            "Der Sensor ist nicht kalibriert. Der Winkel kann um mehrere Grad falsch sein.",
            "Die Kraft ist nicht die einer hängenden Last.",
            "Das Pendeln ist zurzeit unbekannt.",
            "Arbeitet nicht: Aufzeichnung, Schreiben der Zustandsdateien.",
            "Die Batterie des Sensors ist schwach. Laden oder wechseln.",
            "Die Grenzen der Alarme sind nicht die der Inbetriebnahme.",
        ]
    )
    window.close()


def test_a_card_says_that_the_sensor_is_silent(site: Site, serve: Callable[..., str], browser: Browser) -> None:
    scene = site.add("crane-1")
    window = _open(browser, serve("--language", "de"))
    expect(window.locator("#cards strong")).to_have_text(["OK"])
    scene.validity = "no_samples"
    expect(window.locator("#cards strong")).to_have_text(["VERALTET"])
    expect(window.locator("#cards .why")).to_have_text(
        re.compile(r"Vom Sensor kommen keine Messwerte\. Seit \d+ s keine neuen Daten\.")
    )
    window.close()


def test_a_card_with_an_alarm_says_that_a_part_is_faulty(
    site: Site, serve: Callable[..., str], browser: Browser
) -> None:
    scene = site.add("crane-1")
    scene.level, scene.standing_faults = "trip", {"recording": "no space left on device"}
    window = _open(browser, serve())
    expect(window.locator("#cards strong")).to_have_text(["LIMIT"])
    expect(window.locator("#cards .doubt")).to_have_text(["FAULT: recording"])
    scene.standing_faults = {}
    expect(window.locator("#cards .doubt")).to_have_text([""])
    window.close()


UNPROVED = """([authenticated, value]) => import('/card_sentence.js').then(({cardSentence}) => {
  const swing = {rule: 'swing', level: 'trip', limit_deg: 6, largest_deg: 7};
  const causes = {alerts: [swing], faulty_parts: [], failed_gates: []};
  return cardSentence({word: 'TRIP', alive: true, causes, motion: null, authenticated}, value);
})"""


def test_a_number_that_is_not_shown_for_want_of_proof_is_not_called_unknown(
    idle_page: PageUnderTest, browser: Browser
) -> None:
    window = _open(browser, idle_page.url)
    assert window.evaluate(UNPROVED, [False, None]).startswith("It is not proved that this comes from the gateway")
    assert window.evaluate(UNPROVED, [True, None]).endswith("The angle is not known now.")
    window.close()


def test_every_word_gate_and_part_has_a_text() -> None:
    parts = {
        name
        for path in DAEMON.rglob("*.py")
        for name in re.findall(r'(?m)^\w*(?:PART|PIN) = "(\w+)"', path.read_text())
    }
    assert {"device", "recording", "page_pin", "clock"} <= parts
    threads = {
        name
        for path in DAEMON.rglob("*.py")
        for name in re.findall(r'super\(\).__init__\((?:name=)?"([\w-]+)"', path.read_text())
    }
    assert {"sampler", "recorder", "commands"} <= threads
    threads -= {"compaction", "bus"}  # which the watchdog does not look at
    assert parts.isdisjoint(threads)  # it would clear the part's own fault
    parts |= threads
    wanted = {f"word_{word}" for word in CARD_STYLES}
    wanted |= {f"gate_{gate}" for gate in {*UNUSABLE, *DISTURBING}} | {f"part_{part}" for part in parts}
    for language in LANGUAGES:
        assert wanted - set(read_texts(language)) == set(), language


def test_every_state_has_a_card() -> None:
    assert set(CARD_STYLES) == set(STATE_LABELS)


def test_a_site_without_its_router_says_so(site: Site, serve: Callable[..., str], browser: Browser) -> None:
    site.add("crane-1")
    window = _open(browser, serve())
    expect(window.locator("#cards strong")).to_have_text(["OK"])
    site.close()
    expect(window.locator("#notice")).to_have_text("No connection to the router: the list is old.")
    expect(window.locator("#cards strong")).not_to_have_text(["OK"])
    window.close()


def test_a_foreign_host_and_a_hostile_address_get_nothing(site: Site, serve: Callable[..., str]) -> None:
    site.add("crane-1", page="javascript:alert(1)")  # no address of a page: the message is no valid one
    site.add("crane-2")
    url = serve()
    wait_until(lambda: len(_fleet(url)["gateways"]) == 2, "two cranes")
    assert [gateway["page"] for gateway in _fleet(url)["gateways"]] == [None, None]
    request = urllib.request.Request(url, headers={"Host": "evil.com"})
    with pytest.raises(urllib.error.HTTPError, match="421") as refused:
        urllib.request.urlopen(request, timeout=PATIENCE_S)
    refused.value.close()


def test_every_state_fits_every_size_and_axe_finds_nothing(
    site: Site, serve: Callable[..., str], browser: Browser, language: str, tmp_path: Path
) -> None:
    site.add("crane-1", page=URL)
    site.add("crane-2").level = "trip"
    site.add("crane-3").level = "warn"
    site.scenes["crane-3"].device_kind = "simulated"
    site.add("crane-4").calibration = "uncalibrated"
    disturbed = site.add("crane-with-a-rather-long-name-of-40-letters-5")
    disturbed.condition, disturbed.trusted, disturbed.reasons = "disturbed", False, [LONG_REASON]
    site.add("crane-6").standing_faults = dict.fromkeys(("device", "outbox", "state_files", "signing"), LONG_REASON)
    expected = tmp_path / "expected.txt"
    expected.write_text("north-yard/crane-9/hook\n" + "".join(f"north-yard/{crane}/hook\n" for crane in site.scenes))
    window = _open(browser, serve("--language", language, "--expect", str(expected)))
    expect(window.locator("#cards li")).to_have_count(7)
    expect(window.locator("html")).to_have_attribute("lang", language)
    for name, size in SIZES.items():
        window.set_viewport_size({"width": size[0], "height": size[1]})
        window.wait_for_timeout(400)
        assert window.evaluate("layout.cut()") == [], name
        assert window.evaluate("layout.outside(true)") == [], name
        if name == "panel":
            assert window.evaluate("(px) => layout.small(px)", SMALLEST_TEXT_PX) == []
        found = Axe().run(window)
        assert found.violations_count == 0, found.generate_report()
    window.close()
