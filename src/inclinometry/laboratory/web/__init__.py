"""The bench in a browser: guided calibration, results, certificates, ledger; and the REST interface beside it."""
