"""The service: robot files, runs, fits, command line, REST; the only place where the packages meet."""
