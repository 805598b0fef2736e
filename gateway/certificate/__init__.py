"""The calibration certificate: a record, and what changed since its parent, on one sheet of paper."""
