"""The command line of mocapidx; installed as `mocapidx_cli`."""
