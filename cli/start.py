"""Where the installed script enters: until the program is loaded, Ctrl-C ends it in silence.

Python itself would print a traceback through the imports. So nothing else is imported before.
"""

import signal

__all__ = ["start"]


def start() -> None:
    """Load the program and run it."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # `main` hears it in its own way
    from .main import main

    main()
