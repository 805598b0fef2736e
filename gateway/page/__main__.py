"""`python -m gateway.page`: see `gateway.page.parameters` for what it reads from standard input."""

import os
import sys

EXTRA = ("starlette", "uvicorn")

try:
    from gateway.page.server import main
except ModuleNotFoundError as missing:
    if missing.name not in EXTRA:
        raise
    print(f"page: {missing.name} is not installed; mend: pip install 'plumbline-gateway[page]'", file=sys.stderr)
    sys.exit(2)

code = main()
sys.stderr.flush()
# At once: a thread of the bus library that is still in a callback must not meet the interpreter's end, which aborts it.
os._exit(code)
