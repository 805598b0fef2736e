"""`python -m gateway` is `plumbline`."""

from gateway.cli.main import run_program

run_program()
