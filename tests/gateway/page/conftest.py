"""A gateway that is not there: messages of the real classes on the private channel, and the page process at its other end."""

import json
import socket
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from playwright.sync_api import Browser, expect

from gateway.daemon.commands.requests import RemoteRequest
from gateway.daemon.commands.rpc_server import PageRequests
from gateway.daemon.outputs.page_channel import PageChannel
from gateway.daemon.outputs.page_process import start_process, stop_process
from gateway.page.channel import Parameters
from gateway.recalibration.requests import Acknowledge
from gateway.topics import TOPIC_OF, encode
from tests.gateway.page.screen import PANEL, Screen
from tests.gateway.scene import Scene
from tests.waiting import PATIENCE_S

KEY = "plumbline/v1/north-yard/crane-3/hook"
TICK_S = 0.1
"""Time between two messages of a topic, as from a gateway."""
PIN = "31415926"


class Services:
    """Takes the requests of the page, and acknowledges in the scene as the gateway does in its messages."""

    def __init__(self) -> None:
        self.scene: Scene | None = None
        self.requests: list[Acknowledge] = []

    def submit(self, request: RemoteRequest) -> None:
        content = request.expect(Acknowledge)
        self.requests.append(content)
        if self.scene is None or content.incident != self.scene.incident:
            request.refuse(f"no incident {content.incident} is known, or it is too old")
            return
        self.scene.acknowledged_by = content.by
        request.reply(True, {"text": "done"})


class FakeGateway:
    """Sends a scene at 10 Hz, every topic each time."""

    def __init__(self, channel: PageChannel) -> None:
        self._channel = channel
        self.scene = Scene()
        self.speaking = threading.Event()
        self.speaking.set()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._speak)
        self._thread.start()

    def put(self, topic: str, payload: bytes) -> None:
        self._channel.put(topic, payload)

    def close(self) -> None:
        self._ended.set()
        self._thread.join()

    def _speak(self) -> None:
        sequence = 0
        while not self._ended.wait(TICK_S):
            if self.speaking.is_set():
                for message in self.scene.messages(sequence, time.time_ns()):
                    self.put(TOPIC_OF[type(message)].name, encode(message))
                sequence += 1


class PageUnderTest:
    """The page process, started as the daemon starts it."""

    def __init__(self, channel: PageChannel, **changes: Any) -> None:
        self._channel = channel
        self.listener = socket.create_server(("127.0.0.1", 0), backlog=64)
        self.url = f"http://127.0.0.1:{self.listener.getsockname()[1]}"
        self._parameters = Parameters(
            key=KEY, warn_deg=4.0, trip_deg=6.0, clear_deg=3.0, lean_trip_deg=3.0, title="Crane 3", **changes
        )
        self.process = start_process(self._parameters, self.listener, self._channel.open)

    def get(self, path: str) -> tuple[int, str]:
        try:
            with urllib.request.urlopen(self.url + path, timeout=PATIENCE_S) as response:
                return response.status, response.read().decode()
        except urllib.error.HTTPError as error:
            with error:
                return error.code, error.read().decode()

    def state(self) -> Any:
        return json.loads(self.get("/api/state")[1])

    def word(self) -> str:
        return str(self.state()["verdict"]["word"])

    def start_again(self) -> None:
        """As the daemon does when the page process has died: on the same socket."""
        stop_process(self.process)
        self.process = start_process(self._parameters, self.listener, self._channel.open)

    def close(self) -> int:
        code = stop_process(self.process)
        self.listener.close()
        return code


@pytest.fixture
def scene() -> Scene:
    return Scene()


@pytest.fixture
def start_gateway() -> Callable[[PageChannel], FakeGateway]:
    return FakeGateway


@pytest.fixture
def services() -> Services:
    return Services()


@pytest.fixture
def channel(services: Services) -> Iterator[PageChannel]:
    opened = PageChannel(PageRequests({"acknowledge": services.submit}).answer)
    yield opened
    opened.close()


@pytest.fixture
def gateway(channel: PageChannel, services: Services) -> Iterator[FakeGateway]:
    fake = FakeGateway(channel)
    services.scene = fake.scene
    yield fake
    fake.close()


def _write_pin(folder: Path) -> Path:
    path = folder / "page-pin"
    path.write_text(f"{PIN}\n")
    return path


@pytest.fixture
def pin_file(tmp_path: Path) -> Path:
    return _write_pin(tmp_path)


PEOPLE: dict[str, Any] = {"names": ["Ann", "Bert"], "hosts": ["crane-3.local"]}


@pytest.fixture
def page(channel: PageChannel, pin_file: Path) -> Iterator[PageUnderTest]:
    under_test = PageUnderTest(channel, pin_file=pin_file, **PEOPLE)
    yield under_test
    under_test.close()


@pytest.fixture(scope="module")
def idle_page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageUnderTest]:
    """One without data of a gateway, for the tests of a module that change nothing of it."""
    channel = PageChannel(PageRequests({}).answer)
    under_test = PageUnderTest(channel, pin_file=_write_pin(tmp_path_factory.mktemp("pin")), **PEOPLE)
    yield under_test
    under_test.close()
    channel.close()


class ShownPage(NamedTuple):
    """A page in one window that goes from state to state, as that of a crane does."""

    gateway: FakeGateway
    screen: Screen

    def show(self, scene: Scene, word: str) -> None:
        """Let the gateway say something else, and wait until the window shows its word."""
        self.gateway.scene = scene
        self.gateway.speaking.set()
        expect(self.screen.page.locator("body")).to_have_attribute("data-word", word)


@contextmanager
def open_page(browser: Browser, **changes: Any) -> Iterator[ShownPage]:
    """Start a process of the page with these parameters, and open a window on it."""
    channel = PageChannel(PageRequests({}).answer)
    gateway = FakeGateway(channel)
    page = PageUnderTest(channel, **changes)
    screen = Screen(browser, page.url)
    yield ShownPage(gateway, screen)
    screen.page.close()
    page.close()
    gateway.close()
    channel.close()


@pytest.fixture(scope="module")
def one_page(browser: Browser) -> Iterator[ShownPage]:
    """One for a module: a process of the page and a window for each test take longer than what is looked at."""
    with open_page(browser) as shown:
        yield shown


@pytest.fixture
def shown_page(one_page: ShownPage) -> ShownPage:
    """A page that shows a scene in which all is well."""
    page = one_page.screen.page
    page.set_viewport_size({"width": PANEL[0], "height": PANEL[1]})
    page.evaluate("location.hash = ''")
    one_page.show(Scene(), "OK")
    one_page.screen.text("#phi", "2.3°")
    one_page.screen.errors.clear()
    return one_page
