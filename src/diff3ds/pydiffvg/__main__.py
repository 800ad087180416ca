"""`python -m diff3ds.pydiffvg main.py --its args`: runs a script that imports pydiffvg, as python itself does."""

import runpy
import sys
from pathlib import Path

from diff3ds.pydiffvg import install


def main() -> None:
    """Runs the script that the first argument names, or with -m the module."""
    arguments = sys.argv[1:]
    if not arguments or arguments[0] in ("-h", "--help"):
        print("python -m diff3ds.pydiffvg SCRIPT.py ...  runs a script for DiffVG; so does -m MODULE ...")
        raise SystemExit(0 if arguments else 2)
    install()
    if arguments[0] == "-m" and len(arguments) > 1:
        sys.argv = arguments[1:]
        runpy.run_module(arguments[1], run_name="__main__", alter_sys=True)
        return
    if not Path(arguments[0]).exists():
        raise SystemExit(f"python -m diff3ds.pydiffvg: there is no script {arguments[0]}")
    sys.argv = arguments
    # "-m" has put the working folder there; of a script it is the folder that it lies in.
    sys.path[0] = str(Path(arguments[0]).resolve().parent)
    runpy.run_path(arguments[0], run_name="__main__")


if __name__ == "__main__":
    main()
