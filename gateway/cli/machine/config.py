"""`plumbline config`: show, check and describe the configuration."""

import argparse
import json
import sys
from pathlib import Path

from gateway.cli.command import command, option


@command(
    "show",
    "print the configuration with all defaults, as TOML",
    "Print a configuration with all defaults as TOML. A comment explains each key.",
    "example: plumbline config show my.toml",
    option("file", type=Path, nargs="?", metavar="FILE", help="configuration (default: a simulated crane)"),
)
def run_show(arguments: argparse.Namespace) -> int:
    """Print the configuration."""
    from gateway.configuration.loading import load, to_toml

    sys.stdout.write(to_toml(load(arguments.file)))
    return 0


@command(
    "check",
    "check a configuration file",
    "Check a configuration file. Exit code 0: it can be used; 2: it cannot, with the reason.",
    "example: plumbline config check my.toml",
    option("file", type=Path, metavar="FILE", help="configuration"),
    option("--service", action="store_true", help="also require a sensor, as the service does: no simulated crane"),
)
def run_check(arguments: argparse.Namespace) -> int:
    """Check the file. Raises `ConfigurationError` and `InputError`."""
    from gateway.configuration.bus_section import find_problems
    from gateway.configuration.loading import ConfigurationError, load, missing_files, require_sensor
    from gateway.errors import InputError
    from gateway.languages import missing_texts

    configuration = load(arguments.file)
    if problems := list(find_problems(configuration.bus.tls.files)):
        raise InputError(f"{arguments.file}: {'; '.join(problems)}")
    if arguments.service:
        require_sensor(configuration, str(arguments.file))
    if missing := missing_files(configuration):
        raise ConfigurationError(f"{arguments.file}: {'; '.join(missing)}")
    language = configuration.page.language
    if lacking := missing_texts(language):
        raise ConfigurationError(f"{arguments.file}: page.language: {language}.json lacks {', '.join(lacking)}")
    print(f"{arguments.file}: good; {configuration.device.kind} as {configuration.gateway.key}")
    if configuration.housing_position_m is None:
        print("note: [housing] position_m or above_load_m is not given; without it there is no swing estimate")
    return 0


@command(
    "schema",
    "print a JSON Schema: of the configuration, or of the messages of a topic",
    "Print the JSON Schema of the configuration, or of the messages of a topic.",
    "example: plumbline config schema --topic swing",
    option("--topic", metavar="TOPIC", help="samples, tilt, swing, condition, alert, ..."),
)
def run_schema(arguments: argparse.Namespace) -> int:
    """Print the schema."""
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
