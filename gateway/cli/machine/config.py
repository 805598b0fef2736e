"""`plumbline config`: show, check and describe the configuration."""

import argparse
import json
import sys
from pathlib import Path


def add_to(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command with its verbs."""
    command = commands.add_parser(
        "config",
        help="show, check or describe the configuration",
        description="Show, check or describe the configuration of the gateway.",
        epilog="examples: plumbline config show > my.toml | plumbline config check my.toml | plumbline config schema",
    )
    verbs = command.add_subparsers(dest="verb", metavar="VERB", required=True)
    show = verbs.add_parser(
        "show",
        help="print the configuration with all defaults, as TOML",
        description="Print a configuration with all defaults as TOML. A comment explains each key.",
        epilog="example: plumbline config show my.toml",
    )
    show.add_argument("file", type=Path, nargs="?", metavar="FILE", help="configuration (default: a simulated crane)")
    show.set_defaults(run=_show)
    check = verbs.add_parser(
        "check",
        help="check a configuration file",
        description="Check a configuration file. Exit code 0: it can be used; 2: it cannot, with the reason.",
        epilog="example: plumbline config check my.toml",
    )
    check.add_argument("file", type=Path, metavar="FILE", help="configuration")
    check.add_argument(
        "--service", action="store_true", help="also require a sensor, as the service does: no simulated crane"
    )
    check.set_defaults(run=_check)
    schema = verbs.add_parser(
        "schema",
        help="print a JSON Schema: of the configuration, or of the messages of a topic",
        description="Print the JSON Schema of the configuration, or of the messages of a topic.",
        epilog="example: plumbline config schema --topic swing",
    )
    schema.add_argument("--topic", metavar="TOPIC", help="samples, tilt, swing, condition, alert, ...")
    schema.set_defaults(run=_schema)


def _show(arguments: argparse.Namespace) -> int:
    from gateway.configuration.loading import load, to_toml

    sys.stdout.write(to_toml(load(arguments.file)))
    return 0


def _check(arguments: argparse.Namespace) -> int:
    from gateway.configuration.bus_section import find_problems
    from gateway.configuration.loading import ConfigurationError, load, missing_files, require_sensor
    from gateway.errors import InputError

    configuration = load(arguments.file)
    if problems := list(find_problems(configuration.bus.tls.files)):
        raise InputError(f"{arguments.file}: {'; '.join(problems)}")
    if arguments.service:
        require_sensor(configuration, str(arguments.file))
    if missing := missing_files(configuration):
        raise ConfigurationError(f"{arguments.file}: {'; '.join(missing)}")
    print(f"{arguments.file}: good; {configuration.device.kind} as {configuration.gateway.key}")
    if configuration.housing_position_m is None:
        print("note: [housing] position_m or above_load_m is not given; without it there is no swing estimate")
    return 0


def _schema(arguments: argparse.Namespace) -> int:
    from gateway.configuration.model import Configuration
    from gateway.errors import InputError
    from gateway.topics import TOPICS, json_schema

    if arguments.topic is None:
        schema = Configuration.model_json_schema()
    elif arguments.topic in TOPICS:
        schema = json_schema(arguments.topic)
    else:
        raise InputError(f"no topic {arguments.topic!r}; the topics are {', '.join(TOPICS)}")
    print(json.dumps(schema, indent=2))
    return 0
