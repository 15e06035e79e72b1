"""Copy the pictures of docs/elan-tutorial.md that signface draws: python build_elan_tutorial.py FOLDER

FOLDER is where the tutorial's commands were run. `elan-7-curves.png` is a picture of ELAN itself.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

HERE = Path(__file__).parent

if __name__ == "__main__":
    place = Path(sys.argv[1])
    shutil.copy(place / "mine/M1_EU_11.png", HERE / "elan-tutorial-take.png")
    shutil.copy(next(place.glob("agreement/agreement_affect@M1.png")), HERE / "elan-tutorial-agreement.png")
