"""``python -m lfcore``, the same as ``lfcore``."""

import sys

from lfcore.cli import main

sys.exit(main())
