"""What a person would try first, on the same files: for comparison with `plumbline reconcile`, whose arguments they take.

They share the twin's equations of motion with it and nothing else: no isolability, no held-out gate, no drops, no null test.
"""
