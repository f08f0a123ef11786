"""The ledger: append-only records of a calibration laboratory in a hash chain, on SQLite or PostgreSQL."""
