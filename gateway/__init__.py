"""Plumbline: crane load swing, measured at the hoist rope."""

__version__ = "0.3.0"
