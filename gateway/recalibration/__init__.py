"""Recalibration asked for from afar: requests, the session, its journal, the interlock and the audit. No threads, no clock."""
