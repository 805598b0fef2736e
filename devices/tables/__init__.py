"""Tables of readings, of any program, and their replay."""
