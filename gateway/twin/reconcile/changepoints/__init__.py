"""When an event began and ended: changepoints of the motion."""
