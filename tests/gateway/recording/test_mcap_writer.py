"""The MCAP writer, read with the reader of the format's authors."""

import io
import struct
import zlib

from mcap.reader import make_reader

from gateway.recording.format.mcap_writer import CHUNK_BYTES, McapWriter

SECOND_NS = 1_000_000_000


def written(payload: bytes = b"{}", messages: int = 4) -> io.BytesIO:
    file = io.BytesIO()
    writer = McapWriter(file)
    writer.start("plumbline", "test")
    schema_id = writer.register_schema("plumbline.Test", "jsonschema", b'{"type":"object"}')
    channels = [writer.register_channel(topic, "json", schema_id) for topic in ("/a", "/b")]
    for number in range(messages):
        writer.add_message(channels[number % 2], number, number * SECOND_NS, number * SECOND_NS + 5, payload)
        if number == 1:
            writer.flush()
    writer.add_metadata("origin", {"site": "s"})
    writer.add_attachment(create_time=1, log_time=2, name="file", media_type="text/plain", data=b"text")
    writer.finish()
    file.seek(0)
    return file


def test_the_checksums_are_valid_and_every_message_is_read() -> None:
    reader = make_reader(written(), validate_crcs=True)
    read = [(channel.topic, message.sequence, message.log_time) for _, channel, message in reader.iter_messages()]
    assert read == [("/a", 0, 0), ("/b", 1, SECOND_NS), ("/a", 2, 2 * SECOND_NS), ("/b", 3, 3 * SECOND_NS)]
    assert [attachment.data for attachment in reader.iter_attachments()] == [b"text"]
    assert [record.metadata for record in reader.iter_metadata()] == [{"site": "s"}]


def test_the_statistics_count_what_was_written() -> None:
    summary = make_reader(written()).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.channel_message_counts == {1: 2, 2: 2}
    assert (summary.statistics.chunk_count, len(summary.chunk_indexes)) == (2, 2)
    assert (summary.statistics.message_start_time, summary.statistics.message_end_time) == (0, 3 * SECOND_NS)


def test_messages_are_found_by_time_and_topic() -> None:
    reader = make_reader(written())
    found = [message.sequence for _, _, message in reader.iter_messages(["/a"], starting_at=SECOND_NS)]
    assert found == [2]


def test_a_long_chunk_ends_by_itself() -> None:
    summary = make_reader(written(payload=bytes(CHUNK_BYTES), messages=6)).get_summary()
    assert summary is not None
    assert len(summary.chunk_indexes) == 6


def test_the_footer_holds_the_checksum_of_the_summary() -> None:
    data = written().getvalue()
    summary_start, _, crc = struct.unpack("<QQI", data[-28:-8])
    assert zlib.crc32(data[summary_start:-12]) == crc
