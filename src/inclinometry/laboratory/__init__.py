"""The calibration laboratory: tools, rigs, guided sessions, verifications and certificates, kept in a ledger."""
