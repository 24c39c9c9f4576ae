import sys

from motorlink._cli import main

sys.exit(main())
