"""Printed commands that are not run, each with the reason; what they name must exist all the same."""

from tests.documentation.examples import Command

BY_BEGINNING = {
    "echo ": "writes files of /etc as root",
    "sudo ": "changes the machine as root: packages, users, services, files of /etc",
    "sudoedit ": "opens an editor as root",
    "journalctl ": "needs the log of systemd",
    "git clone ": "needs a network",
    "script/": "makes an environment, or runs for minutes to hours; the continuous integration is script/test",
    "python -m tests.": "measures for minutes to hours",
    "dask ": "needs the machines of a cluster",
    "plumbline archive replay s3://": "needs the machines of a cluster",
    "plumbline record verify FOLDER": "needs an authority for time stamps; tests/system/test_time_stamps.py has one",
    "plumbline remote rollback": "needs a recalibration before; tests/system/test_recalibration.py has one",
    "plumbline remote status --gateway": "needs a gateway that was set up twice; tests/system/test_forged_messages.py has one",
    "plumbline remote recalibrate --by ann --housing-off-rope --connect": "the rehearsal; commands over TLS are in "
    "tests/system/test_tls_site.py",
    "plumbline fleet deflection plumbline/": "needs two gateways; tests/system/test_fleet_deflection.py runs it",
}
BY_SECTION = {
    "docs/guides/service/recalibration.md#Rehearse it": "run twice in a row by tests/system/test_rehearsal.py",
    "docs/guides/service/installation.md#5. Calibrate and align": "the same commands as in the rehearsal",
    "docs/development/add_an_effect.md#2. Simulate it": "run by tests/gateway/twin/test_user_effects.py",
    "docs/development/add_an_effect.md#3. Find it in a recording": "run by tests/gateway/twin/test_user_effects.py",
}
ELSEWHERE = {
    "README.md": {
        "plumbline record replay": "docs/guides/investigator/recordings.md",
        "plumbline measure phone.csv": "docs/guides/investigator/read_other_recordings.md",
        "plumbline reconcile log.csv": "docs/guides/investigator/twin.md",
    },
    "docs/guides/integrator/plc_codesys.md": {"plumbline bridge modbus": "docs/guides/integrator/plant.md"},
    "docs/guides/integrator/plc_siemens_s7.md": {"plumbline bridge modbus": "docs/guides/integrator/plant.md"},
    "docs/guides/service/installation.md": {"plumbline doctor": "README.md"},
}
"""Beginnings of commands by page, each with the page on which the same command is run, on files of the same kind."""


def parts_to_run(command: Command, section: str) -> list[str]:
    """Return the parts of a command, joined by `&&`, that are run."""
    if section in BY_SECTION:
        return []
    first, *others = command.text.split(" && sudo ")
    parts = [first, *(f"sudo {other}" for other in others)]
    elsewhere = ELSEWHERE.get(section.partition("#")[0], {})
    return [part for part in parts if not part.startswith((*BY_BEGINNING, *elsewhere))]
