"""`python -m gateway` is `plumbline`."""

import sys

from gateway.cli.main import main

sys.exit(main())
