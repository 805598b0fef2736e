"""What all tests share: Ctrl-C that reaches child processes, and a browser to look at pages as a person would."""

import ctypes
import gc
import signal
from collections.abc import Iterator
from operator import itemgetter
from pathlib import Path

import pytest
from hypothesis import settings
from playwright.sync_api import Browser, expect, sync_playwright

from tests.waiting import PATIENCE_S

CHROMIUM = Path("/usr/bin/chromium")
ARGUMENTS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3
"""Parameters of `mallopt`, from malloc.h of glibc."""
KEPT_BYTES = 32 * 2**20
"""Memory that this process keeps when it is freed. Basis: above all arrays of a step of a filter or of a fit together."""

# Else each step gives its arrays back to the kernel and gets them anew, page by page: a tenth of the time of filters and fits.
for parameter in (M_TRIM_THRESHOLD, M_MMAP_THRESHOLD):
    ctypes.CDLL(None).mallopt(parameter, KEPT_BYTES)
# Modules and test items live to the end: the search for garbage among them takes a third of the collection.
gc.disable()

# How long an example takes says how busy the computer is.
settings.register_profile("plumbline", deadline=None)
settings.load_profile("plumbline")


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Spread the modules that wait for processes among those that compute: at the end, they would wait with idle cores."""
    modules: dict[Path, list[pytest.Item]] = {}
    for item in items:
        modules.setdefault(item.path, []).append(item)
    waiting = [module for path, module in modules.items() if "system" in path.parts]
    computing = [module for path, module in modules.items() if "system" not in path.parts]
    places = [(number / len(group), module) for group in (waiting, computing) for number, module in enumerate(group)]
    items[:] = [item for _, module in sorted(places, key=itemgetter(0)) for item in module]


def pytest_collection_finish() -> None:
    """Look for garbage among what the tests make, and no longer among what was collected."""
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def _own_state(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep what commands remember of gateways apart from what the user of this machine has heard."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture(scope="session", autouse=True)
def _interruptible() -> None:
    """Let child processes receive Ctrl-C, which a shell hides from what it runs in the background."""
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if not CHROMIUM.exists():
        pytest.fail(f"{CHROMIUM} is missing: the page cannot be tested; mend: apt install chromium", pytrace=False)
    expect.set_options(timeout=1e3 * PATIENCE_S)
    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(executable_path=str(CHROMIUM), args=ARGUMENTS)
        yield launched
        launched.close()


@pytest.fixture(autouse=True)
def _closed_windows(request: pytest.FixtureRequest) -> Iterator[None]:
    """Close the windows that a test leaves open: they would go on drawing until the browser ends."""
    if "browser" not in request.fixturenames:
        yield
        return
    shared = request.getfixturevalue("browser").contexts
    yield
    for context in request.getfixturevalue("browser").contexts:
        if context not in shared:
            context.close()
