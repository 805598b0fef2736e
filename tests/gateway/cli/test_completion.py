"""The completion of the command line: scripts that a shell accepts, with every command and option."""

import shutil
import subprocess

import pytest

from gateway.cli.main import COMMANDS, main
from tests.waiting import PATIENCE_S


@pytest.mark.slow
@pytest.mark.parametrize("shell", ["bash", "zsh", "tcsh"])
def test_completion_has_every_command_and_options(capsys: pytest.CaptureFixture[str], shell: str) -> None:
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert [name for name in COMMANDS if name not in script] == []
    assert "--config" in script or "config" in script


def test_bash_completes_a_verb_and_an_option(capsys: pytest.CaptureFixture[str]) -> None:
    """The completion function of the script, called as bash calls it after two words and a press of Tab."""
    bash = shutil.which("bash")
    assert bash is not None, "bash is part of every supported system"
    assert main(["completion", "bash"]) == 0
    script = capsys.readouterr().out
    for words, expected in (
        (["plumbline", "remote", "recal"], "recalibrate"),
        (["plumbline", "measure", "--ri"], "--rig"),
    ):
        quoted = " ".join(words)
        call = (
            f'COMP_WORDS=({quoted}); COMP_CWORD={len(words) - 1}; _shtab_plumbline; printf "%s\\n" "${{COMPREPLY[@]}}"'
        )
        done = subprocess.run(
            [bash, "-c", f"{script}\n{call}"], capture_output=True, text=True, timeout=PATIENCE_S, check=False
        )
        assert expected in done.stdout.split(), done.stderr


def test_an_unknown_shell_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as refusal:
        main(["completion", "fish"])
    assert refusal.value.code == 2
    assert "bash" in capsys.readouterr().err
