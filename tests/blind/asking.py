"""One case put to `plumbline reconcile` as a process, and its answer scored."""

import json
import resource
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.blind import score
from tests.blind.plan import CATALOGUE

LAST_WORDS = 300
LOOK_EVERY_S = 0.05


@dataclass(frozen=True, slots=True)
class _Ended:
    code: int
    said: str
    seconds: float
    peak_mib: float
    in_time: bool
    cpu_s: float


def ask(case: Path, command: Sequence[str], timeout_s: float, options: Sequence[str] = ()) -> dict[str, Any]:
    """A row of the results: what is hidden, what was said, what that is worth, and what it cost."""
    truth_file = json.loads((case / "truth.json").read_text())
    hidden = truth_file["effects"]
    truth = frozenset(hidden)
    with tempfile.TemporaryDirectory() as folder:
        report, prediction = Path(folder, "report.json"), Path(folder, "prediction.csv")
        ended = _run([*command, "reconcile", *case_arguments(case, report, prediction), *options], timeout_s)
        row = {
            "case": case.name,
            "truth": sorted(truth),
            "seconds": round(ended.seconds, 2),
            "cpu_s": round(ended.cpu_s, 2),
            "peak_mib": ended.peak_mib,
        }
        row |= {
            "verdict": None,
            "named": [],
            "group": [],
            "chi2_before": None,
            "chi2_after": None,
            "closed_percent": None,
            "closed_test_percent": None,
        }
        if not ended.in_time:
            return row | {"score": score.TIMEOUT, "why": f"more than {timeout_s:g} s"}
        try:
            said = json.loads(report.read_text())
            answer = score.answer_of(said)
        except (OSError, ValueError, KeyError) as error:
            return row | {"score": score.CRASH, "why": f"exit code {ended.code}: {ended.said or error}"}
        after, why = _after(case, prediction, hidden)
    worth = score.judge(truth, answer)
    if after is not None and after < score.SEEN_THE_DATA:
        worth = "copied"
    if worth not in (score.RIGHT, score.RIGHT_GROUP):
        why = "; ".join(part for part in (why, str(said.get("reason", "")), _of_the_truth(truth, said)) if part)
    comparable = truth and truth <= CATALOGUE.keys() and "sample_loss" not in truth
    return row | {
        "verdict": answer.verdict,
        "named": sorted(answer.named),
        "group": sorted(answer.group),
        "score": worth,
        "chi2_before": _short(answer.before),
        "chi2_after": _short(after),
        "closed_percent": _short(score.closed_percent(answer.before, after) if comparable else None),
        "closed_test_percent": _short(score.closed_percent(*_test_gap(said)) if comparable else None),
        "why": why,
    }


def _test_gap(said: Mapping[str, Any]) -> tuple[float | None, float | None]:
    """Reduced chi-square before and after on the test part, as reported; None where another method has no such part."""
    gap = said.get("gap") or {}
    before, after = (gap.get(key, {}).get("test") for key in ("before", "after"))
    return before, after


def case_arguments(case: Path, report: Path, prediction: Path) -> list[str]:
    """What `reconcile` is told of a case."""
    files = {
        "--rig": case / "rig.toml",
        "--held-out": case / "held_out.csv",
        "--json": report,
        "--prediction": prediction,
    }
    return [str(case / "log.csv"), *(str(word) for pair in files.items() for word in pair)]


def _short(value: float | None) -> float | None:
    """To six digits: results stay readable."""
    return None if value is None else float(f"{value:.6g}")


def _of_the_truth(truth: frozenset[str], said: Mapping[str, Any]) -> str:
    """How near what is hidden came to the best, where the answer ranks what it tried."""
    ranking = said.get("ranking") or []
    if not ranking or truth - CATALOGUE.keys():
        return ""
    found = next((each for each in ranking if frozenset(each["names"]) == truth), None)
    if found is None:
        return f"the truth is not among the {len(ranking)} best"
    chi2 = ", ".join("-" if found[key] is None else f"{found[key]:.2f}" for key in ("chi2_log", "chi2_held_out"))
    return f"the truth is {found['behind']:.1f} behind the best ({chi2})"


def _after(case: Path, prediction: Path, hidden: dict[str, Any]) -> tuple[float | None, str]:
    try:
        return score.held_out_chi2(case, prediction, hidden.get("clipping", {}).get("full_scale_g")), ""
    except (OSError, ValueError, KeyError) as error:
        return None, f"no prediction: {error}"


def _run(command: list[str], timeout_s: float) -> _Ended:
    """Its largest resident memory is looked up while it runs: what the kernel tells afterwards counts its parent in."""
    begun_s, peak_mib, cpu_before_s = time.monotonic(), 0.0, _children_cpu_s()
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=said)
        try:
            while process.poll() is None and time.monotonic() - begun_s < timeout_s:
                peak_mib = _peak_mib(process.pid) or peak_mib
                time.sleep(LOOK_EVERY_S)
            seconds, in_time = time.monotonic() - begun_s, process.returncode is not None
        finally:
            process.kill()
            process.wait()
        said.seek(0)
        words = said.read().decode(errors="replace").strip()[-LAST_WORDS:]
    return _Ended(process.returncode, words, seconds, peak_mib, in_time, _children_cpu_s() - cpu_before_s)


def _peak_mib(process_id: int) -> float:
    """Of a process until now; 0 where Linux does not tell, or no more."""
    try:
        status = Path(f"/proc/{process_id}/status").read_text()
    except OSError:
        return 0.0
    kib = [float(line.split()[1]) for line in status.splitlines() if line.startswith("VmHWM:")]
    return round(kib[0] / 1024, 1) if kib else 0.0


def _children_cpu_s() -> float:
    """CPU time of this process's finished children, user and system: unlike `seconds` it does not grow with other work."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime
