"""Modbus TCP: the register map, and a server that stands floods, malformed frames and clients that do not read.

Every register in the programs of the guides for controllers is the one of the map.
"""

import asyncio
import math
import random
import re
import socket
import struct
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from pymodbus.client import ModbusTcpClient

from gateway.bridge.modbus_server import NOT_KNOWN, REGISTERS, ModbusServer, encode_registers
from gateway.bridge.plant_snapshot import LEVEL_CODES, STATE_CODES, PlantSnapshot, PlantState
from gateway.bridge.plant_values import PLANT_VALUES
from gateway.bridge.settings import ModbusSection
from tests.gateway.bridge.modbus_client import ModbusClient, ModbusRefusedError
from tests.ports import unused_port
from tests.waiting import wait_until

FINE = PlantSnapshot(
    state=PlantState.FINE,
    source="sensor",
    heartbeat=4711,
    age_s=0.0512,
    level="warn",
    active_alerts=1,
    alert_number=70_000,
    boot_id="b00t",
    angle_deg=4.126,
    angle_u95_deg=0.1,
    phi_max_deg=5.5,
    time_to_peak_s=1.25,
    calibration_age_days=12.4,
    battery_v=3.61,
)
GONE = PlantSnapshot(state=PlantState.GATEWAY_GONE, heartbeat=4711, age_s=99.0)
FOLDER = Path(__file__).parents[3] / "docs" / "guides" / "integrator"
GUIDES = ("plc_siemens_s7", "plc_codesys")
REGISTER_OF = {value.name: value.register for value in PLANT_VALUES}


class Serving:
    """The server in a thread, with what it is to say."""

    def __init__(self, **settings: float | list[str]) -> None:
        self.port = unused_port()
        self.snapshot, self.looks = FINE, 0
        self._server = ModbusServer(
            ModbusSection.model_validate({"listen": f"127.0.0.1:{self.port}", **settings}), self._look
        )
        self._loop = asyncio.new_event_loop()
        started = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(started,), daemon=True)
        self._thread.start()
        assert started.wait(10)

    def _look(self) -> PlantSnapshot:
        self.looks += 1
        return self.snapshot

    def _run(self, started: threading.Event) -> None:
        self._task = self._loop.create_task(self._server.serve(started.set))
        try:
            self._loop.run_until_complete(self._task)
        except asyncio.CancelledError:
            self._loop.run_until_complete(self._end())

    async def _end(self) -> None:
        """Let the connections end, also one that was just accepted."""
        while others := asyncio.all_tasks() - {asyncio.current_task()}:
            await asyncio.gather(*others, return_exceptions=True)
        await asyncio.sleep(0.01)  # sockets are closed a turn later

    def stop(self) -> None:
        self._loop.call_soon_threadsafe(self._task.cancel)
        self._thread.join()
        self._loop.close()


@pytest.fixture
def serving() -> Iterator[Serving]:
    serving = Serving(max_connections=4, idle_s=0.5)
    yield serving
    serving.stop()


def test_the_gateway_is_followed_before_a_client_asks(serving: Serving) -> None:
    wait_until(lambda: serving.looks > 2, "looks at what is known")


def test_no_two_values_share_a_register_and_all_are_read_at_once() -> None:
    used = [value.register + k for value in PLANT_VALUES for k in range(value.words)]
    used += [value.float_register + k for value in PLANT_VALUES if value.float_register is not None for k in range(2)]
    assert len(set(used)) == len(used)
    assert max(used) == REGISTERS - 1 < 125


def test_the_largest_value_of_every_row_fits_and_is_not_the_one_for_not_known() -> None:
    for value in PLANT_VALUES:
        if value.name != "heartbeat":  # which is always known
            assert round(value.high / value.step) < (NOT_KNOWN if value.words == 1 else 0xFFFF_FFFF)


def test_the_registers_state_what_is_known() -> None:
    registers = struct.unpack(">52H", encode_registers(FINE))
    assert registers[:17] == (
        1,
        1,
        4711,
        51,
        2,
        1,
        413,
        10,
        550,
        NOT_KNOWN,
        NOT_KNOWN,
        NOT_KNOWN,
        125,
        1,
        12,
        NOT_KNOWN,
        3610,
    )
    assert (registers[17] << 16) + registers[18] == 70_000
    (angle_deg,) = struct.unpack(">f", struct.pack(">2H", *registers[32:34]))
    assert angle_deg == pytest.approx(4.126)


def test_what_is_not_known_is_no_number_and_beyond_every_limit_as_an_integer() -> None:
    content = encode_registers(GONE)
    registers, signed = struct.unpack(">52H", content), struct.unpack(">52h", content)
    assert registers[1] == 7
    assert registers[3] == 32_766
    assert registers[4] == 0
    assert all(number == NOT_KNOWN for number in (*signed[5:13], *registers[5:13]))
    assert all(math.isnan(number) for number in struct.unpack(">10f", content[64:]))


def test_an_independent_client_reads_the_map(serving: Serving) -> None:
    client = ModbusTcpClient("127.0.0.1", port=serving.port)
    assert client.connect()
    found = client.read_input_registers(0, count=REGISTERS)
    assert not found.isError()
    assert found.registers == list(struct.unpack(">52H", encode_registers(FINE)))
    assert client.write_register(6, 0).exception_code == 1
    assert client.read_holding_registers(0, count=1).exception_code == 1
    client.close()


def test_every_answer_is_of_its_moment(serving: Serving) -> None:
    with ModbusClient(serving.port) as client:
        assert client.read(6, 1) == [413]
        serving.snapshot = GONE
        assert client.read(6, 1) == [NOT_KNOWN]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pdu", "code"),
    [
        (struct.pack(">BHH", 6, 6, 0), 1),
        (struct.pack(">BHHBH", 16, 6, 1, 2, 0), 1),
        (struct.pack(">BHH", 3, 0, 1), 1),
        (bytes((43, 14, 1, 0)), 1),
        (b"\x00", 1),
        (struct.pack(">BHH", 4, 0, 53), 2),
        (struct.pack(">BHH", 4, 65_535, 2), 2),
        (struct.pack(">BHH", 4, 0, 0), 3),
        (struct.pack(">BHH", 4, 0, 126), 3),
        (struct.pack(">BH", 4, 0), 3),
    ],
)
def test_a_request_for_anything_else_is_refused_and_the_connection_stays(
    serving: Serving, pdu: bytes, code: int
) -> None:
    with ModbusClient(serving.port) as client:
        with pytest.raises(ModbusRefusedError) as refused:
            client.ask(pdu)
        assert refused.value.args == (code,)
        assert client.read(1, 1) == [1]


def test_several_requests_in_one_segment_are_all_answered(serving: Serving) -> None:
    with ModbusClient(serving.port) as client:
        client.socket.sendall(b"".join(struct.pack(">HHHBBHH", k, 0, 6, 1, 4, 1, 1) for k in range(5)))
        answers = [client.receive(11) for _ in range(5)]
    assert [struct.unpack(">H", each[:2])[0] for each in answers] == list(range(5))


@pytest.mark.parametrize(
    "frame", [b"\0\1\0\0\0\0\1", b"\0\1\0\0\0\1\1", b"\0\1\0\7\0\6\1", b"\0\1\0\0\xff\xff\1", b"GET / H"]
)
def test_a_malformed_frame_closes_the_connection_at_once(serving: Serving, frame: bytes) -> None:
    with ModbusClient(serving.port) as client:
        client.socket.sendall(frame)
        with pytest.raises((EOFError, ConnectionResetError)):
            client.receive(1)


def is_answered(port: int) -> bool:
    with ModbusClient(port) as client:
        try:
            return client.read(1, 1) == [1]
        except (EOFError, OSError):
            return False


@pytest.mark.slow
def test_silent_connections_are_closed_and_make_room(serving: Serving) -> None:
    held = [socket.create_connection(("127.0.0.1", serving.port)) for _ in range(4)]
    assert not is_answered(serving.port)
    wait_until(lambda: is_answered(serving.port), "room for a connection")
    for each in held:
        assert each.recv(1) == b""
        each.close()


@pytest.mark.slow
def test_idle_connections_make_room_for_others_and_leave_one_in_use_alone() -> None:
    serving = Serving(max_connections=4, idle_s=3600)
    held = [socket.create_connection(("127.0.0.1", serving.port)) for _ in range(3)]
    with ModbusClient(serving.port) as client:
        for _ in range(4):
            held.append(socket.create_connection(("127.0.0.1", serving.port)))
            wait_until(lambda: client.read(1, 1) == [1] and is_answered(serving.port), "room for a connection")
    for each in held:
        each.close()
    serving.stop()


def test_only_clients_that_are_named_are_answered_and_others_counted(caplog: pytest.LogCaptureFixture) -> None:
    named, others = Serving(clients=["10.0.0.7", "127.0.0.0/8"]), Serving(clients=["10.0.0.0/24"])
    assert is_answered(named.port)
    assert [is_answered(others.port) for _ in range(10)] == [False] * 10
    lines = [record.getMessage() for record in caplog.records]
    refusal = "127.0.0.1 is refused: it is not among modbus.clients"
    assert [line for line in lines if "refused" in line] == [f"{refusal} (1 so far)", f"{refusal} (10 so far)"]
    named.stop()
    others.stop()


def test_random_bytes_and_a_flood_that_is_not_read_leave_others_their_answers(serving: Serving) -> None:
    chance = random.Random(1)
    flood = socket.create_connection(("127.0.0.1", serving.port))
    flood.setblocking(False)
    with ModbusClient(serving.port) as client:
        for _ in range(100):
            try:
                flood.send(struct.pack(">HHHBBHH", 1, 0, 6, 1, 4, 0, 52) * 1000)
            except BlockingIOError:
                pass
            except ConnectionError:
                break
            with socket.create_connection(("127.0.0.1", serving.port)) as noise:
                noise.sendall(chance.randbytes(chance.randrange(1, 300)))
            assert client.read(1, 1) == [1]
    flood.close()


@pytest.mark.slow
def test_a_client_that_does_not_take_its_answers_is_closed(serving: Serving) -> None:
    request = struct.pack(">HHHBBHH", 1, 0, 6, 1, 4, 0, 52) * 1000
    with ModbusClient(serving.port) as client:
        client.socket.setblocking(False)

        def is_closed() -> bool:
            try:
                client.socket.send(request)
            except BlockingIOError:
                return False
            except ConnectionError:
                return True
            return False

        wait_until(is_closed, "the end of the connection")


@pytest.mark.parametrize("name", GUIDES)
def test_every_register_is_that_of_the_value_beside_it(name: str) -> None:
    text = (FOLDER / f"{name}.md").read_text()
    lines = re.findall(r"^.*\bdata\[\d+\].*$", text, re.MULTILINE)
    assert len(lines) >= 7
    for line in lines:
        beside = line.rpartition("//")[2].strip()
        assert {int(number) for number in re.findall(r"\bdata\[(\d+)\]", line)} == {REGISTER_OF[beside]}, line
    assert f"word {REGISTER_OF['angle_u95_deg']}, `angle_u95_deg`" in text


@pytest.mark.parametrize("name", GUIDES)
def test_length_codes_and_the_number_for_not_known_are_those_of_the_map(name: str) -> None:
    text = (FOLDER / f"{name}.md").read_text()
    assert f"| 0, {REGISTERS} |" in text
    assert f"[0..{REGISTERS - 1}]" in text
    assert f"{NOT_KNOWN} means not known" in " ".join(text.split())
    assert "It is no safety function" in " ".join(text.split())
    assert re.search(r"T#2[sS]", text)
    assert STATE_CODES["fine"].number == LEVEL_CODES["normal"].number == 1
    assert (LEVEL_CODES["warn"].number, STATE_CODES["gateway gone"].number, STATE_CODES["link gone"].number) == (
        2,
        7,
        8,
    )
