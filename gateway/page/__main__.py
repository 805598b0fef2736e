"""`python -m gateway.page`; `gateway.page.channel` describes its standard input."""

import sys

from gateway.extras import what_is_missing

if (missing := what_is_missing("page")) is not None:
    print(f"page: {missing}", file=sys.stderr)
    sys.exit(2)

from gateway.page.server import main

sys.exit(main())
