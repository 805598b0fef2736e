"""Faults of network and processes against the delivery of alerts, in network namespaces with real processes (needs root)."""
