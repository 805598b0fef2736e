"""A reconciliation as one self-contained HTML file, for a person who was not there."""

from gateway.twin.report.page import report

__all__ = ["report"]
