"""The rules and the dashboard ask only for what a gateway or a fleet exports: names, labels and the values of labels.

The meaning of the rules is tested by `promtool test rules tests/deploy/prometheus_alerts.yml`.
"""

import json
import re
from pathlib import Path
from typing import Any, get_args

import pytest

from gateway.fleet.fleet_servers import format_fleet
from gateway.fleet.gateway_status import missing_gateway
from gateway.messages import CalibrationStatus, Level
from gateway.page.metrics import Counters, format_exposition
from gateway.page.verdict import STYLES
from gateway.topics import TOPICS
from tests.gateway.fleet.test_fleet_metrics import PLACE, everything

DEPLOY = Path(__file__).parents[2] / "deploy"
ALERTS = DEPLOY / "prometheus" / "plumbline-alerts.yml"
RECORDING = DEPLOY / "prometheus" / "plumbline-recording.yml"
DASHBOARD = DEPLOY / "grafana" / "plumbline-fleet.json"
METRIC = r"[a-z_]*:?plumbline_\w+(?::\w+)?"
LINE = re.compile(
    r"(|#.*|groups:|  - name: [a-z-]+|    interval: \d+s|    rules:|      - (alert: \w+|record: [\w:]+)(  # .*)?"
    r"|        expr: .*|        for: \d+[smh]|        labels: \{ severity: (critical|warning|info) \}"
    r"|        annotations:|          summary: \"[^\"]+\")"
)
"""The few forms of YAML in which the rules are written: a file of these lines can be read by every parser."""
WORDS: dict[str, set[str]] = {
    "level": set(get_args(Level)),
    "status": set(get_args(CalibrationStatus)),
    "verdict": set(STYLES),
    "topic": set(TOPICS),
    "statistic": {"p50", "p99", "max"},
}
"""The words that a label can have."""


def exported() -> dict[str, set[str]]:
    """The labels of each metric."""
    gateway = format_exposition(everything(), Counters({"tilt": 1}, 0, 0, 0), PLACE)
    fleet = format_fleet({}, [missing_gateway("plumbline/v1/y/c9/h")], connected=True, invalid=0)
    found: dict[str, set[str]] = {}
    for name, inside in re.findall(r"^(plumbline_\w+)\{(.*)\} ", gateway + fleet, re.M):
        found.setdefault(name, set()).update(re.findall(r'(\w+)="', inside))
    return found


def recorded() -> dict[str, set[str]]:
    """The labels of each recorded series, by the first part of its name."""
    levels = {"sensor": {"site", "crane", "sensor"}, "site": {"site"}, "site_level": {"site", "level"}}
    names = re.findall(r"- record: (\S+)", RECORDING.read_text())
    return {name: levels[name.partition(":")[0]] for name in names}


def expressions(path: Path) -> list[str]:
    if path.suffix == ".yml":
        return re.findall(r"^\s+expr: (.*)$", path.read_text(), re.M)
    content: dict[str, Any] = json.loads(path.read_text())
    variables = [each["query"]["query"] for each in content["templating"]["list"] if each["type"] == "query"]
    return [target["expr"] for panel in content["panels"] for target in panel["targets"]] + variables


@pytest.mark.parametrize("path", [ALERTS, RECORDING, DASHBOARD], ids=lambda path: path.name)
def test_every_metric_label_and_word_is_one_that_is_exported(path: Path) -> None:
    known = exported() | recorded()
    asked = {name for each in expressions(path) for name in re.findall(METRIC, each)}
    assert len(asked) > 6
    assert asked - set(known) == set()
    for expression in expressions(path):
        for name, inside in re.findall(rf"({METRIC})\{{([^}}]*)\}}", expression):
            for label, operator, words in re.findall(r'(\w+)(=~|!=|=)"([^"]*)"', inside):
                assert label in known[name], f"{name} has no {label}"
                if label in WORDS:
                    assert set(words.split("|") if operator == "=~" else [words]) <= WORDS[label]


@pytest.mark.parametrize("path", [ALERTS, RECORDING], ids=lambda path: path.name)
def test_the_rules_are_of_the_simplest_yaml_and_each_has_its_parts(path: Path) -> None:
    text = path.read_text()
    assert [line for line in text.splitlines() if not LINE.fullmatch(line)] == []
    rules = re.split(r"^      - ", text, flags=re.M)[1:]
    names = [rule.split()[1] for rule in rules]
    assert len(set(names)) == len(names)
    for rule in rules:
        assert rule.count("expr: ") == 1
        assert (rule.count("summary: ") + rule.count("severity: ")) == (2 if rule.startswith("alert: ") else 0)


def test_what_names_a_crane_in_an_alert_is_a_label_that_the_expression_keeps() -> None:
    for rule in re.split(r"^      - ", ALERTS.read_text(), flags=re.M)[1:]:
        expression = re.findall(r"expr: (.*)", rule)[0]
        kept = set().union(*(exported()[name] for name in re.findall(METRIC, expression)))
        if expression.startswith("absent"):
            kept = set()
        assert set(re.findall(r"\$labels\.(\w+)", rule)) <= kept


def test_the_dashboard_joins_no_gaps_and_says_what_is_not_known() -> None:
    content = json.loads(DASHBOARD.read_text())
    assert len({panel["id"] for panel in content["panels"]}) == len(content["panels"])
    for panel in content["panels"]:
        defaults = panel["fieldConfig"]["defaults"]
        assert defaults["noValue"] == "not known"
        assert defaults.get("custom", {}).get("spanNulls", False) is False
        assert panel.get("options", {}).get("reduceOptions", {}).get("calcs", ["last"]) == ["last"]
