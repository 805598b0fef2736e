"""Wrong PINs on the page: counted and logged as refusals; a PIN that became void by them is a fault."""

from collections.abc import Callable
from pathlib import Path

from pydantic import ValidationError

from gateway.daemon.commands.security_log import Refusal, SecurityLog
from gateway.daemon.runtime.faults import FaultRegister
from gateway.page.sign_in_report import SignInReport

PIN_GUESSED = "pin_guessed"


class SignInWatch:
    """Takes the reports of the page; used by the thread of the remote calls alone."""

    def __init__(
        self, security_log: SecurityLog, faults: FaultRegister, pin_file: Path, now_ns: Callable[[], int]
    ) -> None:
        self._security_log = security_log
        self._faults = faults
        self._pin_file = pin_file
        self._now_ns = now_ns

    def take(self, payload: bytes) -> None:
        """Count what a report says. The fault stands until somebody signs in with the new PIN."""
        try:
            report = SignInReport.model_validate_json(payload)
        except ValidationError:
            return
        if report.wrong:
            refusal = Refusal("page/sign-in", "wrong_pin", None, "a PIN was entered that is not that of this gateway")
            self._security_log.add(refusal, lambda: report.address, self._now_ns(), report.wrong)
        match report.pin:
            case "replaced":
                text = f"the PIN of the page is void after too many wrong ones: somebody guesses; {self._pin_file} has a new one"
                self._faults.set(PIN_GUESSED, text)
            case "void":
                text = f"{self._pin_file}: the PIN is void after too many wrong ones, and no new one can be written"
                self._faults.set(PIN_GUESSED, text)
            case "good":
                self._faults.clear(PIN_GUESSED)
