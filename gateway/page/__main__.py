"""`python -m gateway.page`; `gateway.page.parameters` describes its standard input."""

import sys

from gateway.extras import LIBRARIES

try:
    from gateway.page.server import main
except ModuleNotFoundError as missing:
    if missing.name not in LIBRARIES["page"]:
        raise
    print(f"page: {missing.name} is not installed; try pip install 'plumbline-gateway[page]'", file=sys.stderr)
    sys.exit(2)

sys.exit(main())
