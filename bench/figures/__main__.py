import sys

from bench.figures.thesis import main

sys.exit(main())
