"""The verbs of `plumbline remote`: a gateway over the bus."""
