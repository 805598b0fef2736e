"""Sensors on an I2C bus: the chips, what they share, and the bus itself."""
