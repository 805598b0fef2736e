"""Effects of the user: loaded, refused with the correction, simulated, found."""

import json
import re
import shlex
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

from gateway.cli.main import main
from gateway.errors import InputError
from gateway.twin import effect_loading
from gateway.twin.effect_loading import check_equations, load_effect_file, load_installed_effects
from gateway.twin.effects import EFFECTS, EventWindow, GuessContext
from gateway.twin.effects.guess_context import SHARPEST
from gateway.twin.model import TwinRig
from gateway.twin.simulator.simulator import Simulator
from tests.documentation.examples import sections

pytestmark = pytest.mark.usefixtures("vocabulary")

HOW_TO = Path(__file__).parents[3] / "docs" / "development" / "add_an_effect.md"
HEAD = "import casadi\nimport math\nfrom gateway.twin.effects import *\nfrom gateway.twin.effects import Effect, Parameter\n"
BODY = """
class Push(Effect):
    name = "push"
    equation = "F/m = (a, 0, 0)"
    explains = "Something pushes."
    reference = "Newton's second law"
    enters = "force on the load"
    parameters = (Parameter("accel", "m/s²", "a", -1.0, 1.0, 0.0, 0.01, 0.1),)

    def force_m_s2(self, p, context, load):
        return p["accel"], 0.0, 0.0
"""


def page_block(language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", HOW_TO.read_text(), re.DOTALL)
    assert found is not None
    return found[1]


def page_commands() -> list[list[str]]:
    return [shlex.split(command.text)[1:] for commands in sections(HOW_TO).values() for command in commands]


@pytest.fixture
def workshop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files of the page."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tag_line.py").write_text(page_block("python"))
    (tmp_path / "rig.toml").write_text(page_block("toml"))
    return tmp_path


def written(tmp_path: Path, text: str, name: str = "mine.py") -> Path:
    path = tmp_path / name
    path.write_text(HEAD + text)
    return path


@pytest.mark.slow
def test_effect_of_the_how_to_is_simulated_and_named_with_its_parameters(workshop: Path) -> None:
    simulate, reconcile = page_commands()
    assert main(simulate) == 0
    assert main(reconcile) == 0
    result = json.loads((workshop / "result.json").read_text())
    assert result["verdict"] == "named"
    (effect,) = result["effects"]
    assert effect["name"] == "tag_line"
    low, high = np.array(effect["parameters"]["stiffness_1_s2"]["ci95"])
    assert (low <= [0.02, 0.01, 0.005]).all()
    assert (high >= [0.02, 0.01, 0.005]).all()
    assert ["tag_line"] in [each["names"] for each in result["ranking"]]
    report = (workshop / "report.html").read_text()
    assert "A taut tag line pulls the load back" in report
    assert "F/m = −K (x, y, 0), K symmetric" in report
    again = ["simulate", "model.toml", "--out", "again.csv", "--duration", "10"]
    assert main([*again, "--effects-from", "tag_line.py"]) == 0
    for source in EFFECTS.sources - {"the vocabulary"}:
        EFFECTS.unregister(source)
    assert main(again) == 2


@pytest.mark.slow
def test_effect_of_the_how_to_is_not_named_when_another_effect_acts(workshop: Path) -> None:
    assert main(["simulate", "rig.toml", "--out", "log.csv", "--effect", "quadratic_drag:drag_per_m=0.02"]) == 0
    code = main(["reconcile", "log.csv", "--rig", "rig.toml", "--effects-from", "tag_line.py", "--json", "result.json"])
    assert code == 0
    result = json.loads((workshop / "result.json").read_text())
    assert [each["name"] for each in result["effects"]] == ["quadratic_drag"]


@pytest.mark.slow
def test_effect_of_the_user_is_planned_for(workshop: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code = main(
        ["reconcile", "--plan", "rig.toml", "--effects", "tag_line,rope_length", "--effects-from", "tag_line.py"]
    )
    assert code == 0
    assert "tag line / rope length" in capsys.readouterr().out


@pytest.mark.slow
def test_event_of_the_user_is_named_with_its_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No hook says where to look for it: times come from the changepoints."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rig.toml").write_text(page_block("toml"))
    written(
        tmp_path,
        """
class SecondHoist(PulseEffect):
    name = "second_hoist"
    equation = "F/m = (0, 0, a w(t))"
    explains = "A second hoist carries part of the load's weight for some seconds."
    reference = "Newton's second law"
    enters = "force on the load"
    parameters = (
        Parameter("lift_m_s2", "m/s²", "a", 0.0, 8.0, 0.0, 0.01, 1.0), start(30.0), duration(10.0), ramp_fraction(0.2)
    )

    def force_m_s2(self, p, context, load):
        return 0.0, 0.0, p["lift_m_s2"] * self.pulse(p).value(context)
""",
    )
    effect = ["--effects-from", "mine.py", "--effect", "second_hoist:lift_m_s2=2", "--duration", "60"]
    assert main(["simulate", "rig.toml", "--out", "log.csv", *effect]) == 0
    assert main(["simulate", "rig.toml", "--out", "second.csv", "--seed", "5", *effect]) == 0
    arguments = ["--rig", "rig.toml", "--effects-from", "mine.py", "--json", "result.json"]
    assert main(["reconcile", "log.csv", "--held-out", "second.csv", *arguments]) == 0
    (found,) = json.loads((tmp_path / "result.json").read_text())["effects"]
    assert found["name"] == "second_hoist"
    assert found["when_s"] == pytest.approx([30.0, 40.0], abs=0.3)
    low, high = found["parameters"]["lift_m_s2"]["ci95"]
    assert low <= 2.0 <= high


@pytest.mark.slow
@pytest.mark.parametrize("name", EFFECTS)
def test_built_in_effect_passes_the_checks_of_the_users_effects(name: str) -> None:
    check_equations(EFFECTS[name], "here")


def test_file_is_loaded_once_and_acts_after_the_vocabulary(tmp_path: Path) -> None:
    path = written(tmp_path, BODY)
    assert load_effect_file(path) == ("push",)
    assert load_effect_file(tmp_path / ".." / tmp_path.name / "mine.py") == ("push",)
    assert list(EFFECTS)[-1] == "push"
    simulator = Simulator(TwinRig(12.0, 0.0), ("push",))
    time_s = np.arange(0, 5, 0.1)
    leaning = simulator.predict(simulator.values([], {"push": {"accel": 0.1}}), time_s)
    assert leaning[:, 0].max() > 0.005


def test_two_effects_in_one_file_keep_their_order_and_a_base_class_is_none(tmp_path: Path) -> None:
    text = "\nclass Base(Effect):\n    enters = 'force on the load'\n" + BODY.replace("(Effect)", "(Base)")
    text += "\nclass Another(Push):\n    name = 'another'\n"
    assert load_effect_file(written(tmp_path, text)) == ("push", "another")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = (", r"mine\.py: SyntaxError: '\(' was never closed \(line 5\)"),
        ("\nx = 1 / 0", r"mine\.py: ZeroDivisionError: division by zero \(line 6\)"),
        ("import no_such_module", r"mine\.py: ModuleNotFoundError: No module named 'no_such_module' \(line 5\)"),
        ("raise SystemExit(3)", r"mine\.py: SystemExit: 3 \(line 5\)"),
        ("", r"mine\.py: defines no effect; write a subclass of gateway\.twin\.effects\.Effect"),
        (BODY.replace('name = "push"', ""), "Push has no name; set it to a text"),
        (BODY.replace("equation", "law"), "Push has no equation"),
        (BODY.replace('"push"', '"Push me"'), "is named 'Push me'; use lower-case letters"),
        (BODY.replace('"push"', '"impact"'), "the name impact is in use by the vocabulary; choose another name"),
        (BODY + BODY.replace("Push", "Pull"), "the name push is in use by --effects-from .*mine.py"),
        (BODY.replace("-1.0, 1.0", "1.0, -1.0"), r"wrong parameter 'accel': lower = 1 should be below upper = -1"),
        (BODY.replace("1.0, 0.0, 0.01", "1.0, 2.0, 0.01"), "neutral = 2 should be from -1 to 1"),
        (BODY.replace("0.01, 0.1", "0.0, 0.1"), "scale = 0 should be above 0"),
        (BODY.replace("0.01, 0.1", "0.01, 3.0"), "typical = 3.0 should be from -1 to 1"),
        (BODY.replace("0.1)", "(0.1, 0.2))"), r"typical = \(0.1, 0.2\) should be one number"),
        (BODY.replace("0.1),)", "0.1),) * 2"), "has 2 parameters 'accel'; rename one"),
        (BODY.replace("parameters =", "transient = True\n    parameters ="), "is transient and has no start"),
        (BODY.replace("0.1),)", "0.1), start(5.0))"), "has start_s and is not transient"),
        (BODY.replace("parameters =", "structure = ModelStructure.RIGGING\n    parameters ="), "the hook rigging"),
        (BODY + "    def __init__(self, size): pass\n", r"Push\(\) fails: TypeError: .* missing 1 required"),
        (BODY.replace('p["accel"]', 'p["acel"]'), r"equations of the effect push fail: KeyError: 'acel' \(line 15\)"),
        (BODY.replace('p["accel"]', 'math.tanh(p["accel"])'), "use functions of CasADi, not of math"),
        (BODY.replace('p["accel"],', 'abs(p["accel"]) if p["accel"] > 0 else 0.0,'), r"push fail: .*\(line 15\)"),
        (BODY.replace('p["accel"], 0.0, 0.0', 'p["accel"], 0.0'), "the effect push fail"),
        (BODY.replace('p["accel"],', 'casadi.erfinv(p["accel"]),'), "uses the operation erfinv of CasADi"),
        (BODY.replace('p["accel"],', 'casadi.log(-p["accel"] ** 2),'), "not finite at its typical values"),
        (BODY.replace('p["accel"],', 'p["accel"] + 0.1,'), "changes the samples by .* g at its neutral values"),
        (BODY.replace('p["accel"],', 'p["accel"] ** 2,'), "has no sensitivity at its neutral values"),
        (BODY.replace('p["accel"],', 'casadi.sqrt(p["accel"]),'), "not finite at its neutral values"),
        (BODY + "    def initial_guesses(self, context): return [{'a': 1.0}]\n", "guesses a, which is no parameter"),
    ],
)
def test_wrong_file_is_refused_with_the_correction_and_adds_nothing(tmp_path: Path, text: str, message: str) -> None:
    before = dict(EFFECTS)
    with pytest.raises(InputError, match=message) as caught:
        load_effect_file(written(tmp_path, text))
    assert "\n" not in str(caught.value)
    assert dict(EFFECTS) == before


def test_missing_file_and_file_of_another_kind_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no such file"):
        load_effect_file(tmp_path / "none.py")
    with pytest.raises(InputError, match=r"its name should end in \.py"):
        load_effect_file(written(tmp_path, BODY, "mine.txt"))


def test_two_files_with_the_same_name_of_an_effect_are_refused(tmp_path: Path) -> None:
    load_effect_file(written(tmp_path, BODY))
    with pytest.raises(InputError, match=r"other\.py: the name push is in use by --effects-from .*mine\.py"):
        load_effect_file(written(tmp_path, BODY, "other.py"))


def test_bad_file_is_one_line_on_the_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rig.toml").write_text(page_block("toml"))
    assert main(["simulate", "rig.toml", "--out", "log.csv", "--effects-from", "none.py"]) == 2
    assert main(["simulate", "rig.toml", "--out", "log.csv", "--effect", "tag_line"]) == 2
    errors = capsys.readouterr().err.splitlines()
    assert len(errors) == 2
    assert "none.py: there is no such file" in errors[0]
    assert "an effect of your own needs --effects-from FILE.py" in errors[1]
    assert not (tmp_path / "log.csv").exists()


@pytest.mark.slow
def test_effects_are_listed_and_described_with_those_of_the_user(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, BODY)
    assert main(["effects", "--effects-from", str(path)]) == 0
    listed = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in listed] == list(EFFECTS)
    assert listed[-1].endswith("Something pushes.")
    assert main(["effects", "steady_wind"]) == 0
    assert "accel_m_s2 [x, y]: a, force over the load's mass; -2 to 2 m/s², typical 0.2,0" in capsys.readouterr().out
    assert main(["effects", "storm"]) == 2
    assert "'storm' is no effect; known are axis_offset" in capsys.readouterr().err


def test_installed_package_offers_its_effects_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written(tmp_path, BODY, "some_package.py")
    monkeypatch.syspath_prepend(tmp_path)
    offered = [EntryPoint("push", "some_package:Push", effect_loading.ENTRY_POINT_GROUP)]
    monkeypatch.setattr(effect_loading, "entry_points", lambda group: offered)
    assert load_installed_effects() == load_installed_effects() == ("push",)
    offered[:] = [EntryPoint("pull", "some_package:Pull", effect_loading.ENTRY_POINT_GROUP)]
    with pytest.raises(InputError, match=r"some_package:Pull of plumbline\.effects: .*mend or uninstall"):
        load_installed_effects()


def test_event_without_guesses_of_its_own_starts_at_changepoints_and_windows(tmp_path: Path) -> None:
    text = BODY.replace("parameters =", "transient = True\n    parameters =").replace(
        "0.1),)",
        "0.1), Parameter('begin', 's', 't', 0.0, 1e6, 0.0, 0.1, 3.0, kind=ParameterKind.START),"
        " Parameter('first', 's', 't', 0.1, 60.0, 1.0, 0.1, 3.0, kind=ParameterKind.DURATION),"
        " Parameter('then', 's', 't', 0.1, 60.0, 1.0, 0.1, 3.0, kind=ParameterKind.DURATION),"
        " Parameter('edge', '1', 's', 0.01, 1.0, 0.5, 0.1, 0.5, kind=ParameterKind.EDGE))",
    )
    load_effect_file(written(tmp_path, text))
    effect, time_s = EFFECTS["push"], np.arange(0, 60, 0.1)
    nothing = np.zeros((len(time_s), 3))
    windows = (EventWindow(10.0, 11.0, 0.0), EventWindow(9.0, 13.0, 0.0))
    context = GuessContext(12.0, 9.8, time_s, nothing, np.ones(3), nothing, windows, EventWindow(10.0, 16.0, 0.0))
    first, sharp, in_window = effect.initial_guesses(context)
    assert first == pytest.approx({"begin": 10.013, "first": 3.0, "then": 3.0})
    assert sharp == pytest.approx({**first, "edge": SHARPEST})
    assert in_window == pytest.approx({"begin": 9.013, "first": 2.0, "then": 2.0, "edge": SHARPEST})
    assert effect.interval_s({"begin": 9.0, "first": 2.0, "then": 3.0}) == (9.0, 14.0)
    assert effect.shift_start({"begin": 9.0, "first": 2.0}, 5.0) == {"begin": 4.0, "first": 2.0}
