"""What is on the wire: one file per chip or radio, the bus, the clock, simulated and replayed devices."""
