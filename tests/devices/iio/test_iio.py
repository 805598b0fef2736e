"""Linux IIO devices at a fake sysfs tree, with a named pipe in the place of the character device."""

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from devices.block import SampleBlock
from devices.errors import (
    ConfigurationReadBackError,
    DeviceError,
    DeviceNotFoundError,
    TransferError,
)
from devices.host_clock import HostClock
from devices.iio.accelerometer import IioAccelerometer
from tests.devices.iio.iio_tree import MPU6050, IioTree, adxl355_scan, mpu6050_scan
from tests.waiting import PATIENCE_S

PERIOD_NS = 8_000_000


@pytest.fixture
def tree(tmp_path: Path) -> Iterator[IioTree]:
    tree = IioTree(tmp_path)
    yield tree
    tree.close()


def new_device(tree: IioTree, name: str = "adxl355", **options: object) -> IioAccelerometer:
    arguments = {"clock": HostClock(), "odr_hz": 125.0, "root": tree.root, **options}
    return IioAccelerometer(name, **arguments)  # type: ignore[arg-type]


def scans(count: int, first: int = 0, start_ns: int | None = None) -> bytes:
    """`count` scans of a level sensor whose x reads the number of the scan, the last one made now."""
    newest_ns = time.monotonic_ns() if start_ns is None else start_ns + (first + count - 1) * PERIOD_NS
    return b"".join(
        adxl355_scan(first + k, -first - k, 256000, newest_ns - (count - 1 - k) * PERIOD_NS) for k in range(count)
    )


def read_all(device: IioAccelerometer, samples: int) -> list[SampleBlock]:
    blocks: list[SampleBlock] = []
    deadline = time.monotonic() + PATIENCE_S
    while sum(map(len, blocks)) < samples and time.monotonic() < deadline:
        if (block := device.read()) is not None:
            blocks.append(block)
    return blocks


def test_opening_sets_up_the_buffer_and_states_the_device(tree: IioTree) -> None:
    info = new_device(tree).open()
    assert (info.kind, info.device_id, info.unit, info.odr_hz) == ("iio", "iio-adxl355", "counts", 125.0)
    assert info.units_per_g == 256000.0  # the driver says 3.9 instead of 3.90625 ug
    assert info.full_scale_g == pytest.approx(2.048, abs=1e-5)
    assert tree.get("sampling_frequency") == "125"
    assert tree.get("current_timestamp_clock") == "monotonic"
    assert tree.get("buffer/enable") == "1"
    assert tree.get("buffer/watermark") == "8"
    assert int(tree.get("buffer/length")) >= 250
    elements = ("accel_x", "accel_y", "accel_z", "temp", "timestamp")
    enabled = {name for name in elements if tree.get(f"scan_elements/in_{name}_en") == "1"}
    assert enabled == {"accel_x", "accel_y", "accel_z", "timestamp"}


def test_readings_times_and_temperature_are_those_of_the_kernel(tree: IioTree) -> None:
    clock = HostClock()
    device = new_device(tree, clock=clock)
    device.open()
    start_ns = time.monotonic_ns() - 40 * PERIOD_NS
    tree.send(scans(20, start_ns=start_ns))
    tree.send(scans(20, first=20, start_ns=start_ns))
    blocks = read_all(device, 40)
    raw = np.concatenate([block.raw for block in blocks])
    assert np.array_equal(raw, [[k, -k, 256000] for k in range(40)])
    time_ns = np.concatenate([block.time_ns for block in blocks])
    expected_ns = start_ns + clock.anchor_ns + PERIOD_NS * np.arange(40)
    assert np.abs(time_ns - expected_ns).max() < 100_000  # the two clocks are read one after another
    assert np.all(np.diff(time_ns) == PERIOD_NS)
    assert blocks[0].temperature_c == pytest.approx(25 + (1795 - 1885) / -9.05, abs=0.01)
    assert sum(block.lost for block in blocks) == 0


@pytest.mark.parametrize("piece", [1, 7, 23, 25])
def test_scans_that_arrive_in_pieces_are_whole(tree: IioTree, piece: int) -> None:
    device = new_device(tree)
    device.open()
    data = scans(6)
    blocks = []
    for begin in range(0, len(data), piece):
        tree.send(data[begin : begin + piece])
        blocks += [block] if (block := device.read()) is not None else []
    assert np.concatenate([block.raw for block in blocks])[:, 0].tolist() == list(range(6))


def test_bytes_out_of_step_are_discarded_and_the_buffer_begins_anew(tree: IioTree) -> None:
    device = new_device(tree)
    device.open()
    start_ns = time.monotonic_ns() - 60 * PERIOD_NS
    tree.send(scans(4, start_ns=start_ns))
    assert len(read_all(device, 4)) == 1
    tree.send(scans(10, first=4, start_ns=start_ns)[3:-21])
    assert device.read() is None
    assert device.faults["misaligned"] == 1
    tree.send(scans(4, first=20, start_ns=start_ns))
    (block,) = read_all(device, 4)
    assert block.raw[:, 0].tolist() == [20, 21, 22, 23]
    assert block.lost == 16


def test_an_overrun_of_the_kernels_buffer_is_a_gap_in_the_timestamps(tree: IioTree) -> None:
    device = new_device(tree)
    device.open()
    start_ns = time.monotonic_ns() - 400 * PERIOD_NS
    tree.send(scans(5, start_ns=start_ns) + scans(5, first=105, start_ns=start_ns))
    before, after = read_all(device, 10)
    assert (before.lost, after.lost) == (0, 100)
    assert device.faults["overrun"] == 1


def test_without_a_monotonic_clock_samples_are_counted(tree: IioTree) -> None:
    (tree.folder / "current_timestamp_clock").unlink()
    device = new_device(tree)
    info = device.open()
    assert info.details["times"] == "counted"
    tree.send(scans(10, start_ns=-(10**18)))  # timestamps of a wall clock that was set meanwhile
    blocks = read_all(device, 10)
    assert np.all(np.diff(np.concatenate([block.time_ns for block in blocks])) == PERIOD_NS)


def test_saturated_samples_are_marked(tree: IioTree) -> None:
    device = new_device(tree)
    device.open()
    now_ns = time.monotonic_ns()
    rows = [(524287, 0, 0), (0, -524288, 0), (524286, 0, 0)]
    tree.send(b"".join(adxl355_scan(*row, now_ns - (2 - k) * PERIOD_NS) for k, row in enumerate(rows)))
    (block,) = read_all(device, 3)
    assert block.saturated is not None
    assert block.saturated.tolist() == [True, True, False]


def test_a_device_with_a_gyroscope_delivers_its_rates(tmp_path: Path) -> None:
    tree = IioTree(tmp_path, MPU6050)
    device = new_device(tree, "mpu6050", odr_hz=100.0, range_g=4.0)
    info = device.open()
    assert tree.get("in_accel_scale") == "0.001196"
    assert info.units_per_g == 8192.0
    assert info.gyro_rad_s_per_count == pytest.approx(np.radians(250) / 32768, rel=1e-3)
    tree.send(mpu6050_scan((1, 2, 8192), (-3, 4, 5), time.monotonic_ns()))
    (block,) = read_all(device, 1)
    assert block.raw.tolist() == [[1, 2, 8192]]
    assert block.gyro_counts is not None
    assert block.gyro_counts.tolist() == [[-3, 4, 5]]
    tree.close()


def test_a_device_is_found_by_its_label_where_two_have_its_name(tmp_path: Path) -> None:
    trees = [IioTree(tmp_path, number=number, label=label) for number, label in enumerate(("hook", "trolley"))]
    assert new_device(trees[0], "trolley").open().details["iio"] == "iio:device1"
    with pytest.raises(DeviceError, match="2 IIO devices have the name 'adxl355'; give the label"):
        new_device(trees[0]).open()
    with pytest.raises(DeviceNotFoundError, match="there are adxl355, hook, trolley; is its driver loaded"):
        new_device(trees[0], "bma456").open()
    for tree in trees:
        tree.close()


def test_a_device_that_vanishes_is_an_error_and_is_found_again_under_another_number(tmp_path: Path) -> None:
    tree = IioTree(tmp_path)
    device = new_device(tree)
    device.open()
    tree.send(scans(3))
    assert len(read_all(device, 3)) == 1
    tree.vanish()
    with pytest.raises(TransferError, match="has gone"):
        device.read()
    with pytest.raises(DeviceNotFoundError, match="no IIO device has the name"):
        device.open()
    again = IioTree(tmp_path, number=3)
    assert device.open().device_id == "iio-adxl355"
    again.send(scans(3))
    assert len(read_all(device, 3)) == 1
    again.close()


@pytest.mark.parametrize(
    "text", ["be:s20/32>>13", "be:s20/24>>4", "s16/16", "le:s16/16X2>>0", "le:f32/32>>0", "le:s0/16>>0"]
)
def test_a_wrong_scan_type_is_refused_with_its_file(tree: IioTree, text: str) -> None:
    tree.set("scan_elements/in_accel_y_type", text)
    with pytest.raises(DeviceError, match=r"in_accel_y_type: .*scan type"):
        new_device(tree).open()
    assert tree.get("buffer/enable") == "0"


def test_two_elements_at_one_place_are_refused(tree: IioTree) -> None:
    tree.set("scan_elements/in_accel_y_index", "0")
    with pytest.raises(DeviceError, match="two scan elements have the same index"):
        new_device(tree).open()


def test_a_rate_that_the_driver_refuses_is_named_with_what_is_available(
    tree: IioTree, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_text = Path.write_text

    def kernel(path: Path, text: str) -> int:
        return write_text(path, "125.000000" if path.name == "sampling_frequency" else text)

    monkeypatch.setattr(Path, "write_text", kernel)
    with pytest.raises(ConfigurationReadBackError, match=r"reads 125, device.odr_hz is 100; available are 4000.*125"):
        new_device(tree, odr_hz=100.0).open()


def test_an_attribute_that_cannot_be_written_is_an_error(tree: IioTree) -> None:
    path = tree.folder / "buffer/length"
    path.unlink()
    path.symlink_to("/dev/full")
    with pytest.raises(DeviceError, match="buffer/length: 250 is refused: No space left"):
        new_device(tree).open()


def test_a_missing_character_device_is_an_error(tree: IioTree) -> None:
    tree.pipe.unlink()
    with pytest.raises(DeviceNotFoundError, match="iio:device0: no such device"):
        new_device(tree).open()


def test_a_range_that_no_scale_reaches_is_refused(tmp_path: Path) -> None:
    tree = IioTree(tmp_path, MPU6050)
    with pytest.raises(DeviceError, match=r"has no range of 50 g; it has 2, 4, 7\.99, 16"):
        new_device(tree, "mpu6050", odr_hz=100.0, range_g=50.0).open()
    tree.close()


def test_a_device_without_an_axis_is_refused(tree: IioTree) -> None:
    for suffix in ("en", "type", "index"):
        (tree.folder / f"scan_elements/in_accel_z_{suffix}").unlink()
    with pytest.raises(DeviceError, match="has no scan element in_accel_z"):
        new_device(tree).open()
