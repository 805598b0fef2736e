"""`plumbline record recover` and `export`: a complete recording from an incomplete one; CSV, Parquet, or MCAP for viewers."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.command import command, one_of, option
from gateway.cli.output import output_file
from gateway.cli.recording_options import SELECTION_OPTIONS, interval
from gateway.errors import WITH_LOSSES

if TYPE_CHECKING:
    from gateway.recording.reading.recording_file import Selection
    from gateway.recording.reading.timeline import ReportProgress, Timeline

EXPORT_EXAMPLE = """examples:
  plumbline record export plumbline-data --csv samples.csv --last 10:00
  plumbline record export plumbline-data --csv motion.csv --topic motion
  plumbline record export plumbline-data/*.mcap --mcap full_rate.mcap --from 07:30:00 --to 07:35:00"""


@command(
    "recover",
    "write a complete recording from an incomplete one",
    "Write a complete recording from an incomplete one, beside it as NAME.recovered.mcap unless --out names "
    "another file. Exit code 3: something of it could not be read.",
    "example: plumbline record recover incomplete.mcap",
    option("log", type=Path, metavar="LOG", help=".mcap written by the gateway"),
    option("--out", type=output_file, metavar="FILE", help="the new recording (default: NAME.recovered.mcap)"),
)
def run_recover(arguments: argparse.Namespace) -> int:
    """Recover a recording; return 3 where something of it could not be read."""
    from gateway.recording.format.salvage import describe_losses
    from gateway.recording.segments.copying import NothingRecordedError, recover, recovered_path

    out = arguments.out or recovered_path(arguments.log)
    try:
        recovered = recover(arguments.log, out)
    except NothingRecordedError as nothing:
        print(nothing)
        return 0
    losses = recovered.losses
    print(f"{out}: {', '.join([f'{recovered.messages} messages recovered', *describe_losses(losses)])}")
    return WITH_LOSSES if losses.torn_bytes or losses.damaged_records or losses.unreadable_messages else 0


@command(
    "export",
    "write calibrated acceleration at full rate, or a topic, as CSV, Parquet or MCAP",
    "Write the calibrated specific force at full rate, in g in the housing frame, or the messages of a topic. "
    "Each part of the recording is calibrated by the record that was in force. Exit code 3: something could not be read, or a "
    "segment is missing in the middle.",
    EXPORT_EXAMPLE,
    *SELECTION_OPTIONS,
    one_of(
        option(
            "--csv",
            type=output_file,
            metavar="FILE",
            help="time_s,ax_g,ay_g,az_g[,temperature_c], seconds from the first sample of the recording; `measure` reads it",
        ),
        option(
            "--parquet",
            type=output_file,
            metavar="FILE",
            help="the same with UTC; needs the extra parquet",
        ),
        option(
            "--mcap",
            type=output_file,
            metavar="FILE",
            help="for Foxglove, Lichtblick and PlotJuggler: /acceleration_samples with one message per sample, and "
            "all other topics",
        ),
        required=True,
    ),
    option("--topic", metavar="NAME", help="a table of this topic in place of the samples (motion, swing, alert, ...)"),
)
def run_export(arguments: argparse.Namespace) -> int:
    """Export the recordings; return 3 where something of them could not be read."""
    from gateway.cli.progress import ProgressBar
    from gateway.errors import InputError
    from gateway.recording.chain.missing_files import describe_hidden
    from gateway.recording.reading.timeline import open_timeline

    target = next(path for path in (arguments.csv, arguments.parquet, arguments.mcap) if path is not None)
    if arguments.parquet is not None:
        from gateway.extras import require_extra

        require_extra("parquet")
    timeline = open_timeline(arguments.paths)
    if target.resolve() in {segment.path.resolve() for segment in timeline.segments}:
        raise InputError(f"{target}: is one of the recordings; choose another name")
    selection = timeline.select(interval(arguments))
    with ProgressBar(f"writing {target}") as bar:
        count, notes, has_losses = _write(arguments, timeline, selection, bar.update)
    hidden = describe_hidden(timeline, selection)
    for note in (*timeline.remarks, *hidden, *notes):
        print(f"plumbline record: {note}", file=sys.stderr)
    print(f"{target}: {count} {'messages' if arguments.topic else 'samples'}")
    return WITH_LOSSES if has_losses or hidden else 0


def _write(
    arguments: argparse.Namespace, timeline: "Timeline", selection: "Selection", report: "ReportProgress"
) -> tuple[int, list[str], bool]:
    """Write the file; return the number of rows, remarks on the content, and whether something could not be read."""
    from gateway import __version__
    from gateway.errors import InputError
    from gateway.recording.export.mcap_export import write_mcap
    from gateway.recording.export.tables import samples_table, topic_table, write_csv, write_parquet
    from gateway.recording.reading.sample_calibration import CalibratedReader
    from gateway.topics import TOPICS

    description = {"from": timeline.name, "gateway": timeline.gateway, "software": f"plumbline {__version__}"}
    reader = CalibratedReader(timeline, selection)
    if arguments.mcap is not None:
        if arguments.topic is not None:
            raise InputError("--topic: an MCAP contains every topic; leave --topic out, or choose --csv or --parquet")
        count = write_mcap(arguments.mcap, timeline, selection, reader, description, report)
        return count, reader.remarks(), reader.has_losses
    origin_ns = timeline.span().first_ns
    if arguments.topic is None:
        table = samples_table(reader, origin_ns, with_utc=arguments.parquet is not None, report=report)
    elif arguments.topic in TOPICS:
        table = topic_table(timeline, arguments.topic, selection, origin_ns, report)
    else:
        raise InputError(f"--topic {arguments.topic}: is not a topic; choose one of {', '.join(TOPICS)}")
    is_csv = arguments.csv is not None
    count = write_csv(arguments.csv, table) if is_csv else write_parquet(arguments.parquet, table, description)
    return count, reader.remarks(), reader.has_losses
