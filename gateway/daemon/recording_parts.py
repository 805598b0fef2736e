"""The recorder of a gateway by its configuration, and the key that signs its segments."""

from gateway import __version__
from gateway.configuration.model import Configuration
from gateway.configuration.render import to_toml
from gateway.daemon.faults import FaultRegister
from gateway.recording.chain.segment_chain import SegmentChain
from gateway.recording.chain.signing_key import KEY_NAME, MISSING_EXTRA, KeyFileError, fingerprint, load_or_create_key
from gateway.recording.format.header import RecordingHeader
from gateway.recording.segments.events import EventIndex
from gateway.recording.segments.recorder import Recorder

PART = "signing"


def make_recorder(configuration: Configuration, chain: SegmentChain, boot_id: str) -> Recorder:
    """Return the recorder, which has not started yet and has touched no file."""
    section, recorder = configuration.gateway, configuration.recorder
    header = RecordingHeader(
        software=__version__,
        site=section.site,
        crane=section.crane,
        sensor=section.sensor,
        boot_id=boot_id,
        configuration_toml=to_toml(configuration),
    )
    return Recorder(
        section.data_dir,
        header,
        segment_s=recorder.segment_s,
        fsync_s=recorder.fsync_s,
        quota_mb=recorder.quota_mb,
        events=EventIndex(recorder.pre_event_s, recorder.post_event_s),
        chain=chain,
    )


def load_key(configuration: Configuration, chain: SegmentChain, faults: FaultRegister) -> None:
    """Give the chain its key, where it has none yet; the gateway works without it, and says so."""
    if chain.key is not None:
        return
    try:
        chain.key = load_or_create_key(configuration.recorder.key or configuration.gateway.data_dir / KEY_NAME)
    except KeyFileError as error:
        faults.set(PART, f"recordings are not signed: {error}")
    else:
        faults.clear(PART)


def describe_key(chain: SegmentChain, faults: FaultRegister) -> str:
    """Return the public key as text, or why there is none."""
    if chain.key is None:
        return f"no, chained by hashes only: {faults.standing.get(PART, MISSING_EXTRA)}"
    return f"public key {chain.key.public_hex}, fingerprint {fingerprint(chain.key.public_hex)}"
