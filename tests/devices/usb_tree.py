"""A folder like /sys/class/tty and /dev, into which USB adapters can be plugged."""

from pathlib import Path

from devices.serial_port import PortFolders


class UsbTree:
    """The terminals of a machine. Every adapter is a USB device with an interface that has a terminal."""

    def __init__(self, root: Path) -> None:
        self.folders = PortFolders(root / "by-id", root / "class" / "tty", root / "dev")
        self._devices = root / "devices" / "usb1"
        for folder in (self.folders.terminals, self.folders.dev, self._devices):
            folder.mkdir(parents=True)

    def plug_in(
        self, name: str, target: str, identity: str = "0403:6015", serial: str | None = "DN01", by_id: str | None = None
    ) -> None:
        """Give the terminal `target` a name, such as ttyUSB0, and the USB identity VID:PID."""
        device = self._devices / f"1-{name}"
        (device / "1-1:1.0" / name).mkdir(parents=True)
        vendor, product = identity.split(":")
        texts = {"idVendor": vendor, "idProduct": product, "product": "FT231X USB UART"} | (
            {"serial": serial} if serial else {}
        )
        for file, text in texts.items():
            (device / file).write_text(text + "\n")
        (self.folders.terminals / name).mkdir()
        (self.folders.terminals / name / "device").symlink_to(device / "1-1:1.0" / name)
        (self.folders.dev / name).symlink_to(target)
        if by_id:
            self.folders.by_id.mkdir(exist_ok=True)
            (self.folders.by_id / by_id).symlink_to(self.folders.dev / name)

    def unplug(self, name: str) -> None:
        """Remove the adapter of a terminal."""
        if self.folders.by_id.is_dir():
            for link in self.folders.by_id.iterdir():
                if link.readlink() == self.folders.dev / name:
                    link.unlink()
        (self.folders.dev / name).unlink()
        (self.folders.terminals / name / "device").unlink()
        (self.folders.terminals / name).rmdir()
        device = self._devices / f"1-{name}"
        for file in device.iterdir():
            if file.is_file():
                file.unlink()
        (device / "1-1:1.0" / name).rmdir()
        (device / "1-1:1.0").rmdir()
        device.rmdir()
