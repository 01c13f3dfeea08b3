"""The program in a copy of a process that has imported it: a run costs what the command costs."""

import gc
import importlib
import os
import sys
import traceback
from pathlib import Path

import mocapidx.tasks
from mocapidx_cli.main import COMMANDS, main

__all__ = ["be_program", "import_program"]


def import_program():
    """Import all that any command needs, before copies of this process are made."""
    for name, _ in COMMANDS.values():
        importlib.import_module(f"mocapidx_cli.{name.partition(':')[0]}")
    for path in Path(mocapidx.tasks.__file__).parent.glob("*.py"):
        if path.stem != "cluster":  # which starts threads of its own
            importlib.import_module(f"mocapidx.tasks.{path.stem}")
    for name in ("backends.backend_agg", "figure"):
        importlib.import_module(f"matplotlib.{name}")
    gc.freeze()


def be_program(words):
    """Run a command line with the standard streams as they are, and end the process."""
    code = 99
    sys.stdin, sys.stdout, sys.stderr = (os.fdopen(n, m) for n, m in enumerate("rww"))
    sys.argv = ["mocapidx", *words]
    try:
        main()
    except SystemExit as exc:
        code = exc.code or 0
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
    finally:
        os._exit(code)
