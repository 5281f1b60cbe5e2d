"""The command line: one module for each command, which calls the services of `rtshcua.app`."""
