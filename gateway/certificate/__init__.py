"""The calibration certificate: a record and its changes since its parent, on one sheet of paper."""
