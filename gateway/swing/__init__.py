"""How far the load swings: the four published formulas, and a likelihood fit of the pendulum with its uncertainty."""
